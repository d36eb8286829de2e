"""Which program's text graph a file is, where a user has named it by its path alone."""

from pathlib import Path

from . import toro
from .tagged import tags

SUFFIXES = (".g2o", ".toro", ".graph")
"""How the names of such files end."""


def format_of(path: Path) -> str:
    """The dataset that reads the graph in `path`, by its rows: g2o, toro or gtsam; InputError where it is no text.

    Rows that only GTSAM has are GTSAM's. EDGE2 rows are TORO's, with its order of the information, but for a file named
    .g2o: GTSAM comes with one, whose order is the other one. For all others g2o's reader is the one to judge.
    """
    found = tags(path)
    if not found.isdisjoint(_GTSAM_ALONE):
        return "gtsam"
    if not found.isdisjoint(toro.KINDS):
        return "gtsam" if path.suffix.lower() == ".g2o" else "toro"
    return "g2o"


_GTSAM_ALONE = {"ODOMETRY", "BR", "LANDMARK", "LANDMARK2"}

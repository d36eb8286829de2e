"""Detects the format of a text graph given by its path alone."""

from pathlib import Path

from . import toro
from .tagged import tags

SUFFIXES = (".g2o", ".toro", ".graph")
"""Endings of such files."""


def format_of(path: Path) -> str:
    """The dataset that reads the graph in `path`, by its rows: g2o, toro or gtsam; InputError if it is not text.

    Rows that only GTSAM has decide for gtsam. EDGE2 rows are TORO's, with its order of the information, except in a
    file named .g2o: GTSAM ships one with the other order. Any other file is left to g2o's reader.
    """
    found = tags(path)
    if not found.isdisjoint(_GTSAM_ALONE):
        return "gtsam"
    if not found.isdisjoint(toro.KINDS):
        return "gtsam" if path.suffix.lower() == ".g2o" else "toro"
    return "g2o"


_GTSAM_ALONE = {"ODOMETRY", "BR", "LANDMARK", "LANDMARK2"}

"""Detects the format of a text graph or laser log given by its path alone."""

from pathlib import Path

from . import toro
from .tagged import tags

CARMEN = (".clf", ".clf.gz")

SUFFIXES = (".g2o", ".toro", ".graph", *CARMEN)  # endings of such files


def format_of(path: Path) -> str:
    """The dataset that reads a file: carmen by its ending, g2o, toro or gtsam by its rows; InputError if it is no text.

    Rows that only GTSAM has decide for gtsam. EDGE2 rows are TORO's, with its order of the information, except in a
    file named .g2o: GTSAM ships one with the other order. Any other file is left to g2o's reader.
    """
    if path.name.lower().endswith(CARMEN):
        return "carmen"
    found = tags(path)
    if not found.isdisjoint(_GTSAM_ALONE):
        return "gtsam"
    if not found.isdisjoint(toro.KINDS):
        return "gtsam" if path.suffix.lower() == ".g2o" else "toro"
    return "g2o"


_GTSAM_ALONE = {"ODOMETRY", "BR", "LANDMARK", "LANDMARK2"}

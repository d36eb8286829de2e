"""Detects the format of a text graph or laser log given by its path alone."""

import gzip
import zlib
from pathlib import Path

from . import toro
from .tagged import tags

CARMEN = (".clf", ".clf.gz")
SCANS = (b"FLASER", b"ROBOTLASER1")  # the first words of its lines
BEGINNING = 1 << 18  # bytes in which a laser log under another name, such as .log.gz, has a scan

OTHERS = {".jrl": "jrl", ".pyfg": "pyfg"}  # endings that name the dataset

SUFFIXES = (".g2o", ".toro", ".graph", *OTHERS, *CARMEN)  # endings of such files


def is_carmen(path: Path) -> bool:
    """Tells if the path is that of a CARMEN log, by its ending or else by the lines at its beginning."""
    if path.name.lower().endswith(CARMEN):
        return not path.is_dir()
    try:
        if not path.is_file():
            return False
        with gzip.open(path) if path.suffix.lower() == ".gz" else path.open("rb") as file:
            lines = file.read(BEGINNING).split(b"\n")
    except (OSError, EOFError, zlib.error):
        return False
    return any(line.split(None, 1)[:1] == [word] for line in lines for word in SCANS)


def format_of(path: Path) -> str:
    """The dataset that reads a file: carmen, jrl or pyfg by its ending, else by its rows; InputError if it is no text.

    Rows that only GTSAM has decide for gtsam. EDGE2 rows are TORO's, with its order of the information, except in a
    file named .g2o: GTSAM ships one with the other order. Any other file is left to g2o's reader.
    """
    if path.name.lower().endswith(CARMEN):
        return "carmen"
    if path.suffix.lower() in OTHERS:
        return OTHERS[path.suffix.lower()]
    found = tags(path)
    if not found.isdisjoint(_GTSAM_ALONE):
        return "gtsam"
    if not found.isdisjoint(toro.KINDS):
        return "gtsam" if path.suffix.lower() == ".g2o" else "toro"
    return "g2o"


_GTSAM_ALONE = {"ODOMETRY", "BR", "LANDMARK", "LANDMARK2"}

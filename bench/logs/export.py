"""Writes a log in the formats of other programs, all of them or none."""

import os
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.files import beside
from ...core.truth.tum import write_tum
from ...datasets.formats import log_folder
from ...datasets.formats.g2o_write import write_g2o
from ...datasets.graphs.jrl_write import write_jrl
from ...datasets.graphs.pyfg_write import write_pyfg
from ..words.numerals import counted


def export_log(
    dataset: Dataset, formats: Sequence[str], out: Path, began: Callable[[str], None] = lambda _: None
) -> list[tuple[Path, str]]:
    """Writes each of the formats to the new folder `out`; returns the files with their content.

    `began` is told each format before it is written.
    """
    part = beside(out)
    try:
        part.mkdir(parents=True)
        said = list[tuple[str, str]]()
        for name in formats:
            began(name)
            said += FORMATS[name](part, dataset)
        os.replace(part, out)
    except InputError as error:  # of a file that is gone by the time it is read
        raise InputError(f"--out {str(error).replace(str(part), str(out))}") from None
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return [(out / file, what) for file, what in said]


def formats_of(text: str) -> list[str]:
    """Parses format names separated by commas; InputError for an unknown or repeated one."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in FORMATS:
            raise InputError(f"--as: found {name!r}, expected one of {', '.join(FORMATS)}.")
    if len(set(names)) < len(names):
        raise InputError(f"--as {text}: a format is named twice, expected once.")
    return names


def _graph(folder: Path, dataset: Dataset, file: str, write: Callable[[Path, Dataset], int]) -> list[tuple[str, str]]:
    log, left_out = dataset.log, write(folder / file, dataset)
    what = (
        f"{counted(len(log), 'pose')}, {counted(len(log.loop_to), 'loop closure')}, "
        f"{counted(len(log.seen) - left_out, 'sighting')}"
    )
    if left_out:
        what += f"; {left_out:,} of unknown landmarks are left out, the format has no place for them"
    return [(file, what)]


def _tum(folder: Path, dataset: Dataset) -> list[tuple[str, str]]:
    log, truth = dataset
    write_tum(folder / "odometry.tum", log.t, log.dead_reckoned())
    said = [("odometry.tum", f"{counted(len(log), 'pose')}, by odometry alone")]
    if truth is None or not len(truth.t):
        return said
    write_tum(folder / "truth.tum", truth.t, truth.poses)
    return [*said, ("truth.tum", counted(len(truth.t), "pose"))]


def _log(folder: Path, dataset: Dataset) -> list[tuple[str, str]]:
    log_folder.write(folder / "log", *dataset)
    return [("log", f"{counted(len(dataset.log), 'step')}, {counted(len(dataset.log.seen), 'sighting')}")]


FORMATS: dict[str, Callable[[Path, Dataset], list[tuple[str, str]]]] = {
    "g2o": partial(_graph, file="log.g2o", write=lambda path, dataset: write_g2o(path, dataset.log)),
    "gtsam": partial(_graph, file="log-gtsam.g2o", write=lambda path, dataset: write_g2o(path, dataset.log, True)),
    "jrl": partial(_graph, file="log.jrl", write=write_jrl),
    "pyfg": partial(_graph, file="log.pyfg", write=write_pyfg),
    "tum": _tum,
    "log": _log,
}
"""writers: each writes to a folder and returns the files with their content"""

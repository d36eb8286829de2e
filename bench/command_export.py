"""`bench export DATASET --as FORMATS --out FOLDER`: a log for other programs, or for other eyes."""

import argparse
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

from rich.console import Console

from ..datasets import logfile
from ..datasets.g2owriter import write_g2o
from ..frontend.dead_reckoning import dead_reckoned
from ..frontend.errors import InputError
from ..frontend.factors import Dataset
from ..frontend.files import beside
from ..frontend.tum import write_tum
from .load import made, one


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "g2o: log.g2o, a graph for g2o's programs. gtsam: log-gtsam.g2o, which "
        "gtsam.readG2o reads whole, but for the prior, which it has no row for. "
        "tum: odometry.tum, the dead-reckoned path, and truth.tum where there is a truth; evo reads both. "
        "log: the folder log, of CSV files, which bench run --dataset takes."
    )
    parser.add_argument("dataset", help="one dataset, options in brackets, or the path of a log, as in bench run")
    parser.add_argument(
        "--as", dest="formats", default="g2o,tum,log", metavar="FORMATS",
        help="g2o, gtsam, tum, log, separated by commas (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="a new folder for the files")
    parser.add_argument(
        "--seed", type=int, default=0, help="which log, as bench run numbers them (default: %(default)s)"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing")


def main(namespace: argparse.Namespace) -> int:
    """Write every format, or nothing at all; 0."""
    formats = _formats(namespace.formats)
    if namespace.seed < 0:
        raise InputError(f"--seed {namespace.seed}: expected a whole number, at least 0.")
    variant = one(namespace.dataset, "bench export")
    out: Path = namespace.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"--out {out}: exists and is not an empty folder, expected a new one.")
    dataset = made(variant, namespace.seed)

    part = beside(out)
    try:
        part.mkdir(parents=True)
        said = [sentence for name in formats for sentence in FORMATS[name](part, dataset)]
        os.replace(part, out)
    except InputError as error:  # of a file that is gone by the time it is read
        raise InputError(f"--out {str(error).replace(str(part), str(out))}") from None
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    console = Console(highlight=False, markup=False, soft_wrap=True, quiet=namespace.quiet)
    for file, what in said:
        console.print(f"{out / file}: {what}")
    return 0


def _formats(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in FORMATS:
            raise InputError(f"--as: found {name!r}, expected one of {', '.join(FORMATS)}.")
    if len(set(names)) < len(names):
        raise InputError(f"--as {text}: a format is named twice, expected once.")
    return names


def _graph(folder: Path, dataset: Dataset, file: str, for_gtsam: bool) -> list[tuple[str, str]]:
    log = dataset.log
    left_out = write_g2o(folder / file, log, for_gtsam=for_gtsam)
    what = f"{len(log):,} poses, {len(log.loop_to):,} loop closures, {len(log.ids) - left_out:,} sightings"
    if left_out:
        what += f"; {left_out:,} of unknown landmarks are left out, g2o has no place for them"
    return [(file, what)]


def _tum(folder: Path, dataset: Dataset) -> list[tuple[str, str]]:
    log, truth = dataset
    write_tum(folder / "odometry.tum", log.t, dead_reckoned(log))
    said = [("odometry.tum", f"{len(log):,} poses, by odometry alone")]
    if truth is None or not len(truth.t):
        return said
    write_tum(folder / "truth.tum", truth.t, truth.poses)
    return [*said, ("truth.tum", f"{len(truth.t):,} poses")]


def _log(folder: Path, dataset: Dataset) -> list[tuple[str, str]]:
    logfile.write(folder / "log", *dataset)
    return [("log", f"{len(dataset.log):,} steps, {len(dataset.log.ids):,} sightings")]


FORMATS: dict[str, Callable[[Path, Dataset], list[tuple[str, str]]]] = {
    "g2o": partial(_graph, file="log.g2o", for_gtsam=False),
    "gtsam": partial(_graph, file="log-gtsam.g2o", for_gtsam=True),
    "tum": _tum,
    "log": _log,
}
"""What each writes to a folder, and the files with what is in them."""

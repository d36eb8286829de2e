"""`bench export`: writes a log, or the table of a study's or run's cells, for other programs."""

import argparse
from pathlib import Path

from rich.console import Console

from ...core.errors import InputError
from ..logs.export import FORMATS, export_log, formats_of
from ..plan.load import made, one
from ..plan.values import seed
from ..record.table import export_cells, holds_cells
from ..words.console import screen_console
from ..words.stages import Stages


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = (
        "Of a dataset: g2o: log.g2o, a graph for g2o's programs. gtsam: log-gtsam.g2o, which "
        "gtsam.readG2o reads whole, but for the prior, which it has no row for. "
        "jrl: log.jrl, a JSON Robot Log; pyfg: log.pyfg, PyFG's text: both with the true poses and landmarks. "
        "tum: odometry.tum, the dead-reckoned path, and truth.tum where there is a truth; evo reads both. "
        "log: the folder log, of CSV files, which bench run --dataset takes. "
        "Of the folder of a study or a run: --csv or --parquet or both, one row per cell, with its parameters and all "
        "measurements; a study may be running meanwhile."
    )
    parser.add_argument(
        "what", metavar="DATASET|FOLDER",
        help="one dataset, options in brackets, or the path of a log, as in bench run; or the folder of a study or run",
    )  # fmt: skip
    log = parser.add_argument_group("of a dataset")
    log.add_argument("--as", dest="formats", metavar="FORMATS", help=f"{', '.join(FORMATS)} (default: {DEFAULT})")
    log.add_argument("--out", type=Path, metavar="FOLDER", help="a new folder for the files")
    log.add_argument("--seed", type=seed, help="which log, as bench run numbers them (default: 0)")
    cells = parser.add_argument_group("of a study or a run")
    cells.add_argument("--csv", type=Path, metavar="FILE", help="its cells as CSV")
    cells.add_argument("--parquet", type=Path, metavar="FILE", help="its cells as Parquet; needs pyarrow")
    parser.add_argument("--quiet", action="store_true", help="print nothing")


DEFAULT = "g2o,tum,log"
READING, WRITING = "reading or making the log", "writing {}"  # stages


def main(namespace: argparse.Namespace) -> int:
    """Writes every file, or nothing at all; 0."""
    said = _cells(namespace) if holds_cells(Path(namespace.what)) else _log(namespace)
    console = Console(emoji=False, highlight=False, markup=False, soft_wrap=True, quiet=namespace.quiet)
    for file, what in said:
        console.print(f"{file}: {what}")
    return 0


def _log(namespace: argparse.Namespace) -> list[tuple[Path, str]]:
    for option in ("csv", "parquet"):
        if getattr(namespace, option) is not None:
            raise InputError(
                f"--{option}: is for the folder of a study or a run, and {namespace.what} is none; "
                "expected --out, and --as, for a dataset."
            )
    out: Path | None = namespace.out
    if out is None:
        raise InputError(f"bench export {namespace.what}: expected --out FOLDER, a new folder for the files.")
    formats = formats_of(namespace.formats or DEFAULT)
    variant = one(namespace.what, "bench export")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"--out {out}: exists and is not an empty folder, expected a new one.")
    console = screen_console(quiet=namespace.quiet, aside=True)
    with Stages(console, {READING: 1.0, **{WRITING.format(name): 2.0 for name in formats}}) as stages:
        stages.begin(READING)
        dataset = made(variant, namespace.seed or 0)
        return export_log(dataset, formats, out, lambda name: stages.begin(WRITING.format(name)))


def _cells(namespace: argparse.Namespace) -> list[tuple[Path, str]]:
    folder = Path(namespace.what)
    for name, option in (("formats", "as"), ("out", "out"), ("seed", "seed")):
        if getattr(namespace, name) is not None:
            raise InputError(
                f"--{option}: is for a dataset, and {folder} is the folder of a study or a run; "
                "expected --csv FILE or --parquet FILE."
            )
    if namespace.csv is None and namespace.parquet is None:
        raise InputError(f"bench export {folder}: expected --csv FILE or --parquet FILE, for its cells.")
    return export_cells(folder, namespace.csv, namespace.parquet)

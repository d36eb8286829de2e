"""`bench validate`: lists everything that is wrong with a log, and what is legal yet odd."""

import argparse
import itertools
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset
from ...core.scan import Scan, attempted, told
from ...core.scan import counted as faults_counted
from ...datasets.formats import log_folder
from ...datasets.inertial.open import NOTE
from ...frontend.inertial.tilts import LEVELS
from ...frontend.inertial.words import about_levels, about_turns
from ..contradiction.remark import STAGES, explained, remarks
from ..plan.load import made
from ..plan.spec import dataset_variants
from ..plan.values import seed
from ..plan.variant import DatasetVariant
from ..systematic.delays import told_delays
from ..words.console import announced, screen_console
from ..words.names import short
from ..words.numerals import counted
from ..words.stages import Stages

SHOWN = 20  # problems of a log that are printed
READING = 6.0  # share of the time, by the unit of STAGES; of a log's folder it is three times that


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("log", nargs="+", metavar="LOG", help="the folder of a log, or a dataset as bench run --dataset takes it")
    add("--all", action="store_true", help=f"print every problem, not the first {SHOWN} of a log")
    add("--strict", action="store_true", help="a remark is a problem")
    add(
        "--explain", action="store_true", help="print which usual mistakes were tried, and how well the log then agrees"
    )
    add("--seed", type=seed, default=0, help="of a simulated dataset (default 0)")
    parser.epilog = (
        "Of a log's folder every problem is found, of any other dataset the first, in CSV tables the first lines of "
        "one file. The exit status is 0 where there is none, else 2; remarks are about what is legal yet odd, and "
        "count with --strict alone."
    )


def main(namespace: argparse.Namespace) -> int:
    """Prints the problems and remarks of every log; 2 if one has a problem."""
    shown = float("inf") if namespace.all else SHOWN
    return max(_found_and_validated(text, namespace.seed, shown, namespace) for text in namespace.log)


def _found_and_validated(text: str, seed: int, shown: float, wanted: argparse.Namespace) -> int:
    try:
        variants = dataset_variants(text, "bench validate")
    except InputError as error:
        print(error)
        return 2
    logs = [
        variant.log(at) for variant in variants for at in (range(len(variant.members)) if variant.members else (seed,))
    ]
    return max(_validated(log.dataset, log.seed, shown, wanted) for log in logs)


def _validated(variant: DatasetVariant, seed: int, shown: float, wanted: argparse.Namespace) -> int:
    named = getattr(variant.options, "name", None)
    place = str(named or getattr(variant.options, "path", None) or short(variant.label))
    reading, counting = f"reading {place}", f"counting what is in {place}"
    with Stages(screen_console(quiet=False, aside=True), {reading: READING, **STAGES, counting: 1.0}) as stages:
        stages.begin(reading)
        dataset, total = _printed(attempted(_scan(variant, seed)), shown, stages)
        odd = [] if total or dataset is None else remarks(dataset, stages.begin)
        stages.begin(counting)
        counts = "" if total or dataset is None else _counts(dataset)
    if total or dataset is None:
        hidden = f", of which the first {shown} are shown; --all shows them all" if total > shown else ""
        print(f"{place}: {total} problem{'s' * (total > 1)}{hidden}.")
        return 2
    for remark in odd:
        print(f"remark: {place}: {remark}.")
    if wanted.explain:
        with announced(f"trying the usual mistakes on {place}", screen_console(quiet=False, aside=True).print):
            said = explained(place, dataset)
        print(said)
        for told in told_delays(dataset.log):
            print(f"{place}: {told.sentence}")
    if odd and wanted.strict:
        print(f"{place}: {len(odd)} remark{'s' * (len(odd) > 1)}, which --strict refuses.")
        return 2
    found = f"can be read, with {counted(len(odd), 'remark')}" if odd else "good"
    print(f"{place}: {found}; {counts}.")
    if (inertial := dataset.log.notes.get(NOTE)) is not None:
        print(f"{place}: IMU: {inertial}.")
    for turns in about_turns(dataset.log.notes):
        print(f"{place}: {turns}.")
    if (levels := dataset.log.notes.get(LEVELS)) is not None:
        print(f"{place}: {about_levels(levels)}.")
    return 0


def _printed(scan: Scan[Dataset | None], shown: float, stages: Stages) -> tuple[Dataset | None, int]:
    """Prints problems, so many at most; returns the dataset and their number."""
    numbers = itertools.count(1)

    def tell(problem: InputError) -> None:
        if next(numbers) <= shown:
            stages.stop()
            print(problem)

    return told(faults_counted(scan), tell)


def _scan(variant: DatasetVariant, seed: int) -> Scan[Dataset | None]:
    """Yields every problem of a log's folder, the first of any other dataset; returns the dataset."""
    if variant.name == "log" and variant.options.path is not None:
        return (yield from log_folder.scan(Path(variant.options.path)))
    return made(variant, seed)


def _counts(dataset: Dataset) -> str:
    log, truth = dataset
    ids = log.seen
    landmarks = counted(len(np.unique(ids[ids != UNKNOWN])), "landmark")
    known = "no truth"
    if truth is not None and (len(truth.t) or truth.map is not None):
        places = "" if truth.map is None else f" and of {counted(len(truth.map.ids), 'landmark')}"
        known = f"{truth.kind} of {counted(len(truth.t), 'step')}{places}"
    sighted = f"{counted(len(log), 'step')}, {counted(len(ids), 'sighting')} of {landmarks}"
    sighted += "" if log.partial is None or not len(log.partial) else f", {log.partial.words(len(ids))}"
    sighted += "" if log.signatures is None else ", the whole ones with signatures"
    sighted += "" if log.fixes is None else f", {len(log.fixes):,} positions or headings in the world"
    sighted += "" if log.gyro is None else f", {counted(len(log.gyro), 'turn')} by a gyro"
    return f"{sighted}, {known}; digest {log.digest[:12]}"

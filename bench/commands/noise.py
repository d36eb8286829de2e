"""`bench noise LOG ...`: measures the noise of logs, and states it in a log."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ...core.errors import InputError
from ...core.factors import Dataset
from ...datasets.formats import log_folder
from ...datasets.noise.model import Model
from ...datasets.noise.noise_file import noted, read_noise, write_noise
from ...datasets.noise.stated import stated
from ..noise.measured import Noise, measured
from ..noise.recommended import backends, unstated
from ..noise.words import rows, sentences
from ..plan.load import made
from ..plan.spec import dataset_variants
from ..plan.values import check_file, seed
from ..words.console import announced, plain, screen_console, tell
from ..words.names import called


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = (
        "With a true path, errors of odometry and sightings are measured by it; several logs are taken to have the "
        "same noise. Without one, the EKF's innovations tell the sizes, which takes up to a minute. Noise measured on "
        "some logs is stated in another one by two commands: --save NOISE.toml, then bench noise LOG --noise "
        "NOISE.toml --apply FOLDER. Where errors are correlated in time, sightings are given larger covariances, "
        "so that together they have the information that correlated ones have. With --own each "
        "keeps its own, for a backend that estimates the correlated part of the errors. Backends to use are named."
    )
    add = parser.add_argument
    add("log", nargs="+", metavar="LOG", help="as in bench run --dataset: a name, options in brackets, or a path")
    add("--seed", type=seed, default=0, metavar="N", help="of a dataset that is drawn (default 0)")
    add("--out", type=Path, metavar="FILE", help="a page (.html) with pictures")
    add("--save", type=Path, metavar="FILE", help="the noise, for --noise (.toml)")
    add("--noise", type=Path, metavar="FILE", help="state the noise in this file, instead of measuring it")
    add("--apply", type=Path, metavar="FOLDER", help="write the one LOG to a new folder, its stated noise as found")
    add(
        "--own",
        action="store_true",
        help="with --apply: state each sighting's own covariance, and name the backend that estimates its slow errors",
    )
    add("--json", action="store_true", help="print the numbers as JSON, and nothing else")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Measures or reads the noise, prints it and writes what is asked for; 0."""
    logs = [
        variant.log(at)
        for text in namespace.log
        for variant in dataset_variants(text, "bench noise")
        for at in (range(len(variant.members)) if variant.members else (namespace.seed,))
    ]
    _check(namespace, len(logs))
    model = None if namespace.noise is None else read_noise(namespace.noise)
    datasets = [made(log.dataset, log.seed) for log in logs]
    console = screen_console(quiet=namespace.quiet or namespace.json)
    if model is None:
        names = called([log.dataset.label for log in logs])
        with announced("measuring the noise", screen_console(quiet=namespace.quiet, aside=True).print):
            noise = measured(datasets, [log.name or names[log.dataset.label] for log in logs])
        model = noise.model
        if noise.frame is not None:
            datasets = [noise.frame.put_right(datasets[0])]
        _written(noise, namespace)
        _print(console, noise, namespace)
    if namespace.apply is not None:
        dataset = _apply(datasets[0], model, namespace.apply, own=namespace.own)
        console.print(f"log: {namespace.apply}, {len(dataset.log):,} steps", highlight=False, markup=False)
        if said := "" if namespace.own else unstated(dataset.log, model):
            tell(console, f"remark: {said}.")
        for name in backends(model, own=namespace.own):
            tell(console, f"backend: {name}")
    return 0


def _check(namespace: argparse.Namespace, logs: int) -> None:
    check_file("--out", namespace.out, (".html",))
    check_file("--save", namespace.save, (".toml",))
    if namespace.apply is not None and logs > 1:
        raise InputError(
            f"--apply {namespace.apply}: found {logs} logs, expected one; --save the noise of several, and "
            "state it in one with --noise."
        )
    if namespace.own and namespace.apply is None:
        raise InputError("--own: expected --apply FOLDER beside it, for the log with these covariances.")
    if namespace.noise is None:
        return
    for option in ("out", "save", "json"):
        if getattr(namespace, option):
            raise InputError(f"--{option}: nothing is measured with --noise, expected --apply alone.")
    if namespace.apply is None:
        raise InputError("--noise: expected --apply FOLDER beside it, for the log with that noise.")


def _apply(dataset: Dataset, model: Model, folder: Path, *, own: bool) -> Dataset:
    log = stated(dataset.log, model, own=own)
    log_folder.write(folder, log, dataset.truth)
    return Dataset(log, dataset.truth)


def _written(noise: Noise, namespace: argparse.Namespace) -> None:
    if namespace.out is not None:
        from ..noise.page import write_page  # matplotlib

        write_page(namespace.out, noise)
    if namespace.save is not None:
        write_noise(namespace.save, noise.model)


def _print(console: Console, noise: Noise, namespace: argparse.Namespace) -> None:
    if namespace.json:
        print(json.dumps(as_json(noise), indent=2, allow_nan=False))
        return
    for sentence in sentences(noise):
        console.print(plain(sentence), highlight=False)
    for remark in noise.remarks:
        console.print(f"remark: {plain(remark)}.", highlight=False)
    console.print()
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=True, header_style="dim")
    table.add_column("noise")
    table.add_column("value", justify="right")
    table.add_column("95 % interval", justify="right")
    for row in rows(noise):
        table.add_row(plain(row.name), row.value, row.interval)
    console.print(table, highlight=False)
    for name, path in (("page", namespace.out), ("noise", namespace.save)):
        if path is not None:
            tell(console, f"{name}: {path}")


def as_json(noise: Noise) -> dict[str, object]:
    """Returns sentences, remarks, numbers with their intervals, and the noise to state."""
    return {
        "logs": list(noise.labels),
        "sentences": sentences(noise),
        "remarks": list(noise.remarks),
        "numbers": [
            {"name": row.name, "value": row.estimate.value, "low": row.estimate.low, "high": row.estimate.high,
             "unit": row.unit}
            for row in rows(noise)
        ],
        "noise": noted(noise.model),
    }  # fmt: skip

"""`bench show LOG`: draws a log and prints its numbers, before anything is run on it."""

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ...datasets.remarks import refuse
from ..contradiction.remark import remarks
from ..logs.facts import facts, headline, noted
from ..logs.numbers import STAGES, Subject, described
from ..logs.shown_path import LARGEST
from ..plan.load import made, one
from ..plan.values import check_file, seed
from ..plan.variant import DatasetVariant
from ..words.console import plain, screen_console, tell
from ..words.names import called, short
from ..words.stages import Stages

KINDS = (".png", ".svg", ".pdf", ".html")
READING = "reading or making the log"  # a stage


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.epilog = (
        "The picture goes to NAME-log.png in the current folder unless --out is given; with --json none is drawn "
        "without --out. A log without truth is drawn along its batch optimum, which may take half "
        "a minute the first time and is kept; a larger one along dead reckoning."
    )
    add = parser.add_argument
    add("log", metavar="LOG", help="as in bench run --dataset: a name, options in brackets, or a path")
    add("--seed", type=seed, default=0, metavar="N", help="of a dataset that is drawn (default 0)")
    add("--out", type=Path, metavar="FILE", help="the picture (.png .svg .pdf), or a page (.html)")
    add(
        "--solve",
        action=argparse.BooleanOptionalAction,
        help=f"find the batch optimum where there is no truth (default: up to {LARGEST:,} steps and sightings)",
    )
    add("--strict", action="store_true", help="refuse a log with a remark")
    add("--json", action="store_true", help="print the numbers as JSON, and nothing else")
    add("--quiet", action="store_true", help="print nothing but errors")


def main(namespace: argparse.Namespace) -> int:
    """Shows it; 0 where the log can be used."""
    variant = one(namespace.log, "bench show")
    out = namespace.out or (
        None if namespace.json else Path(f"{_file(variant, namespace.log) or variant.slug}-log.png")
    )
    place = out.resolve() if out is not None and out.is_symlink() else out  # a link stays: its target is written
    check_file("--out", place, KINDS)
    aside = screen_console(quiet=namespace.quiet or namespace.json, aside=True)
    with Stages(aside, {READING: 6.0, **STAGES}) as stages:
        stages.begin(READING)
        dataset = made(variant, namespace.seed)
        if namespace.strict:
            refuse(variant.label, remarks(dataset))
        label = _file(variant, namespace.log) or called([variant.label])[variant.label]
        label += f", seed {namespace.seed}" if variant.numbered else ""
        label += f", {short(name)}" if (name := variant.log(namespace.seed).name) else ""
        subject = described(label, dataset, namespace.solve, stages.begin)
    console = screen_console(quiet=namespace.quiet or namespace.json)
    if namespace.seed and not variant.numbered:
        console.print(f"{variant.name} draws nothing at random: it is the same for every --seed", highlight=False)
    if namespace.json:
        print(json.dumps(as_json(variant.label, namespace.seed, subject), indent=2, allow_nan=False))
    else:
        _print(console, subject)
    if place is None:
        return 0
    from ..logs.show import write_page, write_picture  # matplotlib: the numbers are printed before it loads

    write = write_page if place.suffix.lower() == ".html" else write_picture
    write(place, subject)
    tell(console, f"picture: {out}")
    return 0


def as_json(label: str, seed: int, subject: Subject) -> dict[str, Any]:
    """The numbers as JSON takes them: m, rad and s, null for what the log has not."""
    about = {"log": label, "seed": seed, "path": subject.shown.words, "remarks": subject.remarks.all}
    return about | _plain(subject.numbers)


def _plain(value: Any) -> Any:
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    return value


def _print(console: Console, subject: Subject) -> None:
    console.print(f"[bold]{plain(subject.label)}[/]: {plain(headline(subject.numbers))}", highlight=False)
    shown_facts = Table.grid(padding=(0, 2))
    shown_facts.add_column(no_wrap=True, style="dim")
    shown_facts.add_column()
    for heading, text in facts(subject.numbers, subject.shown.words, mistaken=subject.remarks.mistaken):
        shown_facts.add_row(heading, plain(text))
    for remark in subject.remarks.all:
        shown_facts.add_row("remark", plain(remark))
    for heading, text in noted(subject.dataset.log.notes, settings=False):
        shown_facts.add_row(plain(heading), plain(text))
    console.print(shown_facts, highlight=False)


def _file(variant: DatasetVariant, given: str) -> str:
    """The name of the file or folder that was given as the log, "" where a dataset was named."""
    named = given.strip().strip('"')
    return Path(named).resolve().stem if getattr(variant.options, "path", None) == named else ""

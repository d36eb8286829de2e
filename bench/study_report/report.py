"""Writes a study's report: report.html, one file without network or script; report.md, answers.json, figures/."""

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...core.files import write_whole
from ..claims import conclusion
from ..drawing.figure import write_figures
from ..drawing.page import rendered
from ..words.columns import COLUMNS
from ..words.numerals import lasting
from .evidence import SIGNS, VERDICTS, Evidence, evidence
from .tables import claim_grid, median_grid

FIGURES = "figures"  # folder beside the page


def write(folder: Path, forms: Sequence[str] = ()) -> Path:
    """Writes the study's report, each file whole, figures also in `forms` ("png", "pdf"); returns the page's path."""
    found = evidence(folder)
    write_figures(folder / FIGURES, found.figures, forms)
    write_whole(folder / "answers.json", json.dumps(_answers(found), indent=1, allow_nan=False) + "\n")
    page = filled(found)
    for name in ("md", "html"):
        write_whole(folder / f"report.{name}", rendered(f"study.{name}.jinja", page))
    return folder / "report.html"


def filled(found: Evidence) -> dict[str, Any]:
    """Collects the values for the templates."""
    measures = dict.fromkeys([*(answer.claim.measure for answer in found.answers), *(f.y for f in found.study.figures)])
    return {
        "found": found,
        "study": found.study,
        "words": found.words,
        "signs": SIGNS,
        "kinds": VERDICTS,
        "claims": claim_grid(found.answers),
        "grids": [median_grid(numbers) for numbers in found.medians],
        "started": datetime.fromtimestamp(found.words["started"], UTC),
        "took": lasting(found.seconds),
        "command": again(found),
        "definitions": {name: COLUMNS[name] for name in measures if name in COLUMNS},
    }


SIZED = re.compile(r"\bfull\s*=")  # found in a study's file that has a larger full size


def again(found: Evidence) -> Mapping[str, str]:
    """The commands to run it again, by what they do."""
    command = _whole(found.words["command"])
    plain = [word for word in command if word != "--full"]
    commands = {"Go on, or run what has changed": shlex.join(command)}
    if found.standing.failed:
        commands["Run again what failed"] = shlex.join([*command, "--retry"])
    if found.study.size == "quick" and SIZED.search(found.study.text):
        commands["At full size"] = shlex.join([*plain, "--full"])
    return commands


def _whole(command: Sequence[str]) -> list[str]:
    words = iter(command)
    kept: list[str] = []
    for word in words:
        if word in ("--only", "--limit"):
            next(words, None)
        elif word != "--retry" and not word.startswith(("--only=", "--limit=")):
            kept.append(word)
    return kept


def _answers(found: Evidence) -> dict[str, Any]:
    study = found.study
    about = {name: getattr(study, name) for name in ("name", "title", "size", "question", "source", "finding", "note")}
    return {**about, "cells": found.standing.counts, **conclusion.document(found.conclusion)}

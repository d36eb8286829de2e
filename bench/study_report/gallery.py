"""Writes the gallery: many studies on one page, each with its question, figure and answer.

`python -m slamduel.bench.study_report.gallery [FOLDER]` makes FOLDER/index.html (results/gallery) of the studies below
it.
"""

import os
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import quote

from ...core.errors import InputError, SlamduelError
from ...core.files import write_whole
from ..drawing.page import rendered
from ..record.schema import FILE
from ..words.numerals import counted, lasting
from .evidence import SIGNS, VERDICTS, Evidence, evidence

FOLDER, PAGE = Path("results/gallery"), "index.html"

ORDER = ("no", "open", "yes")  # what was not reproduced comes first


def gallery(folders: Iterable[Path], out: Path) -> Path:
    """Writes a page of the studies in these folders; names unreadable ones. InputError where none is readable."""
    found: list[Evidence] = []
    left_out: list[str] = []
    for folder in folders:
        try:
            found.append(evidence(folder))
        except SlamduelError as error:
            left_out.append(str(error))
    if not found:
        raise InputError(left_out[0] if left_out else f"{out.parent}: found no study; expected folders with {FILE}.")
    found.sort(key=lambda one: ORDER.index(one.conclusion.reproduced))
    answers = [answer.verdict for one in found for answer in one.answers]
    page = {
        "claims": f"{answers.count('holds')} of {counted(len(answers), 'claim')} hold",
        "studies": [
            (one, quote(Path(os.path.relpath(one.folder / "report.html", out.parent)).as_posix()), lasting(one.seconds))
            for one in found
        ],
        "headline": headline(found),
        "took": lasting(sum(one.seconds for one in found)),
        "cells": sum(one.standing.cells for one in found),
        "left_out": left_out,
        "signs": SIGNS,
        "kinds": VERDICTS,
    }
    write_whole(out, rendered("gallery.html.jinja", page))
    return out


def headline(found: Iterable[Evidence]) -> str:
    """Counts the published findings that were reproduced, and the others."""
    verdicts = Counter(one.conclusion.reproduced for one in found if one.study.finding and one.answers)
    total = verdicts.total()
    if not total:
        return "No published finding among these studies"
    said = [f"{verdicts['yes']} of {counted(total, 'published finding')} reproduced"]
    said += [f"{verdicts['no']} not"] * bool(verdicts["no"])
    said += [f"{verdicts['open']} not decided"] * bool(verdicts["open"])
    return ", ".join(said)


def main(words: list[str]) -> int:
    """Makes the page of the studies below the folder that `words` name."""
    folder = Path(words[0]) if words else FOLDER
    try:
        page = gallery((path.parent for path in sorted(folder.glob(f"*/{FILE}"))), folder / PAGE)
    except SlamduelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

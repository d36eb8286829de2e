"""A comparison of two runs as Markdown, as a table for the terminal, as JSON, and for Python."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from ..drawing.page import rendered
from ..verdict import changes as judged
from ..verdict.changes import FEW, GAIN, GONE, NEW, QUANTITIES, REGRESSION, Change, by_how_much, summary
from ..verdict.pairing import PairedRuns, paired_runs, side
from ..words.names import called
from ..words.numerals import listed, number


class Comparison:
    """Compares the results of two folders; a notebook or a script reads its changes, or shows it."""

    def __init__(self, found: PairedRuns, least: float | None = None) -> None:
        """`least`: the smallest share that counts as a change, for every quantity its own where None."""
        self.found, self.least = found, least
        self.changes: Sequence[Change] = judged.changes(found, least)

    @property
    def notes(self) -> Sequence[str]:
        """Returns sentences on what was left out, or needs caution."""
        return self.found.notes

    @property
    def regressed(self) -> bool:
        """True where anything has become worse."""
        return judged.regressed(self.changes)

    def markdown(self) -> str:
        """Returns Markdown for a pull request."""
        return markdown(self.found, list(self.changes), self.least)

    def __repr__(self) -> str:
        worse_or_better = [c for c in self.changes if _striking(c)]
        said = [f"{c.verdict}: {c.backend} on {c.dataset}: {c.quantity} {by_how_much(c)}" for c in worse_or_better]
        return "\n".join([*said, *self.notes, judged.rest(self.changes), summary(self.changes)])


def compare(
    old: Path | str, new: Path | str, *, least: float | None = None, any_machine: bool = False, any_log: bool = False
) -> Comparison:
    """Compares two folders of runs or studies as `bench compare`; `least` is the smallest share that counts."""
    found = paired_runs(side(Path(old)), side(Path(new)), any_machine=any_machine, any_log=any_log)
    return Comparison(found, least)


SIGNS = {REGRESSION: "🔴 ", GAIN: "🟢 "}
STYLES = {REGRESSION: "bold red", GAIN: "green", FEW: "yellow", NEW: "cyan", GONE: "cyan"}


def markdown(found: PairedRuns, told: list[Change], least: float | None) -> str:
    """Writes Markdown for a pull request: a line, the changes, and the rest in fold-outs."""
    first = [change for change in told if _striking(change)]
    said = summary(told)
    page = {
        "summary": said[0].upper() + said[1:],
        "counts": judged.rest(told),
        "old": found.old.folder,
        "new": found.new.folder,
        "first": first,
        "rest": [change for change in told if change not in first],
        "notes": found.notes,
        "differences": found.differences,
        "method": method(least),
        "signs": SIGNS,
        "shown": shown,
        "names": called([c.dataset for c in told]),
        "change": by_how_much,
    }
    return rendered("compare.md.jinja", page)


def table(told: list[Change]) -> Table | None:
    """Makes a table for the terminal of what has changed by more than the least that counts; None if nothing has."""
    striking = [change for change in told if _striking(change)]
    if not striking:
        return None
    about = "old and new are medians, the change is the typical one log by log"
    grid = Table(box=box.SIMPLE_HEAD, collapse_padding=True, caption=about, caption_justify="left")
    for heading in ("", "backend, dataset", ""):
        grid.add_column(heading, overflow="fold")
    for heading in ("old", "new"):
        grid.add_column(heading, justify="right", no_wrap=True)
    for heading in ("change", ""):
        grid.add_column(heading, overflow="fold")
    names = called([c.dataset for c in told])
    for c in striking:
        where = Text(f"{c.backend}, {names[c.dataset]}")
        values = (shown(c, c.old), shown(c, c.new), by_how_much(c), Text(c.words))
        grid.add_row(Text(c.verdict, STYLES.get(c.verdict, "")), where, c.quantity, *values)
    return grid


def document(found: PairedRuns, told: list[Change], least: float | None) -> dict[str, Any]:
    """The comparison as JSON takes it."""
    return {
        "status": int(judged.regressed(told)),
        "summary": summary(told),
        "old": str(found.old.folder),
        "new": str(found.new.folder),
        "least": {q.words: q.least if least is None else least for q in QUANTITIES},
        "changes": [judged.as_json(change) for change in told],
        "differences": [dict(zip(("what", "old", "new"), row, strict=True)) for row in found.differences],
        "notes": list(found.notes),
    }


def method(least: float | None) -> str:
    """Describes the method of comparison."""
    counts = listed(
        [f"{100 * (q.least if least is None else least):g} % in {q.words.split(',')[0]}" for q in QUANTITIES]
    )
    return (
        "Old and new are medians over the logs that both ran on; the change is the typical one, log by log. It is a "
        "regression or a gain where the Wilcoxon signed-rank test, after Holm's correction over all comparisons of its "
        "kind (accuracy, consistency, each of the costs), is below 5 %, the 95 % interval excludes no change, and it "
        f"is at least as large as counts: {counts}. A backend without randomness on factors that are the same to "
        "the last bit needs no test: where there are too few logs for one, changes hold for these "
        "logs. A time that both runs measured in 3 rounds or more (--repeats) needs no test either: all of the 95 % "
        "interval of its ratio over these is beyond what counts. NEES is compared by how far it is from 1, as a factor."
        " A failure counts as worse than any error. A cell that was done and now fails or is skipped, "
        "or has no error or NEES any more, is a regression whatever the statistics."
    )


def shown(change: Change, value: float) -> str:
    """Writes a median, or how many failed; "" where there is none."""
    if change.kind == "failures":
        return f"{value:.0f}"
    return "" if math.isnan(value) else "failed" if math.isinf(value) else number(value)


def _striking(change: Change) -> bool:
    return change.verdict in (REGRESSION, GAIN, NEW, GONE) or (change.verdict == FEW and change.beyond)

"""Judges data association: the share of the sightings whose made-up ids are right, with its significance."""

from collections.abc import Sequence

import numpy as np

from ..words.numerals import chance, listed
from .statistics import FEWEST, LEVEL, Shift, holm, median_over, shift
from .summary import Line

MOST = 6  # backends that the sentence names
COLUMNS = ("wrong_share", "final_wrong_share")


def association_sentences(lines: Sequence[Line]) -> list[str]:
    """States the shares of right ids, the highest first, and which are significantly below it; [] without any."""
    column = next((name for name in COLUMNS if any(name in line.values for line in lines)), None)
    if column is None:
        return []
    wrong = {
        line.backend: {log: min(max(share, 0.0), 1.0) for log, share in line.by_log(column).items()}  # of any record
        for line in lines
        if column in line.values
    }
    of = lines[0].units
    medians = {name: median_over(values, of) for name, values in wrong.items()}
    order = sorted(medians, key=lambda name: medians[name])
    best, others = order[0], order[1:]
    shifts: list[Shift] = []
    for name in others:
        both = [log for log in wrong[best] if log in wrong[name]]
        apart = np.array([wrong[name][log] - wrong[best][log] for log in both])
        shifts.append(shift(apart, units=[of.unit(log) for log in both]))
    adjusted = holm([found.p for found in shifts])
    parts = [f"{best}'s ids are right for {_percent(1 - medians[best])} of the sightings that it used"]
    for name, found, p in list(zip(others, shifts, adjusted.tolist(), strict=True))[: MOST - 1]:
        test = f" ({_words(found, p)})" if found.units >= FEWEST else ""
        parts.append(f"{name}'s for {_percent(1 - medians[name])}{test}")
    if len(others) >= MOST:
        parts.append(f"those of {len(others) - MOST + 1} others for {_percent(1 - medians[order[-1]])} or more")
    which = f"{of}, median" if of.logs > 1 else "one log"
    return [f"Data association ({which}): {listed(parts)}."]


def _words(found: Shift, p: float) -> str:
    """Describes a difference from the best."""
    if p < LEVEL and found.low > 0:
        return f"significantly fewer, Wilcoxon, Holm: {chance(p)}"
    if p < LEVEL and found.high < 0:
        return f"significantly more, Wilcoxon, Holm: {chance(p)}"
    return "no significant difference"


def _percent(share: float) -> str:
    """Writes a share of which the rest counts: 99.81 %."""
    rest = 1 - share
    digits = 1 if rest >= 0.01 else 2
    return f"{100 * share:.{digits}f} %"

"""The end of a mutated log: refused, remarked on, the same within noise, worse in silence, or crashed."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from slamduel.backends import registry
from slamduel.bench.contradiction.remark import remarks
from slamduel.bench.measure.cell import Job, run_on
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset

WORSE = 2.0  # times the unmutated ATE
BAND = 0.3, 3.0  # of NEES over its dimension, a multiple of the unmutated one if that is above 1
LESS = ("hole", "ends early", "begins late", "thinned", "damaged")  # data that is missing may cost accuracy
UNTOLD = ("no truth",)  # nothing is left that an error could be measured from
ENDS = ("refused", "remarked", "same", "worse", "crashed")


class Ended(NamedTuple):
    """How one mutation ended."""

    kind: str  # of the mutation
    end: str  # of ENDS
    words: str  # the refusal, the remark, or the numbers


def in_any_order(kinds: Iterable[str], seed: int) -> list[str]:
    """The kinds of a family in an order of the seed's, so that few cases are of all sorts."""
    return np.random.default_rng(seed).permutation(sorted(kinds)).tolist()


def result(made: Dataset) -> tuple[dict[str, Any], str]:
    """The row of an EKF on the log, and everything that is said of log and cell."""
    builder = registry.find("ekf")
    found = run_on(Job("ekf", "ekf", builder.options(), 0, 8000), lambda: made.log, lambda: made.truth)
    said = [*remarks(made), found.reason, *([f"ends as {found.status}"] if found.status != "done" else [])]
    return found.row, "; ".join(filter(None, said))


def sound(made: Dataset) -> dict[str, Any]:
    """The row of an EKF on an unmutated log, without a remark."""
    row, said = result(made)
    assert not said, said
    assert BAND[0] <= row["nees"] <= BAND[1], row["nees"]
    return row


def judged(kind: str, load: Callable[[], Dataset], right: dict[str, Any]) -> Ended:
    """Runs the log and compares with the unmutated row `right`."""
    try:
        made = load()
        row, said = result(made)
    except InputError as error:
        return refusal(kind, str(error))
    except Exception as error:
        return Ended(kind, "crashed", f"{type(error).__name__}: {error}")
    return Ended(kind, "remarked", said) if said else Ended(kind, *compared(kind, row, right))


def refusal(kind: str, sentence: str) -> Ended:
    """A refusal, which is one line and a sentence; else a crash."""
    whole = "\n" not in sentence and sentence[-1:] in (".", "?")
    return Ended(kind, "refused" if whole else "crashed", sentence)


def compared(kind: str, row: dict[str, Any], right: dict[str, Any]) -> tuple[str, str]:
    """Compares a row without any remark with the unmutated one: "same" or "worse", and the numbers."""
    numbers = f"ATE {row.get('ate_m')}, NEES {row.get('nees')}; unmutated {right['ate_m']}, {right['nees']}"
    if row.get("nees") is None or row.get("ate_m") is None:
        return ("same" if kind.endswith(UNTOLD) else "worse"), f"no NEES or no ATE: {numbers}"
    off = not BAND[0] <= row["nees"] <= BAND[1] * max(1.0, right["nees"])
    worse = off or (row["ate_m"] > WORSE * right["ate_m"] and not kind.endswith(LESS))
    return ("worse" if worse else "same"), numbers

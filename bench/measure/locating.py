"""Computes the columns of a start that is not known: how soon, how surely and how rightly the robot is found."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Log, Truth
from ...core.se2 import Array
from ...core.truth.errors import difference
from .drive import Outcome

TURNED = np.pi / 6  # rad: a heading that is more than this off is wrong


def from_the_fix_on(log: Log, outcome: Outcome, truth: Truth) -> Truth:
    """The truth of the steps at which the robot was located: all of them from a known start."""
    located = outcome.located[np.searchsorted(log.t, truth.t)]
    return truth._replace(t=truth.t[located], poses=truth.poses[located])


def poses_judged(known: Mapping[str, Any], arrays: Mapping[str, Any]) -> Array:
    """The true poses of the steps `at` that a cell's path was judged at, of a log's `known` truth: from the fix on."""
    return known["poses"][np.searchsorted(known["t"], arrays["t"][arrays["at"]])]


def locating(log: Log, outcome: Outcome, truth: Truth | None) -> dict[str, Any]:
    """The columns by name; none where the start is known. `truth` has the steps from the fix on."""
    if log.prior.start == "known" or log.prior.map is None:
        return {}
    located = outcome.located
    row: dict[str, Any] = {"located_share": float(located.mean())}
    if not located.any():
        return row
    first = int(located.argmax())
    row |= {"locate_steps": first + 1, "locate_ms": float(outcome.step_ns[: first + 1].sum()) / 1e6}
    if outcome.online is not None and truth is not None and truth.kind == "truth" and len(truth.t):
        path = outcome.online[np.searchsorted(log.t, truth.t)]
        row["wrong_fix_share"] = float(elsewhere(path, truth.poses, gap(log.prior.map.xy)).mean())
    return row


def elsewhere(path: Array, truth: Array, apart: float) -> NDArray[np.bool]:
    """True (m,) where a pose is farther than `apart` (m) from the true one, or turned from it."""
    off = np.abs(difference(path, truth))
    return (np.hypot(off[:, 0], off[:, 1]) > apart) | (off[:, 2] > TURNED)


def gap(xy: Array) -> float:
    """Computes the median distance, m, of a landmark (n, 2) from its nearest other one; infinite for fewer than two.

    A robot found by the wrong landmarks is at least that far off.
    """
    nearest = [np.partition(np.hypot(*(xy - one).T), 1)[1] for one in xy] if len(xy) > 1 else [np.inf]
    return float(np.median(nearest))

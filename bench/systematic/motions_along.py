"""Motions of a log along a path: how far they are from it, and which of two paths they are those of."""

from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints, between
from ...core.truth.errors import difference, rows_of
from ..measure.stated_noise import normalised, typical_scale
from .windows import windows

SURE = 10.0
"""Log likelihood by which motions fit one path better than another, at least, where they are said to be its own."""

LEAST = 1e-9
"""Of sizes that are compared: that of exact motions is 0."""


class Unlike(NamedTuple):
    """Errors of motions, over the noise stated."""

    size: float  # the typical one of a component
    windows: int  # of time, over which they are added up


def unlike(log: Log, path: Array, driven: Ints) -> Unlike:
    """The motions of a log to the steps `driven` against a path (n, 3)."""
    squares = _squares(log, path, driven)
    return Unlike(typical_scale(squares, 3) if len(squares) else 0.0, len(squares))


def far_out(log: Log, path: Array, driven: Ints, limit: float) -> tuple[float, int]:
    """The share of windows of time in which motions have a normalised square over `limit`, and the windows' number."""
    squares = _squares(log, path, driven)
    return float((squares > limit).mean()) if len(squares) else 0.0, len(squares)


def _squares(log: Log, path: Array, driven: Ints) -> Array:
    """(w,) normalised squares of the motions' errors, added up over each window of time."""
    first = windows(log.t, driven)
    if not len(first):
        return np.zeros(0)
    off = difference(log.delta[driven], between(path[driven - 1], path[driven]))
    off, cov = (np.add.reduceat(one, first) for one in (off, log.delta_cov[driven]))
    return normalised(off, cov)


def by_truth(log: Log, truth: Truth) -> tuple[Array, Ints]:
    """The true path at the steps of a log (n, 3), of any poses where it is not known, and the steps driven along it."""
    at = rows_of(truth.t, log.t)
    return truth.poses[np.maximum(at, 0)], np.flatnonzero((at[1:] >= 0) & (at[:-1] >= 0)) + 1


def ratio(own: Unlike, other: Unlike) -> float:
    """The log likelihood by which the motions of as many windows fit the first path better, of any size of noise."""
    return 3 * own.windows * float(np.log(max(other.size, LEAST) / max(own.size, LEAST)))

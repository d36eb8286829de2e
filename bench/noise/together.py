"""Correlation between the errors of landmarks sighted at one step."""

import numpy as np

from ...core.se2 import Array, Ints
from ..systematic.estimated import Estimated
from .likelihood import TWO_SIDED

FEWEST = 50  # fewest pairs of sightings of one step
BLOCKS = 20  # stretches that are left out in turn, for the interval


def together(step: Ints, error: Array) -> Estimated | None:
    """The correlation of pairs of errors (n,), over their standard deviations, at one step of all logs' (n,).

    Its interval is a block jackknife's, since errors are correlated in time; None for too few pairs.
    """
    _, at = np.unique(step, return_inverse=True)
    count, total, squares = (np.bincount(at, weights) for weights in (None, error, error**2))
    if (count * (count - 1)).sum() / 2 < FEWEST or len(count) < 2 * BLOCKS:
        return None
    products, sizes = (total**2 - squares) / 2, (count - 1) * squares / 2
    block = np.arange(len(count)) * BLOCKS // len(count)
    parts = np.stack([np.bincount(block, column) for column in (products, sizes)])
    whole = parts.sum(axis=1)
    without = whole[:, None] - parts
    if not whole[1] > 0 or not (without[1] > 0).all():
        return None
    value = float(whole[0] / whole[1])
    spread = (without[0] / without[1] - value) ** 2
    half = TWO_SIDED * float(np.sqrt((BLOCKS - 1) / BLOCKS * spread.sum()))
    return Estimated(value, value - half, value + half)

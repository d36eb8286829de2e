"""Scores which loop closures a final path rejects against those that are known to be false.

A path rejects a loop that it contradicts by more than the loop's stated noise explains. Path and log alone decide, so
that all backends are judged alike: whether they weigh loops by a loss, reject them by a gate, or trust each of them,
and whoever's program they are. There Huber's, Cauchy's and Geman and McClure's losses of the default scales have
weights of 0.33, 0.26 and 0.22, all below one half, and graduated non-convexity rejects from the same distance on.
"""

from typing import Any

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array
from .misfit import loop_misfits

BEYOND = 16.266
"""Squared Mahalanobis distance that 999 of 1000 correct loops stay within: chi-square, 3 degrees of freedom."""


def rejected_loops(log: Log, truth: Truth | None, path: Array) -> dict[str, Any]:
    """The columns of the loops that the final `path` (n, 3) rejects; shares where it is known which are false."""
    if not len(log.loop_to):
        return {}
    rejected = loop_misfits(log, path) > BEYOND
    row: dict[str, Any] = {"loops_rejected": int(rejected.sum())}
    if truth is None or truth.false_loops is None:
        return row
    false = np.zeros(len(rejected), np.bool)
    false[truth.false_loops] = True
    if rejected.any():
        row["loop_precision"] = float(false[rejected].mean())
    if false.any():
        row["loop_recall"] = float(rejected[false].mean())
    return row

"""Filters a stretch of a log with the EKF: how far its innovations are from what their covariances say."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtr

from ...backends import registry as backends
from ...backends.api import Diverged
from ...core.factors import Log

WIDEST = 60.0
"""Logarithm of NIS, either way, beyond which it is infinite or 0."""


def nis(stretches: Sequence[Log]) -> float | None:
    """Returns the EKF's NIS per degree of freedom over all stretches; infinite where it gets lost, None without any.

    It is the factor that puts half of the steps' NIS above the median of chi-square: outliers hardly change it.
    """
    found = [of for log in stretches for of in _steps(log)]
    if not found:
        return None
    squares, dof = np.array(found).T
    if not np.isfinite(squares).all():
        return np.inf

    def above(logarithm: float) -> float:
        return float(np.median(chdtr(dof, squares / np.exp(logarithm)))) - 0.5

    if above(WIDEST) > 0:
        return np.inf
    if above(-WIDEST) < 0:
        return 0.0
    found: Any = brentq(above, -WIDEST, WIDEST)
    return float(np.exp(found))


def _steps(log: Log) -> list[tuple[float, int]]:
    """NIS and degrees of freedom of each step that has an innovation."""
    builder, found = backends.find("ekf"), list[tuple[float, int]]()
    ekf = builder.make(log.prior, builder.options(), np.random.default_rng(0))
    try:
        for step in log:
            ekf.step(step)
            belief = ekf.belief()
            if belief is not None and belief.nis is not None and belief.nis_dof:
                found.append((belief.nis, belief.nis_dof))
    except Diverged:
        return [(np.inf, 1)]
    return found

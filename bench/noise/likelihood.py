"""Maximum likelihood with 95 % intervals, within bounds."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...core.se2 import Array
from ..systematic.estimated import Estimated

TWO_SIDED = 1.959964  # standard deviations of a normal 95 % interval
DROP = 1.920729  # by how much the log-likelihood falls at the ends of a profile's 95 % interval

_STEP = 1e-3  # of the second differences
_HALVINGS = 20  # of the search for the end of a profile's interval


class Maximum(NamedTuple):
    """The maximum of a log-likelihood."""

    at: Array  # (p,)
    low: Array  # (p,) ends of the 95 % intervals
    high: Array  # (p,)
    value: float  # the log-likelihood

    def estimate(self, k: int, of: Callable[[float], float] = float) -> Estimated:
        """Parameter `k` and its interval, through the increasing function `of`."""
        return Estimated(of(float(self.at[k])), of(float(self.low[k])), of(float(self.high[k])))


def maximum(log_likelihood: Callable[[Array], float], start: Array, low: Array, high: Array) -> Maximum:
    """Maximises by quasi-Newton steps from `start` (p,), between `low` and `high`.

    Intervals are those of the observed information. A parameter that ends at a bound has the profile's interval on its
    other side, and the others' are conditional on it.
    """
    at, value = _climbed(log_likelihood, np.clip(start, low, high), low, high)
    free = (at > low + _STEP) & (at < high - _STEP)
    sd = np.full(len(at), np.inf)
    if free.any():
        sd[free] = _standard_errors(-_second_differences(log_likelihood, at, np.flatnonzero(free).tolist()))
    ends = np.maximum(at - TWO_SIDED * sd, low), np.minimum(at + TWO_SIDED * sd, high)
    for k in np.flatnonzero(~free).tolist():
        away = high[k] if at[k] <= low[k] + _STEP else low[k]
        ends[0][k] = ends[1][k] = at[k]
        ends[int(away > at[k])][k] = _profile_end(log_likelihood, at, value, k, float(away), (low, high))
    return Maximum(at, *ends, value)


def _climbed(f: Callable[[Array], float], start: Array, low: Array, high: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize

    bounds = list(zip(low.tolist(), high.tolist(), strict=True))
    found: Any = minimize(lambda p: -f(p), start, method="L-BFGS-B", bounds=bounds)
    return found.x, -float(found.fun)


def _profile_end(
    f: Callable[[Array], float], at: Array, value: float, k: int, away: float, bounds: tuple[Array, Array]
) -> float:
    """The value between `at[k]` and `away` where the maximum over all other parameters has fallen by DROP."""
    low, high = bounds
    near, far = float(at[k]), away
    for _ in range(_HALVINGS):
        middle = (near + far) / 2
        held_low, held_high, begin = low.copy(), high.copy(), at.copy()
        held_low[k] = held_high[k] = begin[k] = middle
        fallen = value - _climbed(f, begin, held_low, held_high)[1] > DROP
        near, far = (near, middle) if fallen else (middle, far)
    return (near + far) / 2


def _second_differences(f: Callable[[Array], float], at: Array, free: list[int]) -> Array:
    steps = _STEP * np.eye(len(at))[free]
    middle, bend = f(at), np.zeros((len(free), len(free)))
    for i, a in enumerate(steps):
        bend[i, i] = (f(at + a) - 2 * middle + f(at - a)) / _STEP**2
        for j, b in enumerate(steps[:i]):
            crossed = f(at + a + b) - f(at + a - b) - f(at - a + b) + f(at - a - b)
            bend[i, j] = bend[j, i] = crossed / (4 * _STEP**2)
    return bend


def _standard_errors(information: Array) -> Array:
    """Roots of the diagonal of the inverse; inf where the likelihood does not bend."""
    values, vectors = np.linalg.eigh(information)
    inverse = np.divide(1.0, values, out=np.full_like(values, np.inf), where=values > 1e-9)
    squares = np.where(vectors**2 > 1e-12, vectors**2, 0.0)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.nansum(squares * inverse, axis=1))

"""Intervals by the jackknife where few stretches of a log tell of an error."""

import numpy as np
import pytest

from slamduel.bench.systematic.estimated import Estimated
from slamduel.bench.systematic.jackknife import degrees, estimates
from slamduel.bench.systematic.reduced import Reduced
from slamduel.core.se2 import Array
from slamduel.datasets.noise.systematic import NAMES, Systematic

DELAY, X, STRETCHES = NAMES.index("delay"), NAMES.index("x"), 24


def equations(H: Array, g: Array) -> Reduced:
    """Of what each stretch tells: (b, p, p) and (b, p)."""
    return Reduced(H.sum(axis=0), g.sum(axis=0), H.sum(axis=0) - H, g.sum(axis=0) - g)


def told(shares: Array, noise: Array) -> Reduced:
    """Equations of a delay at its estimate, of which each stretch has so much information, and such noise (b,)."""
    H, g = np.zeros((len(shares), len(NAMES), len(NAMES))), np.zeros((len(shares), len(NAMES)))
    H[:, DELAY, DELAY] = shares
    g[:, DELAY] = shares * estimate(shares, noise) - np.sqrt(shares) * noise
    return equations(H, g)


def estimate(shares: Array, noise: Array) -> float:
    """By least squares, of a delay of 0."""
    return float((np.sqrt(shares) * noise).sum() / shares.sum())


def test_as_many_degrees_as_stretches_that_tell() -> None:
    noise = np.random.default_rng(1).standard_normal(STRETCHES)
    assert degrees(told(np.ones(STRETCHES), noise), ["delay"])[DELAY] == pytest.approx(STRETCHES - 1)
    few = np.where(np.arange(STRETCHES) < 4, 1.0, 0.0)
    assert degrees(told(few, noise), ["delay"])[DELAY] == pytest.approx(3)
    assert degrees(told(np.eye(STRETCHES)[0], noise), ["delay"])[DELAY] == 1.0


def test_what_another_error_explains_does_not_count() -> None:
    """Stretches in which the delay looks as a place ahead do tell nothing of it, once that is estimated, too."""
    H = np.zeros((STRETCHES, len(NAMES), len(NAMES)))
    both = np.array([X, DELAY])
    for k in range(STRETCHES):
        row = np.array([1.0, 1.0 if k >= 3 else -1.0])
        H[k][np.ix_(both, both)] = np.outer(row, row)
    joint = equations(H, np.zeros((STRETCHES, len(NAMES))))
    assert degrees(joint, ["delay"])[DELAY] == pytest.approx(STRETCHES - 1)
    assert degrees(joint, ["x", "delay"])[DELAY] < 5


@pytest.mark.parametrize("few", [3, 4, 8, STRETCHES])
def test_intervals_hold_where_few_stretches_tell(few: int) -> None:
    """Of 4,000 draws 98.1 to 95.0 %, the more the fewer tell; with 23 degrees for all, 91.2 to 95.0 %."""
    rng = np.random.default_rng(2)
    shares, inside = np.where(np.arange(STRETCHES) < few, 1.0, 0.02), list[bool]()
    for noise in rng.standard_normal((4000, STRETCHES)):
        at = Systematic(delay=estimate(shares, noise))
        one: Estimated = estimates(at, told(shares, noise), ["delay"])["delay"]
        inside.append(one.low <= 0 <= one.high)
    assert 0.94 < np.mean(inside) < 0.985

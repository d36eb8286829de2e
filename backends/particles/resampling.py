"""Resampling of weighted particles to equally weighted ones, by four schemes.

Each takes the weights (M,), which need not sum to 1, and returns the ancestors (M,), sorted: particle m is to become a
copy of particle ancestors[m]. In all of them the expected number of copies of a particle is M times its share of the
weight; they differ in its variance. Douc, Cappé and Moulines, "Comparison of resampling schemes for particle filtering"
(2005): the variance of residual and stratified resampling never exceeds multinomial's; for the systematic scheme that
cannot be proved, but it rarely does, and costs one random number.
"""

from collections.abc import Callable, Mapping

import numpy as np

from ...core.se2 import Array, Ints
from ._ancestry import chosen

Scheme = Callable[[Array, np.random.Generator], Ints]


def systematic(weights: Array, rng: np.random.Generator) -> Ints:
    """M equidistant points, shifted together by one random number: Probabilistic Robotics, table 4.4.

    A particle gets its expected number of copies, rounded down or up.
    """
    M = len(weights)
    return chosen(weights, (rng.random() + np.arange(M)) / M)


def stratified(weights: Array, rng: np.random.Generator) -> Ints:
    """One random point in each M-th of the unit interval: M random numbers."""
    M = len(weights)
    return chosen(weights, (rng.random(M) + np.arange(M)) / M)


def residual(weights: Array, rng: np.random.Generator) -> Ints:
    """Copies by the expected number rounded down; draws the rest from the remainders, one random number a copy."""
    M = len(weights)
    expected = weights * (M / weights.sum())
    copies = np.floor(expected).astype(np.int64)
    left = M - int(copies.sum())
    if left > 0:
        copies += np.bincount(multinomial(expected - copies, rng, left), minlength=M)
    return np.repeat(np.arange(M), copies)


def multinomial(weights: Array, rng: np.random.Generator, draws: int | None = None) -> Ints:
    """Draws every ancestor independently: `draws` random numbers, by default M."""
    return chosen(weights, np.sort(rng.random(len(weights) if draws is None else draws)))


SCHEMES: Mapping[str, Scheme] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}

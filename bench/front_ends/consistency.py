"""Errors of a front end's factors on drives with known truth, beside the covariances that it states."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, wrap


class Consistency(NamedTuple):
    """The errors of factors of one kind, and what was stated of them."""

    kind: str  # step | neighbours | loop
    factors: int
    true: tuple[float, float, float]  # m, m, rad: root of the mean squared error, in the axes of the motion
    stated: tuple[float, float, float]  # the same of the mean covariance
    nees: float  # mean over three degrees of freedom; 1 is exact


def compared(kind: str, off: Array, cov: Array) -> Consistency:
    """Compares the errors (n, 3) of factors with their covariances (n, 3, 3)."""
    true = np.sqrt((off**2).mean(axis=0)).tolist()
    stated = np.sqrt(np.diag(cov.mean(axis=0))).tolist()
    squares = np.einsum("ni,ni->n", off, np.linalg.solve(cov, off[:, :, None])[:, :, 0])
    return Consistency(kind, len(off), tuple(true), tuple(stated), float(squares.mean() / 3))


def errors(delta: Array, first: Array, second: Array) -> Array:
    """(n, 3) the errors of motions `delta` (n, 3) between true poses (n, 3)."""
    off = delta - between(first, second)
    off[:, 2] = wrap(off[:, 2])
    return off


def gathered(kind: str, parts: Sequence[tuple[Array, Array]]) -> list[Consistency]:
    """The comparison of several drives' errors and covariances; none without factors."""
    kept = [part for part in parts if len(part[0])]
    return [compared(kind, *(np.concatenate(column) for column in zip(*kept, strict=True)))] if kept else []

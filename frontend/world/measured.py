"""Positions and headings in the world, x east and y north, as a sensor measured them: each at its own time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints


class Measured(NamedTuple):
    """Measurements in the order of time, as `core.fixes` has them: what was not measured is NaN."""

    t: Array  # (f,) s, by the clock of the wheels' readings
    z: Array  # (f, 3) m, rad
    cov: Array  # (f, 3, 3)
    arm: Array  # (f, 2) m, the antenna's place on the robot

    def taken(self, rows: NDArray[np.bool_] | Ints) -> "Measured":
        """Those of the `rows`, a mask or indices."""
        return Measured(*(column[rows] for column in self))

    @property
    def placed(self) -> NDArray[np.bool_]:
        """(f,) which are positions; the others are headings."""
        return np.isfinite(self.z[:, 0])


def positions(t: Array, xy: Array, cov: Array, antenna: Array) -> Measured:
    """Positions `xy` (f, 2), m, of the antenna at `t` (f,), s, with covariances `cov` (f, 2, 2)."""
    z, full = np.full((len(t), 3), np.nan), np.full((len(t), 3, 3), np.nan)
    z[:, :2], full[:, :2, :2] = xy, cov
    return Measured(t, z, full, np.tile(antenna, (len(t), 1)))


def headings(t: Array, heading: Array, sd: float) -> Measured:
    """Headings (f,), rad, at `t` (f,), s."""
    z, cov = np.full((len(t), 3), np.nan), np.full((len(t), 3, 3), np.nan)
    z[:, 2], cov[:, 2, 2] = heading, sd**2
    return Measured(t, z, cov, np.zeros((len(t), 2)))


def joined(one: Measured, other: Measured) -> Measured:
    """Both, in the order of time; positions before headings of one time."""
    t, z, cov, arm = (np.concatenate(columns) for columns in zip(one, other, strict=True))
    order = np.argsort(t, kind="stable")
    return Measured(t[order], z[order], cov[order], arm[order])

"""Measurements of the pose in the world: a position by GPS, a heading by compass, or a prior on any step."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .arrays import even, frozen, frozen_ids, numbers, sorted_ids
from .se2 import Array, Ints, wrap


class Fixes(NamedTuple):
    """The f fixes of one step: each measures one, two or all three of x, y and heading.

    x and y are those of a point of the body, the antenna. Unmeasured ones are NaN, as are their rows and columns of
    the covariance.
    """

    z: Array  # (f, 3) x, y (m), heading (rad) in the world
    cov: Array  # (f, 3, 3) in the world frame, positive definite in what is measured
    arm: Array  # (f, 2) m, the antenna's place in the body frame


NO_FIXES = Fixes(frozen(np.zeros((0, 3))), frozen(np.zeros((0, 3, 3))), frozen(np.zeros((0, 2))))
"""Those of a step without any."""


@dataclass(frozen=True, eq=False)
class FixTable:
    """The fixes of a log as columns; those of step k are rows `first[k]:first[k + 1]`."""

    first: Ints  # (n + 1,)
    z: Array  # (f, 3)
    cov: Array  # (f, 3, 3)
    arm: Array  # (f, 2)

    @classmethod
    def from_arrays(cls, steps: int, step: Ints, z: Array, cov: Array, arm: Array | None = None) -> "FixTable":
        """The table of a log of that many steps; `step` (f,), sorted, is each row's. The arrays are copied.

        Without `arm` the antenna is at the body's origin. InputError for values that are not numbers or not sorted;
        `check` judges the values themselves.
        """
        place = np.zeros((len(z), 2)) if arm is None else numbers("fixes.arm", arm)
        return cls(
            frozen_ids(np.searchsorted(sorted_ids("fixes.step", step), np.arange(steps + 1))),
            frozen(numbers("fixes.z", z)),
            frozen(even(numbers("fixes.cov", cov))),
            frozen(place),
        )

    def __len__(self) -> int:
        return len(self.z)

    def at(self, k: int) -> Fixes:
        """The rows of step k, as views."""
        rows = slice(self.first[k], self.first[k + 1])
        return Fixes(self.z[rows], self.cov[rows], self.arm[rows])

    @property
    def step(self) -> Ints:
        """(f,) the step of every row."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def columns(self) -> Mapping[str, Array | Ints]:
        """All of them by name, for digests and archives."""
        return {f"fixes.{name}": getattr(self, name) for name in ("first", "z", "cov", "arm")}

    def rows(self, kept: Any) -> "FixTable":
        """The table with the rows `kept` alone, ascending indices or a mask; of as many steps."""
        return FixTable.from_arrays(len(self.first) - 1, self.step[kept], self.z[kept], self.cov[kept], self.arm[kept])

    def head(self, steps: int) -> "FixTable":
        """The rows of the first steps."""
        n = self.first[steps]
        return FixTable.from_arrays(steps, self.step[:n], self.z[:n], self.cov[:n], self.arm[:n])


def residual(pose: Array, z: Array, arm: Array) -> tuple[Array, Array]:
    """Measured minus expected, (3,), of one fix at a pose, and the expectation's Jacobian (3, 3) by the pose.

    With the antenna at a in the body, the expectation is (p + R a, heading); unmeasured entries and their rows are 0.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]
    off = z - (pose[0] + x, pose[1] + y, pose[2])
    off[2] = wrap(off[2])
    jacobian = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    unmeasured = np.isnan(z)
    off[unmeasured], jacobian[unmeasured] = 0.0, 0.0
    return off, jacobian


def information(cov: Array) -> Array:
    """(..., 3, 3) information of fixes' covariances (..., 3, 3): zero where nothing is measured."""
    unmeasured = np.isnan(cov)
    return np.where(unmeasured, 0.0, np.linalg.inv(np.where(unmeasured, np.eye(3), cov)))

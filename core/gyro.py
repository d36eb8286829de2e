"""Turns that a gyro measures between steps, with a bias that drifts: a factor of its own beside odometry.

The turn since the step before is

    turn = heading - heading before + bias dt + noise

wrapped, with the gyro's rates summed over `dt`, so that its derivative by the bias is `dt`, and its noise is white. The
bias has a prior, and moves between rows by a random walk. A log's maker gathers the walk at few rows, some seconds
apart: between two of these the bias is one number, the same for every backend.

A motion u ~ N(delta, Q) by wheels and a turn say the same as a motion that depends on the bias b, and what both
together tell of it (Q_t is the heading's column of Q, Q_tt its last entry):

    u ~ N(delta + K (turn - delta_t - b dt), Q - K Q_t'),    K = Q_t / (Q_tt + var)
    turn - delta_t = b dt + noise of variance Q_tt + var

`conditioned` splits them so. It is exact, for any filter: the second line corrects the bias, and the first one moves.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .arrays import frozen, frozen_ids, numbers, sorted_ids
from .errors import InputError
from .se2 import Array, Ints, wrap

STILL = 5e-3
"""m/s and rad/s: a robot whose wheels say less stands still."""

CORRELATED = 30.0
"""s; the error of a bias that is estimated in front of a backend is taken for independent between stretches of it."""


class Bias(NamedTuple):
    """The belief about a gyro's bias before its first turn."""

    mean: float = 0.0  # rad/s
    sd: float = 0.0  # rad/s; 0: it is known


class Turn(NamedTuple):
    """The turn since the step before, by the gyro."""

    turn: float  # rad, in (-pi, pi]
    var: float  # rad^2, of its white noise
    dt: float  # s, over which the rates were summed
    walk: float  # (rad/s)^2, by which the bias has moved since the row before


class Conditioned(NamedTuple):
    """A motion by wheels and gyro together, of m steps, given a bias of zero; and what both tell of the bias.

    The motion at another bias is delta + slope bias. Bias times dt is `told`, with variance `told_var`.
    """

    delta: Array  # (m, 3) m, rad
    cov: Array  # (m, 3, 3)
    slope: Array  # (m, 3) by the bias
    told: Array  # (m,) rad
    told_var: Array  # (m,) rad^2


@dataclass(frozen=True, eq=False)
class Gyro:
    """The turns of a log as columns, at most one a step; a step without has no row. Row j is of step `step[j]`."""

    step: Ints  # (n,) ascending, from 1 on
    turn: Array  # (n,)
    var: Array  # (n,)
    dt: Array  # (n,)
    walk: Array  # (n,)
    bias: Array  # (2,) of `Bias`

    @classmethod
    def from_arrays(
        cls, step: Ints, turn: Array, var: Array, dt: Array, walk: Array | None = None, bias: Bias | None = None
    ) -> "Gyro":
        """The table of n turns: see `Turn` for the columns. The arrays are copied.

        Without `walk` the bias is constant; without `bias` it is known to be zero. InputError for values that are not
        numbers, not sorted, or of other lengths; `check` judges the values themselves.
        """
        own = sorted_ids("gyro.step", step)
        columns = {"turn": turn, "var": var, "dt": dt, "walk": np.zeros(len(own)) if walk is None else walk}
        made = {name: frozen(numbers(f"gyro.{name}", column)) for name, column in columns.items()}
        for name, column in made.items():
            if column.shape != own.shape:
                raise InputError(f"gyro.{name}: found shape {column.shape}, expected {own.shape}, one for each step.")
        return cls(frozen_ids(own), **made, bias=frozen(np.array(bias or Bias(), np.float64)))

    def __len__(self) -> int:
        return len(self.step)

    @property
    def columns(self) -> Mapping[str, Array | Ints]:
        """All of them by name, for digests and archives."""
        return {f"gyro.{name}": getattr(self, name) for name in ("step", "turn", "var", "dt", "walk", "bias")}

    @property
    def prior(self) -> Bias:
        """The belief about the bias before the first turn."""
        return Bias(*self.bias.tolist())

    def at(self, k: int) -> Turn | None:
        """The turn of step k; None without one."""
        row = int(np.searchsorted(self.step, k))
        if row == len(self) or self.step[row] != k:
            return None
        return Turn(float(self.turn[row]), float(self.var[row]), float(self.dt[row]), float(self.walk[row]))

    def by_step(self) -> Mapping[int, Turn]:
        """All turns by their step."""
        columns = (self.turn, self.var, self.dt, self.walk)
        rows = zip(self.step.tolist(), *(column.tolist() for column in columns), strict=True)
        return {step: Turn(*row) for step, *row in rows}

    def rows(self, kept: Any) -> "Gyro":
        """The table with the rows `kept` alone, ascending indices or a mask.

        The walk of those left out is added to the next one that is kept.
        """
        index = np.arange(len(self))[kept]
        walked = np.concatenate(([0.0], np.cumsum(self.walk)))[np.concatenate(([0], index + 1))]
        return Gyro.from_arrays(
            self.step[index], self.turn[index], self.var[index], self.dt[index],
            self.walk[index] if len(index) == len(self) else np.diff(walked), self.prior,
        )  # fmt: skip

    def head(self, steps: int) -> "Gyro":
        """The turns of the first steps."""
        return self.rows(slice(int(np.searchsorted(self.step, steps))))

    @property
    def knot(self) -> Ints:
        """(n,) the number of the bias of each row, which is another one where the bias has moved."""
        moved = (self.walk > 0).astype(np.int64)
        moved[:1] = 0
        return np.cumsum(moved, dtype=np.int64)


def conditioned(delta: Array, cov: Array, turn: Array, var: Array, dt: Array) -> Conditioned:
    """The motions `delta` (m, 3) with covariances `cov` (m, 3, 3) and the turns (m,) of the same steps, split."""
    total = cov[:, 2, 2] + var
    gain = cov[:, :, 2] / total[:, None]
    told = wrap(turn - delta[:, 2])
    moved = delta + gain * told[:, None]
    moved[:, 2] = wrap(moved[:, 2])
    rest = cov - gain[:, :, None] * cov[:, None, 2, :]
    return Conditioned(moved, (rest + rest.swapaxes(1, 2)) / 2, -gain * dt[:, None], told, total)


def fused(gyro: Gyro, delta: Array, cov: Array) -> tuple[Array, Array]:
    """Motions (n, 3) and covariances (n, 3, 3) of a log by wheels and gyro, for who has no bias in its state.

    The bias is estimated where the robot stands still, up to each step; before, the prior is all that is known of it.
    Its error is the same at many steps, which no covariance of independent motions says: a variance P of the bias adds
    P dt `CORRELATED` to that of a turn. The heading's variance is then right over this time, too large over less, and
    too small over more. With a bias that is known it is exact.
    """
    delta, cov, at = delta.copy(), cov.copy(), gyro.step
    wheels = np.column_stack((np.hypot(*delta[at, :2].T), np.abs(delta[at, 2])))
    stands = np.all(wheels <= STILL * gyro.dt[:, None], axis=1).tolist()
    bias, error = np.empty(len(gyro)), np.empty(len(gyro))
    mean, spread = gyro.prior.mean, gyro.prior.sd**2
    told = conditioned(delta[at], cov[at], gyro.turn, gyro.var, gyro.dt)
    for j, (dt, walk) in enumerate(zip(gyro.dt.tolist(), gyro.walk.tolist(), strict=True)):
        spread += walk
        if stands[j]:
            gain = spread * dt / (spread * dt**2 + told.told_var[j])
            mean += gain * (told.told[j] - mean * dt)
            spread *= 1 - gain * dt
        bias[j], error[j] = mean, spread
    turn = wrap(gyro.turn - bias * gyro.dt)
    var = gyro.var + error * gyro.dt * np.maximum(gyro.dt, CORRELATED)
    delta[at], cov[at] = conditioned(delta[at], cov[at], turn, var, gyro.dt)[:2]
    return delta, cov

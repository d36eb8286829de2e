"""A gyro's biases in a window: a bias is a landmark's row, named at every pose from its first turn on.

A motion by wheels and a turn are a motion that depends on the bias, and a row that tells of the bias alone: see
`core/gyro.py`. So a pose is still eliminated with one motion.
"""

from collections import deque
from math import sqrt

import numpy as np

from ...core.gyro import Bias, Turn
from ...core.kernels._turns import conditioned
from ...core.se2 import Array
from ..incremental.constants import HELD
from ..sighting_tables import Row
from ..smoothing._graph import PRIOR
from ._window import LEFT, PRESENCE
from .arrays import look_at_pair, row_of_new
from .tables import WindowTables

NONE = -1
"""No row."""


class WindowBiases:
    """Creates them at their first turn. One leaves with the last pose that names it."""

    def __init__(self, tables: WindowTables, prior: Bias) -> None:
        self._tables, self._prior = tables, prior
        self._row, self._old = NONE, deque[tuple[int, float]]()  # rows, and times of their last poses
        self.motion, self.slope, self.start = np.zeros((4, 3)), np.zeros(3), np.zeros(3)
        """That into the next pose with a bias of zero, its derivative by the bias, and it by the bias that is known."""
        self.turning = NONE
        """The row of the bias of that motion; NONE for one by wheels alone."""

    def take(self, turn: Turn | None, motion: Array, t: float) -> list[Row]:
        """The rows of the next pose, of time `t`, s; `motion` (4, 3) is that by odometry and its covariance."""
        self.motion[:], self.slope[:], self.turning = motion, 0.0, NONE
        self.start[:] = motion[0]
        if turn is None:
            return [] if self._row == NONE else [(self._row, PRIOR, (0.0, 0.0, 0.0, 0.0, 1.0))]
        (mean, sd), rows = self.last, list[Row]()
        if self._row == NONE or turn.walk > 0:
            before, tables = self._row, self._tables
            tables.window, self._row = row_of_new(tables.window, mean, 0.0)
            if before == NONE:
                rows.append((self._row, PRIOR, (mean, 0.0, 1 / max(sd**2 + turn.walk, HELD**2), 0.0, 0.0)))
            else:
                rows.append((self._row, before, (0.0, 0.0, 0.0, 0.0, 1 / turn.walk)))
                self._old.append((before, t))
        told, var = conditioned(self.motion, turn.turn, turn.var, turn.dt, self.slope)
        self.turning = self._row
        self.start[:] = self.motion[0] + self.slope * mean
        return [*rows, (self._row, PRIOR, (told / turn.dt, 0.0, turn.dt**2 / var, 0.0, 1.0))]

    def let_go(self, before: float) -> None:
        """Drops those whose last pose is older than that."""
        while self._old and self._old[0][1] < before:
            self._tables.window.marks[self._old.popleft()[0], PRESENCE] = LEFT

    @property
    def last(self) -> Bias:
        """The bias at the last step, rad/s."""
        if self._row == NONE:
            return self._prior
        at, cov = look_at_pair(self._tables.window, self._row)
        return Bias(float(at[0]), sqrt(cov[0, 0]))

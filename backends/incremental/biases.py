"""A gyro's biases as a smoother's variables: another one where the bias has moved, named at every pose since then."""

from math import sqrt

import numpy as np

from ...core.gyro import Bias, Turn
from ...core.kernels._turns import conditioned
from ...core.se2 import Array
from ..sighting_tables import Row
from ..smoothing._graph import NO_VARIABLE, PRIOR
from ..smoothing.forest import Forest
from ._turned import AWAY, add_bias, bias_of
from .constants import HELD


def together(motion: Array, turn: Turn, bias: float) -> Array:
    """(3,) the motion by wheels and gyro together; `motion` (4, 3) is that by wheels and its covariance."""
    both, slope = motion.copy(), np.empty(3)
    conditioned(both, turn.turn, turn.var, turn.dt, slope)
    return both[0] + slope * bias


class Biases:
    """Creates them at their first turn. The last one is in the forest's root."""

    def __init__(self, forest: Forest, prior: Bias) -> None:
        self._forest, self._prior = forest, prior
        self.variable = NO_VARIABLE
        """That of the last one; NO_VARIABLE before the first turn."""
        self.turn = np.zeros(3)
        """The turn of this step, its derivative by the bias, and its information; zeros without one."""
        self.start = np.zeros(3)
        """The motion by wheels and gyro together, by the bias as it is known."""

    def take(self, turn: Turn | None, motion: Array, newest: int) -> None:
        """Takes a step's turn, since the `newest` pose; `motion` (4, 3) is that by odometry and its covariance."""
        self.turn[:], self.start[:] = 0.0, motion[0]
        if turn is None:
            return
        mean, sd = self.last
        first = self.variable == NO_VARIABLE
        if first or turn.walk > 0:
            var = max(sd**2 + turn.walk, HELD**2) if first else turn.walk
            self._forest.room(0, 1, 1, 0, 0)
            self.variable = add_bias(self._forest.g, newest, self.variable, mean, 1 / var)
        self.turn[:] = turn.turn, turn.dt, 1 / turn.var
        self.start[:] = together(motion, turn, mean)

    @property
    def row(self) -> Row:
        """The row by which a pose names the last one."""
        return self.variable, PRIOR, (0.0, AWAY, 0.0, 0.0, 1.0)

    @property
    def last(self) -> Bias:
        """The bias at the last step, rad/s."""
        if self.variable == NO_VARIABLE:
            return self._prior
        mean, var = bias_of(self._forest.g.address, self.variable)
        return Bias(mean, sqrt(var))

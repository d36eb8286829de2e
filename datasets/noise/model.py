"""The noise of a sensor and of odometry as numbers that another log can be stated with."""

from collections.abc import Sequence
from typing import NamedTuple

from ...core.se2 import Array
from .systematic import Systematic


class SightingModel(NamedTuple):
    """The noise of ranges, or of bearings."""

    scale: float  # times the stated standard deviation, at the distance `reach`
    power: float  # the standard deviation grows with this power of the distance more than stated
    reach: float  # m
    bias: float  # standard deviation of one bias per landmark, m or rad; 0: none
    share: float  # of the variance that is correlated in time; 0: none
    time: float  # s in which the correlation falls to 1 / e
    together: float  # correlation between landmarks sighted at one step; 0: none

    def spread(self, stated: Array, reach: Array) -> Array:
        """Standard deviations (n,) of errors with `stated` ones at distances `reach`, m, biases aside."""
        return self.scale * stated * (reach / self.reach) ** self.power


class Model(NamedTuple):
    """The noise of a log; None: not known, and left as stated."""

    fitted_on: Sequence[str]  # the logs
    odometry: Sequence[float] | None  # (3,) factors on the standard deviations: forward, sideways, turn
    range: SightingModel | None
    bearing: SightingModel | None
    systematic: Systematic = Systematic()  # errors that stay, which are taken out

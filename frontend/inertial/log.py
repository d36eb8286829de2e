"""Turns by a gyro in the log that a front end has made: a factor of its own beside the log's odometry.

What carries what, so that no reading counts twice:

- the odometry is what it was without the gyro: of wheels, of commands, of scans and wheels, of frames; without any of
  these it is a motion that nothing measured, and the turns are then all that is known of the heading;
- the gyro's readings are in its turns, but for those of the robot's longest stand, which are in the bias' prior:
  meanwhile the robot does not turn, and a step within it has no turn, as the odometry says the same.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ...core.factors import Log
from ...core.gyro import Bias, Gyro
from ...core.se2 import wrap
from .imu import Imu
from .levels import Levels
from .standing import Stand, Standing, longest_stand
from .turns import BIAS_WALK, turns

UNKNOWN = Bias(0.0, 0.02)
"""rad/s; the bias of a small gyro whose robot never stood: 1.1 degrees/s."""

LEAST = 1e-12  # rad^2, the variance of a turn by a gyro whose readings show no noise

NOTE = "gyro"  # the number of turns, of steps without and why, and where the bias is from, among a log's notes
FIRST = "at_first"  # steps before the first that may have one


def with_turns(log: Log, imu: Imu, stood: Standing, first: int = 0, levels: Levels | None = None) -> Log:
    """The log with the turns between its steps from `first` on, and with their number among its notes.

    With `levels` they are about the vertical, else about the unit's z axis.
    """
    stand = longest_stand(imu, stood)
    found = turns(imu, log.t[first:], levels, noise=stood.noise, still=None if stand is None else stand.interval)
    counts = {"turns": len(found.step), "steps_without": len(log) - len(found.step), FIRST: first + 1, **found.without}
    if not len(found.step):
        return replace(log, notes={**log.notes, NOTE: counts})
    step = found.step + first
    bias = UNKNOWN if stand is None else _prior(stand, float(log.t[step[0] - 1]))
    gyro = Gyro.from_arrays(step, wrap(found.turn), np.maximum(found.var, LEAST), found.dt, found.walk, bias)
    told: dict[str, Any] = {
        **counts,
        "bias": "assumed" if stand is None else f"at rest for {stand.seconds:.3g} s",
        "bias_at_first": list(bias),
    }
    return replace(log, gyro=gyro, notes={**log.notes, NOTE: told})


def _prior(stand: Stand, first: float) -> Bias:
    """The belief at `first`, s, by a stand at another time, since or until which the bias has drifted."""
    return Bias(stand.bias, float(np.hypot(stand.sd, BIAS_WALK * np.sqrt(abs(stand.at - first)))))

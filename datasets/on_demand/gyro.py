"""A gyro in a simulated world, as options of the dataset: turns between steps, with a bias that drifts.

Its errors are drawn from a generator of its own: everything else of the log is the same, bit for bit.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...core.factors import CONSTANTS_NOTE, Dataset
from ...core.gyro import Bias, Gyro
from ...core.options import option
from ...core.se2 import wrap
from ...core.truth.errors import rows_of
from .fixes import due

GYRO_NOTE = "gyro"  # the key of the number of turns and of the true biases, among the log's notes

DEGREE = np.pi / 180


@dataclass(frozen=True)
class WorldGyro:
    """A gyro, by default none; a simulated world's options inherit it."""

    gyro: float = option(
        0.0,
        "white noise of a gyro's rate, degrees/s per root Hz, 0.01 being a good one; 0: none",
        minimum=0.0,
        maximum=1e3,
    )
    gyro_bias: float = option(
        0.0, "its bias at the start, and the sd that is stated, degrees/s", minimum=0.0, maximum=100.0, beside="gyro"
    )
    gyro_start: str = option(
        "drawn",
        "the bias at the start is drawn with gyro_bias as its sd, or is gyro_bias itself",
        choices=("drawn", "given"),
        beside="gyro",
    )
    gyro_walk: float = option(
        0.0, "random walk of the bias, degrees/s per root second", minimum=0.0, maximum=10.0, beside="gyro"
    )
    gyro_knots: float = option(10.0, "time after which it has moved, s", minimum=1e-3, maximum=1e6, beside="gyro")


def with_gyro(dataset: Dataset, options: WorldGyro, rng: np.random.Generator) -> Dataset:
    """Adds the turn since the step before to every step; one without a true pose, or after such a one, has none.

    The log's notes have the true biases, one for each stretch between two moves.
    """
    log, truth = dataset
    if truth is None or not options.gyro:
        return dataset
    starting, walking, turning = rng.spawn(3)
    row = rows_of(truth.t, log.t)
    step = 1 + np.flatnonzero((row[1:] >= 0) & (row[:-1] >= 0))
    n, dt = len(step), np.diff(log.t)[step - 1]
    moved = np.zeros(len(log), bool)
    moved[due(log.t, options.gyro_knots)] = True
    moved &= options.gyro_walk > 0
    passed = np.cumsum(moved)[step]
    knots = np.diff(passed, prepend=0)
    walk = knots * options.gyro_knots * (options.gyro_walk * DEGREE) ** 2
    start = 1.0 if options.gyro_start == "given" else starting.standard_normal()
    bias = options.gyro_bias * DEGREE * start + np.cumsum(np.sqrt(walk) * walking.standard_normal(n))
    var = (options.gyro * DEGREE) ** 2 * dt
    true = wrap(truth.poses[row[step], 2] - truth.poses[row[step - 1], 2])
    turn = wrap(true + bias * dt + np.sqrt(var) * turning.standard_normal(n))
    gyro = Gyro.from_arrays(step, turn, var, dt, walk, Bias(0.0, options.gyro_bias * DEGREE))
    each = bias[np.unique(gyro.knot, return_index=True)[1]]
    notes = {**log.notes, GYRO_NOTE: {"turns": n, "biases": each.tolist()}}
    notes[CONSTANTS_NOTE] = {**log.notes.get(CONSTANTS_NOTE, {}), "gyro_bias": float(each[-1])}
    return Dataset(replace(log, gyro=gyro, notes=notes), truth)

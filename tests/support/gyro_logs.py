"""Logs with a gyro, for tests of reading, writing, checking and estimating."""

from dataclasses import replace

import numpy as np

from slamduel.core.factors import Dataset, Log
from slamduel.core.gyro import Bias, Gyro
from slamduel.core.se2 import between, wrap
from small_log import small_log


def small_gyro_log() -> Log:
    """`small_log` with a gyro that pauses once, and whose bias moves once."""
    log, rng = small_log(), np.random.default_rng(3)
    step = np.array([1, 2, 4, 5])
    turn, var = rng.uniform(-3, 3, 4), rng.uniform(1e-6, 1e-4, 4)
    gyro = Gyro.from_arrays(
        step, turn, var, np.array([0.5, 0.25, 0.5, 1.0]), np.array([0, 0, 1e-6, 0]), Bias(0.01, 0.1)
    )
    return replace(log, gyro=gyro)


def with_gyro(
    dataset: Dataset,
    rng: np.random.Generator,
    sd: float = 1e-3,
    bias: float = 0.02,
    every: int = 20,
    walk: float = 1e-3,
) -> tuple[Dataset, np.ndarray]:
    """A drive with a turn at each step, whose bias, drawn from a prior of sd `bias`, moves by `walk` every few steps.

    Returns the bias (n - 1,) at each of them, too; all noise is as stated.
    """
    log, truth = dataset
    assert truth is not None
    n = len(log) - 1
    walked = np.where(np.arange(n) % every == every - 1, walk**2, 0.0)
    biases = bias * rng.standard_normal() + np.cumsum(np.sqrt(walked) * rng.standard_normal(n))
    dt = np.diff(log.t)
    turn = between(truth.poses[:-1], truth.poses[1:])[:, 2] + biases * dt + sd * rng.standard_normal(n)
    gyro = Gyro.from_arrays(np.arange(1, n + 1), wrap(turn), np.full(n, sd**2), dt, walked, Bias(0.0, bias))
    return dataset._replace(log=replace(log, gyro=gyro)), biases

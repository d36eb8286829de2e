"""Estimators on a real log with truth, all five robots with one noise setting."""

import os
from pathlib import Path

import numpy as np
import pytest

from slamduel.backends.registry import find
from slamduel.bench.measure.metrics import align, aligned, ate
from slamduel.datasets import registry as datasets
from slamduel.frontend.factors import Dataset
from slamduel.frontend.se2 import Array

FOLDER = os.environ.get("SLAMDUEL_DATA")
ROBOTS = (1, 2, 3, 4, 5)

MEASURED = {1: 0.417, 2: 0.362, 4: 0.351}
"""Robot -> aligned position RMSE, m, of an independent textbook EKF, online, with the settings of `TEXTBOOK`."""

TEXTBOOK = {"range_sd": 0.15, "bearing_sd": 0.03, "forward": 0.05, "lateral": 0.01, "turn": 0.1}

pytestmark = pytest.mark.skipif(FOLDER is None, reason="SLAMDUEL_DATA is not set: no real recordings here")


def read(robot: int, **settings: float) -> Dataset:
    source = datasets.find("mrclam")
    options = source.options(path=str(Path(FOLDER or "") / "mrclam"), robot=robot, **settings)
    return source.make(options, np.random.default_rng(0))


def error(dataset: Dataset, path: Array) -> float:
    """The position RMSE of `path`, a pose a step, aligned."""
    log, truth = dataset
    assert truth is not None
    mine = path[np.searchsorted(log.t, truth.t)]
    return ate(aligned(align(mine, truth.poses), mine), truth.poses)


def final(dataset: Dataset, backend: str, **options: str) -> float:
    """The error of the path that `backend` has once the log is over."""
    builder = find(backend)
    running = builder.make(dataset.log.prior, builder.options(**options), np.random.default_rng(0))
    for step in dataset.log:
        running.step(step)
    solution = running.finish()
    assert solution is not None
    return error(dataset, solution.path)


@pytest.mark.parametrize("robot", MEASURED)
def test_the_ekf_is_as_accurate_as_a_textbook_one(robot: int):
    dataset = read(robot, **TEXTBOOK)
    ekf = find("ekf").make(dataset.log.prior, find("ekf").options(), np.random.default_rng(0))
    assert error(dataset, np.array([ekf.step(step) for step in dataset.log])) <= 1.1 * MEASURED[robot]


@pytest.mark.slow
def test_the_recommended_variant_is_accurate_on_all_five_robots():
    """README: isam2[loss=cauchy]. In the logs of robots 3 and 5 a few barcodes were taken for others.

    Measured: 0.105, 0.113, 0.137, 0.129 and 0.124 m; without the loss, robot 3 ends two metres off.
    """
    errors = [final(read(robot), "isam2", loss="cauchy") for robot in ROBOTS]
    assert max(errors) <= 0.15, errors
    assert np.median(errors) <= 0.13, errors

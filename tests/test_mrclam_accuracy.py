"""Estimators on a real log with truth: no worse than an independent EKF and batch on the same noise settings."""

import os
from pathlib import Path

import numpy as np
import pytest

from slamduel.backends.registry import find
from slamduel.bench.metrics import align, aligned, ate
from slamduel.datasets import registry as datasets

FOLDER = os.environ.get("SLAMDUEL_DATA")

MEASURED = {1: (0.417, 0.235), 2: (0.362, 0.202), 4: (0.351, 0.217)}
"""Robot -> aligned position RMSE, m, of a textbook EKF online and of batch least squares on set 6."""


@pytest.mark.skipif(FOLDER is None, reason="SLAMDUEL_DATA is not set: no real recordings here")
@pytest.mark.parametrize("robot", MEASURED)
def test_mrclam_set_6(robot: int) -> None:
    source = datasets.find("mrclam")
    options = source.options(path=str(Path(FOLDER or "") / "mrclam" / "MRCLAM_Dataset6"), robot=robot)
    log, truth = source.make(options, np.random.default_rng(0))
    assert truth is not None
    at = np.searchsorted(log.t, truth.t)

    def error(path: np.ndarray) -> float:
        return ate(aligned(align(path[at], truth.poses), path[at]), truth.poses)

    ekf = find("ekf").make(log.prior, find("ekf").options(), np.random.default_rng(0))
    online = np.array([ekf.step(step) for step in log])
    isam2 = find("isam2").make(log.prior, find("isam2").options(), np.random.default_rng(0))
    for step in log:
        isam2.step(step)
    final = isam2.finish()
    assert final is not None
    by_ekf, by_batch = MEASURED[robot]
    assert error(online) <= 1.1 * by_ekf
    assert error(final.path) <= 1.1 * by_batch

"""The first position in the world against the start of its log."""

import re
from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.remark import remarks
from slamduel.bench.contradiction.start import far_start
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Prior
from slamduel.core.fixes import FixTable
from slamduel.datasets.fixes.degrees import ORIGIN
from slamduel.datasets.fixes.geodetic import degrees, metres


def made(first: tuple[float, float], start: tuple[float, float], start_sd: float = 1e-3, step: int = 0) -> Log:
    """A log with two positions known to 1 m, the first at a step."""
    log = load("circle[steps=20]", seed=0).log
    z = np.array([[*first, np.nan], [0.0, 1.0, np.nan]])
    cov = np.full((2, 3, 3), np.nan)
    cov[:, :2, :2] = np.eye(2)
    prior = Prior(np.array([*start, 0.0]), np.diag([start_sd**2, start_sd**2, 1e-6]))
    return replace(log, prior=prior, fixes=FixTable.from_arrays(len(log), np.array([step, 19]), z, cov))


def test_an_origin_that_is_not_the_starts_is_said_with_its_distance() -> None:
    log = made((0.0, 0.0), (3.0, 2.0))
    (said,) = far_start(log)
    assert said.startswith(
        "the first position is 3.61 m from the start, 3.61 standard deviations of both: it is the origin"
    )
    assert said in remarks(Dataset(log, None))


@pytest.mark.parametrize(
    "log",
    [
        made((0.0, 0.0), (0.0, 0.0)),
        made((0.0, 0.0), (2.9, 0.0)),
        made((0.0, 0.0), (3.0, 2.0), start_sd=5.0),
        made((4.9, 0.0), (0.0, 0.0)),  # no origin: noise has more than five once in 270,000 logs
    ],
)
def test_noise_and_an_unknown_start_are_none(log: Log) -> None:
    assert list(far_start(log)) == []
    assert not [one for one in remarks(Dataset(log, None)) if "first position" in one]


def test_another_frame_is_said_and_where_the_odometry_leads() -> None:
    assert list(far_start(made((6.0, 0.0), (0.0, 0.0)))) == [
        "the first position is 6.00 m from the start, 6.00 standard deviations of both"
    ]
    (said,) = far_start(made((60.0, 0.0), (0.0, 0.0), step=1))
    assert "from where the odometry leads from the start until" in said


@pytest.mark.parametrize("seed", range(8))
def test_the_origin_in_degrees_that_takes_it_out_is_said(seed: int) -> None:
    """It is that from which the positions were taken: by the true path to the noise of all, over their root."""
    log, truth = load("circle[steps=400,gps=1,gps_sd=0.5]", seed)
    assert log.fixes is not None
    right, first = np.array([48.1, 11.5]), log.fixes.z[0, :2]
    z = log.fixes.z - [*first, 0.0]
    notes = {**log.notes, ORIGIN: degrees(first, right).tolist()}
    moved = replace(log, fixes=replace(log.fixes, z=z), notes=notes)
    start = moved.prior._replace(pose=moved.prior.pose + np.array([9.0, 0.0, 0.0]))
    (said,) = far_start(replace(moved, prior=start), truth)
    found = re.search(r"by the true path origin_lat=(\S+) and origin_lon=(\S+) of csv", said)
    assert found is not None
    apart = metres(np.array([[float(found[1]), float(found[2])]]), right)
    assert np.hypot(*apart[0]) < 6 * 0.5 * 1.2533 / np.sqrt(len(z) / 2)
    assert "by the start origin_lat=" in next(iter(far_start(replace(moved, prior=start))))

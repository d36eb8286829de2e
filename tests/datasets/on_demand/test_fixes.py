"""Positions and headings on demand: around the truth, as stated, and the rest of the log as it was."""

import numpy as np
import pytest

from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.fixes import FixTable
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.on_demand.fixes import FIXES_NOTE


def made(options: str = "", seed: int = 1, world: str = "circle[steps=1000") -> Dataset:
    dataset = load(f"{world}{options}]", seed)
    assert list(problems(dataset.log)) == []
    return dataset


def fixes(dataset: Dataset) -> FixTable:
    assert dataset.log.fixes is not None
    return dataset.log.fixes


def true(dataset: Dataset) -> Array:
    """(f, 3) the true pose of every fix."""
    assert dataset.truth is not None
    return dataset.truth.poses[fixes(dataset).step]


def test_positions_come_after_each_period_around_the_truth() -> None:
    dataset = made(",gps=10,gps_sd=0.5")
    table = fixes(dataset)
    assert table.step.tolist() == list(range(10, 1000, 10))
    assert np.isnan(table.z[:, 2]).all()
    off = (table.z - true(dataset))[:, :2] / 0.5
    assert abs((off**2).mean() - 1) < 4 * np.sqrt(2 / off.size)
    np.testing.assert_array_equal(table.cov[:, :2, :2], np.tile(0.25 * np.eye(2), (99, 1, 1)))
    assert dataset.log.notes[FIXES_NOTE] == {"positions": 99, "headings": 0}


def test_they_are_of_the_antenna() -> None:
    at_origin, ahead = made(",gps=10"), made(",gps=10,gps_x=0.8,gps_y=-0.3")
    shift, heading = fixes(ahead).z - fixes(at_origin).z, true(ahead)[:, 2]
    c, s = np.cos(heading), np.sin(heading)
    np.testing.assert_allclose(shift[:, 0], 0.8 * c + 0.3 * s, atol=1e-9)
    np.testing.assert_allclose(shift[:, 1], 0.8 * s - 0.3 * c, atol=1e-9)
    assert (fixes(ahead).arm == [0.8, -0.3]).all()


def test_headings_have_a_constant_error_as_stated() -> None:
    offs = list[float]()
    for seed in range(6):
        dataset = made(",compass=2,compass_sd=0.01,compass_offset=0.2", seed)
        table = fixes(dataset)
        assert len(table) == 499
        assert np.isnan(table.z[:, :2]).all()
        off = wrap(table.z[:, 2] - true(dataset)[:, 2])
        assert off.std() == pytest.approx(0.01, rel=0.2)
        assert dataset.log.prior.systematic.heading_offset == 0.2
        offs.append(float(off.mean()))
    assert 0.05 < np.std(offs) < 0.5
    assert fixes(made(",compass=2")).cov[0, 2, 2] == pytest.approx(0.05**2)


def test_the_rest_of_the_log_and_the_other_sensor_stay() -> None:
    before, both = made().log, made(",gps=60,compass=7.5,ranges_only=0.5")
    gps = made(",gps=60")
    for name in ("t", "delta", "delta_cov"):
        np.testing.assert_array_equal(getattr(both.log, name), getattr(before, name))
    np.testing.assert_array_equal(gps.log.z, before.z)
    table = fixes(both)
    positions = ~np.isnan(table.z[:, 0])
    np.testing.assert_array_equal(table.z[positions], fixes(gps).z)
    assert table.step[~positions].tolist() == [int(np.ceil(7.5 * k)) for k in range(1, 134)]
    assert gps.log.digest != before.digest


@pytest.mark.parametrize("world", ["linear[steps=50", "aruco-room[seconds=2", "matlab-report[tags=6"])
def test_other_worlds_have_them(world: str) -> None:
    dataset = made(",gps=1,compass=1", 0, world)
    off = fixes(dataset).z - true(dataset)
    off[:, 2] = wrap(off[:, 2])
    off = off[~np.isnan(off)]
    assert len(off) > 2
    assert np.abs(off).max() < 5

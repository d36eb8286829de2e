"""Remarks on logs whose measurements are not as accurate as stated."""

import re
from dataclasses import replace

import numpy as np
import pytest

import slamduel
from slamduel.bench.measure.stated_noise import misstated
from slamduel.core.factors import Log, Truth

OFF = {"nees": 100.0}
"""A belief that is far off."""


def circle(options: str = "") -> tuple[Log, Truth]:
    log, truth = slamduel.load(f"circle[steps=200{options}]")
    assert truth is not None
    return log, truth


@pytest.mark.parametrize("row", [{}, {"nees": None}, {"nees": 1.2}, {"nees": 1.4, "final_nees": 0.4}])
def test_a_belief_that_holds_is_not_looked_into(row: dict[str, float | None]) -> None:
    log, truth = circle(",sensor_scale=5")
    assert list(misstated(log, truth, row)) == []


@pytest.mark.parametrize("row", [OFF, {"nees": 1.0, "final_nees": 0.1}])
def test_noise_as_stated_is_no_reason_for_a_belief_that_is_off(row: dict[str, float | None]) -> None:
    log, truth = circle()
    assert list(misstated(log, truth, row)) == []


@pytest.mark.parametrize("scale", [4.0, 0.25])
def test_errors_of_another_size_than_stated_are_told(scale: float) -> None:
    for option, noun in (("sensor_scale", "sightings"), ("odometry_scale", "motions")):
        log, truth = circle(f",{option}={scale}")
        (remark,) = misstated(log, truth, OFF)
        found = re.fullmatch(f"the errors of the {noun} are typically (.*) times what is stated", remark)
        assert float(found[1]) == pytest.approx(scale, rel=0.15)


@pytest.mark.parametrize("scale", [20.0, 0.02])
def test_errors_tenfold_off_are_told_whatever_the_belief(scale: float) -> None:
    for option, noun in (("sensor_scale", "sightings"), ("odometry_scale", "motions")):
        log, truth = circle(f",{option}={scale}")
        for some in (truth, truth._replace(map=None)):
            (remark,) = misstated(log, some, {"nees": 1.0})
            assert remark.startswith(f"the errors of the {noun} are typically ")


def test_a_prior_that_is_not_where_the_robot_is_explains_a_belief_that_is_off() -> None:
    log, truth = circle()
    pose = log.prior.pose + np.array([3.0, 4.0, 0.5])
    moved = replace(log, prior=log.prior._replace(pose=pose, cov=1e-4 * np.eye(3)))
    (remark,) = misstated(moved, truth, OFF)
    assert remark.startswith("the log's prior is 5 m and 0.5 rad off the true pose, ")
    assert list(misstated(moved, truth, {"nees": 1.0})) == []


@pytest.mark.parametrize("with_map", [True, False])
def test_gross_errors_are_counted(with_map: bool) -> None:
    log, truth = circle()
    z = log.z.copy()
    z[[3, 50], 1] += 1.0
    right = truth if with_map else truth._replace(map=None)
    (remark,) = misstated(replace(log, z=z), right, OFF)
    assert remark.startswith(f"2 of {len(log.ids)} sightings are off by more than 7 stated standard deviations, by ")


def test_a_wrong_id_is_an_error_of_its_sighting() -> None:
    log, truth = circle(",wrong_ids=0.1")
    (remark,) = misstated(log, truth, OFF)
    assert 1 <= int(remark.split()[0]) <= np.sum(truth.assigned != log.ids)

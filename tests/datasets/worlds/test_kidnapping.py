"""Kidnapping: the robot goes on somewhere else on its way, and only its sightings tell."""

from typing import Any

import numpy as np
import pytest

import slamduel
from drawn_errors import errors, known
from refusals import refused
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, between
from slamduel.core.truth.check import check_truth
from slamduel.datasets.cache import generator
from slamduel.datasets.remarks import remarks
from slamduel.datasets.worlds.circle import Options, circle


def made(**options: Any) -> Dataset:
    given: dict[str, Any] = {"steps": 400, **options}
    dataset = circle(Options(**given), generator("circle", 0))
    assert not list(problems(dataset.log))
    assert dataset.truth is not None
    check_truth(dataset.log, dataset.truth, "circle")
    return dataset


def strides(dataset: Dataset) -> Array:
    return np.hypot(*np.diff(known(dataset)[0].poses[:, :2], axis=0).T)


def test_the_true_path_jumps_and_the_odometry_does_not() -> None:
    made_off = made(kidnap=150.0)
    step = made_off.log.notes["faults"]["kidnapped at step"]
    assert step == 150
    assert np.flatnonzero(strides(made_off) > 1).tolist() == [step - 1]
    assert strides(made_off)[step - 1] > 5
    assert np.hypot(*made_off.log.delta[step, :2]) < 0.5


def test_everything_else_is_the_log_without() -> None:
    plain, made_off = made(), made(kidnap=150.0)
    log, left = made_off.log, len(made_off.log)
    assert 260 < left < 400
    np.testing.assert_array_equal(log.t, plain.log.t[:left])
    np.testing.assert_array_equal(log.delta[1:150], plain.log.delta[1:150])
    np.testing.assert_array_equal(log.delta[150:], plain.log.delta[150 - left :])
    np.testing.assert_array_equal(known(made_off)[0].poses[150:], known(plain)[0].poses[150 - left :])
    after = slice(made_off.log.sighting_first[150], None)
    np.testing.assert_array_equal(log.z[after], plain.log.z[plain.log.sighting_first[400 + 150 - left] :])
    # Sightings are from where it is, and motions from where it was put.
    assert (errors(made_off).sightings_squared < 25).all()
    right = between(known(plain)[0].poses[-left + 149 : -1], known(plain)[0].poses[-left + 150 :])
    assert np.abs(log.delta[150:] - right).max() < 0.2


def test_it_goes_with_other_faults_and_hidden_ids() -> None:
    options = "steps=400,kidnap=100,moving=0.3,clutter=0.5,wrong_ids=0.1,missing=0.1,gap=0.05,slip=0.1"
    plain, without = slamduel.load(f"circle[{options}]"), slamduel.load(f"circle[{options},ids=hidden]")
    for dataset in (plain, without):
        truth, _ = known(dataset)
        check_truth(dataset.log, truth, "circle")
        assert len(truth.t) == len(dataset.log)
        assert truth.assigned is not None
    assert set(without.log.ids.tolist()) == {UNKNOWN}
    assert plain.log.notes["faults"]["kidnapped at step"] == 100


@pytest.mark.parametrize("time", [399.0, 1e6, float("inf")])
def test_a_time_that_the_log_does_not_have_is_refused(time: float) -> None:
    refused(r"dataset circle: option kidnap=.*: expected a time within the log, of 399 s", made, kidnap=time)


def test_the_last_moment_and_the_first() -> None:
    assert len(made(kidnap=398.0).log) == 399
    assert made(kidnap=1e-3).log.notes["faults"]["kidnapped at step"] == 1


@pytest.mark.parametrize("world", ["aruco-robot", "bailey", "city[steps=300,landmarks=200", "linear", "matlab-report"])
def test_it_happens_in_every_simulated_world(world: str) -> None:
    log, truth = slamduel.load(f"{world}{',' if '[' in world else '['}kidnap=20]")
    assert len(truth.t) == len(log)
    jump = log.notes["faults"]["kidnapped at step"]
    assert log.t[jump] == pytest.approx(20, abs=1.0)
    assert strides(Dataset(log, truth)).argmax() == jump - 1


def test_a_kidnapping_is_remarked_on() -> None:
    log, truth = slamduel.load("circle[steps=60,kidnap=20]")
    step = log.notes["faults"]["kidnapped at step"]
    assert f"the robot is put elsewhere before step {step} (kidnap)" in remarks(Dataset(log, truth))[0]
    assert not any("kidnap" in said for said in remarks(Dataset(*slamduel.load("circle[steps=60]"))))

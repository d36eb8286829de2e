"""Headings in the world that are a constant off are named with the constant; others have no remark."""

import re
from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.compass import turned_compass
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log
from slamduel.core.se2 import wrap

SEEDS = range(8)
WORLDS = ("circle[steps=600,gps=1,compass=1", "bailey[gps=2,compass=1", "aruco-robot[gps=1,compass=1")
TOO_FAR = re.compile(r"headings in the world are (\S+) ± (\S+) degrees too far (left|right) by (.*), as by a decl.*rad")


def turned(log: Log, degrees: float) -> Log:
    """With headings that are so much too far left."""
    assert log.fixes is not None
    return replace(log, fixes=replace(log.fixes, z=np.column_stack((log.fixes.z[:, :2], wrapped(log, degrees)))))


def wrapped(log: Log, degrees: float) -> np.ndarray:
    assert log.fixes is not None
    return wrap(log.fixes.z[:, 2] + np.deg2rad(degrees))


def without(log: Log, column: int) -> Log:
    """Without positions (0) or headings (2)."""
    assert log.fixes is not None
    return replace(log, fixes=log.fixes.rows(np.isnan(log.fixes.z[:, column])))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("world", WORLDS)
def test_a_compass_as_stated_has_no_remark_and_one_that_is_turned_has_its_angle(world: str, seed: int):
    log, truth = load(f"{world}]", seed)
    assert truth is not None
    assert list(turned_compass(log, truth)) == list(turned_compass(log)) == list(turned_compass(without(log, 0))) == []
    for degrees in (10.0, -10.0):
        (said,) = turned_compass(turned(log, degrees), truth)
        size, interval, side, by = told(said)
        assert side == ("left" if degrees > 0 else "right")
        assert by == "the true path"
        assert abs(size - 10) < 2 * interval < 3
        assert ("larger" in said) == (degrees > 0)


def told(said: str) -> tuple[float, float, str, str]:
    found = TOO_FAR.match(said)
    assert found is not None, said
    return float(found[1]), float(found[2]), found[3], found[4]


@pytest.mark.parametrize("seed", SEEDS)
def test_positions_or_the_start_tell_it_without_truth(seed: int):
    log = load("circle[steps=600,gps=1,gps_sd=0.3,compass=1]", seed).log
    (said,) = turned_compass(turned(log, 20.0))
    size, interval, side, by = told(said)
    assert (side, by) == ("left", "the way through the positions")
    assert abs(size - 20) < 2 * interval
    (said,) = turned_compass(turned(without(log, 0), -40.0))
    size, interval, side, by = told(said)
    assert (side, by) == ("right", "the start and the odometry from there")
    assert abs(size - 40) < 2 * interval


@pytest.mark.parametrize("seed", SEEDS)
def test_a_constant_that_the_prior_states_is_none(seed: int):
    log, truth = load("circle[steps=300,compass=1,compass_offset=0.2]", seed)
    assert list(turned_compass(log, truth)) == []


def test_the_remark_is_that_of_the_log_and_its_errors_are_no_noise():
    log, truth = load("circle[steps=600,compass=1]")
    found = remarked(Dataset(turned(log, 10.0), truth))
    assert found.mistaken
    assert [one for one in found.contradictions if "too far left by the true path" in one] == found.contradictions


def test_headings_of_every_direction_are_no_constant():
    log, truth = load("circle[steps=600,compass=1]")
    assert log.fixes is not None
    random = np.random.default_rng(0).uniform(-3, 3, len(log.fixes.z))
    z = np.column_stack((log.fixes.z[:, :2], random))
    assert list(turned_compass(replace(log, fixes=replace(log.fixes, z=z)), truth)) == []

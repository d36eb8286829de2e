"""Finding a pose on a given map from sightings and nothing else."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import slamduel
from lost_logs import RING, astray, surveyed, unnamed, window
from slamduel.backends.locating.locate import LEAST, MARGIN, SIGHTINGS, locate
from slamduel.backends.locating.map_index import indexed
from slamduel.bench.measure.nees import nees
from slamduel.core.factors import UNKNOWN, Log, Map, Truth
from slamduel.core.se2 import act, compose

STARTS = range(0, 360, 30)


@cache
def ring(seed: int = 0) -> tuple[Log, Truth, Map]:
    log, truth = slamduel.load(RING, seed=seed)
    assert truth is not None
    assert truth.map is not None
    return log, truth, surveyed(truth.map)


@pytest.mark.parametrize("named", [True, False])
def test_a_robot_is_found_with_and_without_ids(named: bool) -> None:
    log, truth, known = ring()
    on = indexed(known)
    for first in STARTS:
        fix = locate(window(log if named else unnamed(log), first, 8), on)
        assert not astray(fix.pose, truth.poses[first + 7], known)


def test_its_covariance_is_that_of_its_error() -> None:
    log, truth, known = ring()
    on = indexed(known)
    lasts = range(7, 397, 10)
    fixes = [(locate(window(unnamed(log), last - 7, 8), on), last) for last in lasts]
    found = [(fix.pose, fix.cov, truth.poses[last]) for fix, last in fixes if fix is not None]
    assert len(found) >= len(lasts) - 2
    pose, cov, true = (np.array([one[k] for one in found]) for k in range(3))
    values = nees(pose, cov, true)
    # The mean of 39 chi-squares of 3 degrees of freedom is 3 with a standard deviation of 0.4, or less if windows were
    # independent; the map's errors are common to all of them, and a share of the variance.
    assert 3 - 4 * 0.4 < values.mean() < 3 + 4 * 0.4


def test_each_sighting_is_told_its_landmark() -> None:
    log, _, known = ring()
    steps = window(log, 60, 6)
    fix = locate(window(unnamed(log), 60, 6), known)
    true = np.concatenate([step.sightings.ids for step in steps])
    told = fix.ids != UNKNOWN
    assert told.sum() >= LEAST
    assert MARGIN <= fix.margin <= fix.gain
    assert np.array_equal(fix.ids[told], true[told])


def test_a_map_and_its_index_are_the_same() -> None:
    log, _, known = ring()
    steps = window(unnamed(log), 30, 4)
    one, other = locate(steps, known), locate(steps, indexed(known))
    assert one.pose.tobytes() == other.pose.tobytes()
    assert one.gain == other.gain


def test_the_pose_goes_where_the_map_goes() -> None:
    log, _, known = ring()
    motion = np.array((120.0, -40.0, 2.0))
    turned = Map(known.ids, act(motion, known.xy), known.cov)
    steps = window(unnamed(log), 90, 6)
    here, there = locate(steps, known), locate(steps, turned)
    assert there.pose == pytest.approx(compose(motion, here.pose), abs=1e-9)


def test_on_the_map_of_another_world_it_is_silent() -> None:
    for seed in range(4):
        log, _, _ = ring(seed)
        _, _, other = ring(seed + 50)
        for first in STARTS[::3]:
            for steps in (1, 4, 16):
                assert locate(window(unnamed(log), first, steps), indexed(other)) is None


def test_where_two_places_look_alike_it_is_silent() -> None:
    log, _, known = ring()
    n = len(known.ids)
    far = known.xy + np.array((1000.0, 0.0))
    twice = Map(np.arange(2 * n), np.concatenate((known.xy, far)), np.eye(4 * n) * 1e-4)
    assert locate(window(unnamed(log), 0, 16), twice) is None


def test_ids_tell_places_apart_that_look_alike() -> None:
    log, truth, known = ring()
    n = len(known.ids)
    ids = np.concatenate((known.ids, known.ids.max() + 1 + known.ids))
    twice = Map(ids, np.concatenate((known.xy, known.xy + np.array((1000.0, 0.0)))), np.eye(4 * n) * 1e-4)
    fix = locate(window(log, 0, 8), twice)
    assert not astray(fix.pose, truth.poses[7], known)


def test_clutter_and_new_landmarks_are_left_out() -> None:
    log, truth, known = ring()
    kept = np.random.default_rng(1).random(len(known.ids)) < 0.8
    rows = np.repeat(kept, 2)
    part = Map(known.ids[kept], known.xy[kept], known.cov[np.ix_(rows, rows)])
    found = [locate(window(unnamed(log), first, 24), part) for first in STARTS]
    fixes = [(fix, first) for fix, first in zip(found, STARTS, strict=True) if fix is not None]
    assert len(fixes) >= len(STARTS) // 2
    for fix, first in fixes:
        assert not astray(fix.pose, truth.poses[first + 23], known)
        true = np.concatenate([step.sightings.ids for step in window(log, first, 24)])
        told = fix.ids != UNKNOWN
        assert (fix.ids[told] == true[told]).mean() > 0.9  # one left out may be near one that is not


def test_fewer_landmarks_than_asked_for_are_not_enough() -> None:
    log, _, known = ring()
    steps = window(unnamed(log), 0, 1)
    assert locate(steps, known, least=len(steps[0].sightings.ids) + 1) is None
    assert locate(steps, known, margin=1e6) is None
    for few in range(4):
        assert locate(window(unnamed(log), 0, 8), Map(known.ids[:few], known.xy[:few], None)) is None


def test_of_a_long_window_only_the_last_sightings_are_used() -> None:
    log, truth, known = ring()
    many = np.cumsum([len(step.sightings.ids) for step in log])
    steps = int(np.searchsorted(many, SIGHTINGS)) + 20
    fix = locate(window(unnamed(log), 0, steps), known)
    assert not astray(fix.pose, truth.poses[steps - 1], known)
    assert len(fix.ids) == many[steps - 1]
    assert (fix.ids[:-SIGHTINGS] == UNKNOWN).all()
    last = fix.ids[many[steps - 2] :]
    assert (last != UNKNOWN).any()
    assert np.isin(last, [UNKNOWN, *log[steps - 1].sightings.ids]).all()


def test_the_pose_is_that_of_the_last_step_however_long_ago_the_first_was() -> None:
    log, truth, known = ring()
    rough = replace(log, delta_cov=100 * log.delta_cov)
    fix = locate(window(unnamed(rough), 0, 30), known)
    one = locate(window(unnamed(rough), 29, 1), known)
    assert not astray(fix.pose, truth.poses[29], known)
    assert np.trace(fix.cov) <= 1.5 * np.trace(one.cov)

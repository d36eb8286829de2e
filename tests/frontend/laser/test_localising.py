"""Localisation on an occupancy grid: where the robot is on the map of an earlier drive, its start known or not."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from driven import final
from refusals import refused
from slamduel.core.errors import InputError
from slamduel.core.factors import Log, Truth
from slamduel.core.se2 import Array, between, compose, wrap
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.laser.log import EXACT, build_log, first_scan, scans_of
from slamduel.frontend.laser.recording import LaserRecording, matched
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.maps.occupancy import FREE, WALL, Occupancy, occupancy, of_states
from tiers import first_quick

LAPS = 1.1


@cache
def mapped(seed: int) -> Occupancy:
    """The grid of a drive on that floor, by the front end's own path."""
    recording, _ = record(Options(laps=LAPS, people=0), np.random.default_rng(seed))
    front_end = matched(recording, Settings())
    estimate = np.array(front_end.estimate)
    path = compose(recording.prior.pose, between(estimate[0], estimate))
    return occupancy(scans_of(recording, front_end), path)


@cache
def again(seed: int, people: int = 0, laps: float = 0.8) -> tuple[LaserRecording, Truth]:
    """Another drive on the floor."""
    return record(Options(drive=1, laps=laps, people=people), np.random.default_rng(seed))


class Placed(NamedTuple):
    """A log on a map, and the errors of its steps by the batch optimum."""

    log: Log
    metres: Array
    radians: Array


def localised(recording: LaserRecording, truth: Truth, grid: Occupancy, start: str = "known") -> Placed:
    log = build_log(replace(recording, map=grid, start=start), Settings())  # pyright: ignore[reportArgumentType]
    found = final("graph", log)
    assert first_scan(log) == 1
    right = truth.poses[np.searchsorted(truth.t, log.t[1:])]
    off = found.path[1:] - right
    return Placed(log, np.hypot(off[:, 0], off[:, 1]), np.abs(wrap(off[:, 2])))


@cache
def known_start() -> Placed:
    return localised(*again(0), mapped(0))


def later(recording: LaserRecording, first: int, count: int) -> LaserRecording:
    """Some of the scans; where the robot then is, is not known."""
    rows = slice(first, first + count)
    return replace(recording, t=recording.t[rows], ranges=recording.ranges[rows], odometry=recording.odometry[rows])


def test_a_known_start_is_followed_to_centimetres() -> None:
    found = known_start()
    assert np.median(found.metres) < 0.02
    assert found.metres.max() < 0.1
    assert found.radians.max() < 0.02
    assert len(found.log.loop_to) > 0.95 * (len(found.log) - 1)


def test_the_log_begins_with_the_frame_of_the_map() -> None:
    recording, truth = again(0)
    log = known_start().log
    assert (log.loop_to == 0).all()
    assert np.array_equal(log.prior.pose, recording.prior.pose)
    assert np.array_equal(log.prior.cov, EXACT**2 * np.eye(3))
    assert np.array_equal(log.delta[1], np.zeros(3))
    turn = np.array([[np.cos(h := log.prior.pose[2]), -np.sin(h), 0], [np.sin(h), np.cos(h), 0], [0, 0, 1]])
    np.testing.assert_allclose(turn @ log.delta_cov[1] @ turn.T, recording.prior.cov, atol=1e-15)
    assert log.t[0] < log.t[1] == recording.t[0]
    on_map = compose(log.prior.pose, log.loop_delta)
    off = on_map - truth.poses[np.searchsorted(truth.t, log.t[log.loop_step])]
    assert np.median(np.hypot(off[:, 0], off[:, 1])) < 0.025


def test_people_are_no_part_of_a_match_and_are_counted() -> None:
    without, among = known_start(), localised(*again(0, people=12), mapped(0))
    assert np.median(among.metres) < 0.04
    share = [found.log.notes["laser"]["points_not_of_the_map"] for found in (without, among)]
    assert share[1] > share[0] + 0.005


@pytest.mark.parametrize("seed", first_quick([0, 1]))
def test_an_unknown_start_is_found_and_no_wrong_one(seed: int) -> None:
    recording, truth = again(seed)
    found = 0
    for first in range(0, len(recording.t) - 150, 90):
        try:
            placed = localised(later(recording, first, 150), truth, mapped(seed), "unknown")
        except InputError:  # not found in so few scans
            continue
        found += 1
        assert placed.metres.max() < 0.3
        assert placed.radians.max() < 0.1
        assert any("the robot was found on the grid after" in remark for remark in placed.log.remarks)
    assert found >= 3


def test_in_another_building_the_robot_is_not_found() -> None:
    recording, _ = again(0)
    states = np.full((300, 200), FREE, np.uint8)
    states[[0, -1]] = states[:, [0, -1]] = WALL
    room = of_states(np.zeros(2), 0.05, states)
    elsewhere = replace(later(recording, 0, 150), map=room, start="unknown")
    refused(r"not found on the grid in \d+ steps: .*; expected a drive on it", build_log, elsewhere, Settings())


def test_where_all_places_look_alike_none_is_taken() -> None:
    """Two halves of the map are the same: the robot is in one of them, and nothing says in which."""
    recording, _ = again(0)
    grid = mapped(0)
    twice = Occupancy(grid.origin, grid.size, np.concatenate((grid.cells, grid.cells), axis=0))
    alike = replace(later(recording, 0, 60), map=twice, start="unknown")
    refused(r"several places \(\d+\)", build_log, alike, Settings())


def test_a_start_far_off_is_a_sentence() -> None:
    """The prior is 8 m off: nothing near it matches."""
    recording, _ = again(0)
    prior = recording.prior._replace(pose=recording.prior.pose + np.array((0.0, 8.0, 0.0)))
    astray = replace(later(recording, 0, 100), map=mapped(0), prior=prior)
    refused(r"none of its \d+ steps matches the grid, from a start at x .*; expected", build_log, astray, Settings())

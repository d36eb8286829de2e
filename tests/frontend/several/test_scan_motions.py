"""What scans tell without the wheels: the wheels' information is out of it, and its own errors are as stated."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from differences import central
from several_drives import driven, squares, true_poses
from slamduel.core.se2 import Array, between, compose
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.laser._matching import USUAL, Hold
from slamduel.frontend.laser.front_end import KeyScan
from slamduel.frontend.laser.loops import WEAK, cov_by_points
from slamduel.frontend.laser.recording import matched
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.several.scan_motions import place_by_points, scan_motions
from tiers import first_quick

NOTHING = np.zeros((3, 3))


def spread(rng: np.random.Generator, size: float) -> Array:
    root = rng.standard_normal((3, 3))
    return size * (root @ root.T + 0.3 * np.eye(3))


@pytest.mark.parametrize("seed", range(8))
def test_the_wheels_are_taken_out_exactly_where_matching_is_linear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, wheels = spread(rng, 1e5), spread(rng, 1e3)
    place, held = rng.normal(0, 0.02, 3), rng.normal(0, 0.02, 3)
    pose = np.linalg.solve(points + wheels, points @ place + wheels @ held).astype(np.float64)
    scatter = spread(rng, 1e4)
    key = KeyScan(pose, points, scatter, Hold(held, wheels), 0, True, NOTHING, NOTHING)
    found, s = place_by_points(key), Settings()
    # WEAK is all that is left of the wheels: it pulls by its share of the information.
    weak = USUAL * WEAK
    bound = np.linalg.norm(weak, 2) / np.linalg.eigvalsh(points)[0] * np.linalg.norm(place - held)
    assert np.linalg.norm(found - place) <= bound + 1e-12
    assert bound < 0.1 * np.linalg.norm(pose - place)
    own = np.linalg.inv(points + weak)
    expected = own @ ((1 + s.map_share) * scatter + weak @ np.linalg.inv(WEAK) @ weak) @ own
    np.testing.assert_allclose(cov_by_points(points, scatter, s), expected, rtol=1e-9, atol=1e-15)


def test_along_a_corridor_a_scan_tells_nothing() -> None:
    points = np.diag([0.0, 1e5, 1e5])  # walls to the left and right alone
    hold = Hold(np.array([1.0, 0.01, 0.0]), 1e3 * np.eye(3))
    key = KeyScan(np.array([1.0, 0.0, 0.0]), points, 0.2 * points, hold, 0, True, NOTHING, NOTHING)
    sd = np.sqrt(np.diag(cov_by_points(points, 0.2 * points, Settings())))
    assert sd[0] == pytest.approx(WEAK[0, 0] ** -0.5, rel=1e-6)
    assert sd[1:].max() < 2e-3
    place = place_by_points(key)
    assert place[0] == pytest.approx(1.0, abs=1e-12)
    assert place[1] == pytest.approx(-1e-4, rel=1e-3)  # H^-1 W times the 0.01 m by which the wheels pulled


@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_wheels_that_are_off_move_the_matches_and_not_what_the_scans_tell(seed: int) -> None:
    """Wheels that read 10 % too much pull each match their way; taken out, a tenth of that or less is left."""
    scans, settings = driven(seed).several.scans, driven(seed).several.settings
    assert scans is not None
    assert scans.odometry is not None
    motion = between(scans.odometry[:-1], scans.odometry[1:]) * [1.1, 1.0, 1.0]
    walked = [scans.odometry[0]]
    for one in motion:
        walked.append(compose(walked[-1], one))
    front_ends = [matched(one, settings) for one in (scans, replace(scans, odometry=np.array(walked)))]
    right, wrong = (scan_motions(one) for one in front_ends)
    np.testing.assert_array_equal(right.at, wrong.at)
    off = squares(wrong.delta, right.cov, right.delta)
    assert np.median(off) < 0.02


def of_room(seed: int) -> float:
    """The mean normalised squared error of the motions of a drive; several share the step that they go from."""
    made = driven(seed)
    poses, m = true_poses(made.alone.t), made.motions
    assert len(m.at) == len(made.alone) - 1
    assert (m.at - m.to).mean() > 4  # not from each to the next
    return float(squares(m.delta, m.cov, between(poses[m.to], poses[m.at])).mean())


def test_in_a_room_errors_are_as_stated() -> None:
    assert 0.3 < of_room(0) < 3


@pytest.mark.slow
def test_in_rooms_errors_are_as_stated() -> None:
    found = np.array([of_room(seed) for seed in range(16)])
    assert 0.6 < found.mean() < 1.4
    assert found.max() < 4


def of_floor(seed: int) -> float:
    options = Options(laps=0.4)
    recording, truth = record(options, np.random.default_rng(seed))
    front_end = matched(recording, options)
    poses = truth.poses[[step.scan for step in front_end.steps]]
    m = scan_motions(front_end)
    return float(squares(m.delta, m.cov, between(poses[m.to], poses[m.at])).mean())


def test_on_a_floor_errors_are_as_stated() -> None:
    assert 0.4 < of_floor(0) < 2


@pytest.mark.slow
def test_on_floors_errors_are_as_stated() -> None:
    """A submap's bend is not in a motion over 2.5 m: on one floor in eight it is most of the error."""
    found = np.array([of_floor(seed) for seed in range(8)])
    assert 0.5 < found.mean() < 2
    assert 0.5 < np.median(found) < 2
    assert found.max() < 4


def test_the_covariance_is_that_of_both_places() -> None:
    """By numerical derivatives of the motion by either place, in another order than the code's."""
    made = driven(0)
    s, m, keys = made.several.settings, made.motions, made.front_end.keys
    for row in range(3, len(m.at), 7):
        k, base = int(m.at[row]), int(m.to[row])
        expected = keys[k].stale + keys[base].stale
        first, second = m.places[base], m.places[k]
        by_first = central(partial(lambda other, place: between(place, other), second), first)
        by_second = central(partial(between, first), second)
        for by, of in ((by_first, base), (by_second, k)):
            key = keys[of or 1]
            expected = expected + by @ cov_by_points(key.slope, key.scatter, s) @ by.T
        np.testing.assert_allclose(m.cov[row], expected, rtol=1e-5, atol=1e-12)


def test_without_wheels_the_motion_before_is_taken_out_too() -> None:
    several = driven(0).several
    assert several.scans is not None
    alone = matched(replace(several.scans, odometry=None), several.settings)
    m, poses = scan_motions(alone), true_poses(np.array([step.t for step in alone.steps]))
    assert squares(m.delta, m.cov, between(poses[m.to], poses[m.at])).mean() < 1.7

"""Speeds that are held from row to row: the same drive at each rate, and what rows do not tell, as uncertainty."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import chi2

from held_drives import NOISE, SECONDS, Kind, driven, nees, track
from slamduel.core.se2 import Array, between
from slamduel.frontend.wheels.encoder import Floors
from slamduel.frontend.wheels.held import held, way
from slamduel.frontend.wheels.track import Track, TrackNoise

SEEDS = range(8)
KINDS: tuple[Kind, ...] = ("circle", "slalom", "stops", "wander")
RATES = (10, 5, 2, 1)
NONE = Floors(0.0, 0.0)
BARE = TrackNoise(0.05, 0.03, 0.05, NONE)
NO_NOISE = TrackNoise(0.0, 0.0, 0.0, NONE)


@pytest.mark.parametrize("every", [1.0, 0.2, 3.0])
@pytest.mark.parametrize("hz", [5, 2, 1])
def test_the_same_drive_at_each_rate_has_the_same_motions_and_noise(hz: int, every: float) -> None:
    """Rows at 10 Hz of an even drive, and fewer: to an eighth of a chord's turn, here 0.02 and 0.04 rad, of its length.

    Steps lie at rows, or in a chord of 0.05 m, at either end of which its direction is off by half of its turn.
    """
    at = every * np.arange(np.floor(12 / every) + 1)
    fine, coarse = (
        track(t, np.tile([0.5, 0.4], (len(t), 1)), BARE).motions(at)
        for t in (np.linspace(0.0, 12.0, 121), np.linspace(0.0, 12.0, 12 * hz + 1))
    )
    np.testing.assert_allclose(coarse.delta, fine.delta, atol=0.5 * 0.05 * 0.02)
    scale = np.sqrt(np.einsum("ni,nj->nij", *2 * (np.einsum("nii->ni", fine.cov),)))
    assert (np.abs(coarse.cov - fine.cov) < 0.01 * scale).all()


def test_a_row_of_a_second_states_what_its_turn_does_sideways() -> None:
    """0.03 rad per root metre over 1 m: 0.0173 m, of which a heading that was off at its end alone had none."""
    t: Array = np.arange(4.0)
    found = track(t, np.tile([1.0, 0.0], (4, 1)), TrackNoise(0.05, 0.03, 0.05, Floors(1e-3, 1e-3))).motions(t)
    np.testing.assert_allclose(np.sqrt(found.cov[:, 1, 1]), np.sqrt(0.03**2 / 3 + 1e-6), rtol=1e-12)
    np.testing.assert_allclose(found.cov[:, 1, 2], 0.03**2 / 2, rtol=1e-12)


@pytest.mark.parametrize("hz", RATES)
@pytest.mark.parametrize("kind", KINDS)
def test_dead_reckoning_and_single_steps_are_consistent_at_each_rate(kind: Kind, hz: int) -> None:
    """By 8 drives of a minute. Errors of dead reckoning are one chi-square of 3 for each drive: the 99.9 % interval.

    Single steps have 480 of them, which a mean of 1.2 exceeds by 5 standard errors; what is below is cautious, as the
    floors of 1 mm are beside a robot that turns on the spot.
    """
    single, reckoned = np.mean([nees(one := driven(kind, seed, hz), 1.0, one.rates) for seed in SEEDS], axis=0)
    assert 0.4 < single < 1.2
    low, high = chi2.ppf([0.0005, 0.9995], 24) / 24
    assert low < reckoned < high


@pytest.mark.parametrize("kind", ["slalom", "wander"])
def test_speeds_that_change_in_a_row_are_a_part_of_the_noise_where_rows_are_few(kind: Kind) -> None:
    for hz, without, most in ((1, 2.0, 1.2), (10, 1.0, 1.1)):
        drives = [driven(kind, seed, hz) for seed in SEEDS]
        bare, stated = (
            np.mean([nees(one, 1.0, one.rates, sudden=sudden)[0] for one in drives]) for sudden in (True, False)
        )
        assert bare > without * 0.9
        assert stated < most
        if hz == 10:
            assert stated == pytest.approx(bare, rel=0.01)


@pytest.mark.parametrize("every", [1.0, 0.2, 0.5])
@pytest.mark.parametrize("kind", ["slalom", "wander"])
def test_steps_inside_of_rows_are_consistent(kind: Kind, every: float) -> None:
    assert np.mean([nees(one := driven(kind, seed, 1), every, one.rates)[0] for seed in SEEDS]) < 1.2


@pytest.mark.parametrize("at", [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.7, 2.3, 2.5, 4.0], [0.4, 4.6], [2.2, 2.9]])
def test_what_a_slope_changes_is_what_integration_finds(at: list[float]) -> None:
    """Rows of a robot whose speeds grow evenly: of each row, the way with its slope less the way without, squared.

    Slopes are small, so that the second order is: 0.02 rad of heading.
    """
    slope = np.array([0.02, 0.03])
    t: Array = np.arange(6.0)
    rates = np.array([0.5, 0.1]) + slope * (t[:, None] + 0.5)
    found = track(t, rates, NO_NOISE)
    expected_slopes = np.tile(slope, (5, 1))
    expected_slopes[[0, -1]] = 0.0  # one neighbour alone
    np.testing.assert_allclose(found.slopes, expected_slopes, atol=1e-12)

    def moved(start: float, end: float, row: int, axis: int, size: float) -> Array:
        def flow(time: float, pose: Array) -> list[float]:
            v, w = rates[min(int(time), 4)] + size * (int(time) == row) * np.eye(2)[axis] * (time - row - 0.5)
            return [v * np.cos(pose[2]), v * np.sin(pose[2]), w]

        pose = np.zeros(3)
        cuts = np.unique([start, end, *np.arange(np.ceil(start), end)])
        for low, high in pairwise(cuts.tolist()):
            inside = np.clip((low, high), low + 1e-12, high - 1e-12)
            pose = solve_ivp(flow, inside, pose, rtol=1e-11, atol=1e-13).y[:, -1]
        return pose

    for k, (start, end) in enumerate(pairwise(at)):
        total = np.zeros((3, 3))
        for row in range(1, 4):
            for axis in (0, 1):
                off = moved(start, end, row, axis, slope[axis]) - moved(start, end, row, axis, 0.0)
                total += np.outer(off, off)
        stated = found.motions(np.array(at)).cov[k]
        scale = np.sqrt(np.outer(*2 * (np.diag(total),))) + 1e-9
        assert (np.abs(stated - total) < 0.12 * scale).all()


def test_jumps_extrema_ends_and_holes_have_no_slope() -> None:
    t: Array = np.arange(8.0) / 10
    speeds = np.column_stack(([0, 0, 0.5, 0.5, 0.5, 0.2, 0.5, 0.5], np.zeros(8)))
    np.testing.assert_array_equal(track(t, speeds).slopes, 0)
    ramp = np.column_stack((np.arange(40) / 10, 0.2 * np.ones(40)))
    t = np.concatenate((np.arange(20) / 10, 4 + np.arange(20) / 10))
    found = track(t, ramp)
    assert found.holes.start.tolist() == [1.9]
    assert found.slopes[19].tolist() == [0.0, 0.0]
    assert (found.slopes[1:18, 0] > 0.5).all()
    assert (track(t, ramp, sudden=True).slopes == 0).all()


def test_a_long_row_of_a_robot_that_stands_tells_of_no_slope() -> None:
    t = np.array([0.0, 0.1, 0.2, 60.2, 60.3, 60.4])
    speeds = np.column_stack(([0.5, 0.3, 0.0, 0.2, 0.5, 0.5], [0.5, 0.5, 0.0, 0.5, 0.5, 0.5]))
    found = track(t, speeds).motions(np.array([0.0, 20.0, 40.0, 60.4]))
    assert np.sqrt(found.cov[1, 2, 2]) < 2e-3


def test_a_rows_meaning_is_until_the_next_since_the_last_or_at_its_time() -> None:
    rates = np.array([[0.0, 0.1], [0.2, 0.3], [0.6, 0.7]])
    np.testing.assert_array_equal(held(rates, "until-next"), rates)
    np.testing.assert_array_equal(held(rates, "since-last")[:2], rates[1:])
    np.testing.assert_allclose(held(rates, "at-time")[:2], [[0.1, 0.2], [0.4, 0.5]])


@pytest.mark.parametrize("kind", ["slalom", "wander"])
def test_speeds_at_a_rows_time_are_late_where_they_are_held(kind: Kind) -> None:
    late, right = np.mean(
        [
            [nees(one, 1.0, held(one.instant, meaning))[0] for meaning in ("until-next", "at-time")]
            for one in (driven(kind, seed, 2) for seed in SEEDS)
        ],
        axis=0,
    )
    assert late > 2.5
    assert right < 1.2


def test_readings_far_apart_are_on_an_arc_too() -> None:
    """Poses each second of a robot on a circle of 1 m: half a second later it is on it, not on the chord, 3 cm off."""
    turn: Array = 0.5 * np.arange(7.0)
    poses = np.column_stack((np.sin(turn), 1 - np.cos(turn), turn))
    found = Track(np.arange(7.0), poses, NOISE).odometry(1.0, 2.5).delta
    expected = between(poses[1], np.array([np.sin(1.25), 1 - np.cos(1.25), 1.25]))
    np.testing.assert_allclose(found, expected, atol=0.02**2 / 8)  # off a chord of 0.02 rad, radius 1 m


def test_a_way_has_the_rows_among_its_poses() -> None:
    t = np.array([0.0, 0.5, 4.5, SECONDS])
    along = way(t, np.array([[1.0, 0.03], [0.5, 2.0], [0.0, 0.0], [9.0, 9.0]]), "cart")
    np.testing.assert_allclose(along.t[along.rows], t, atol=1e-12)
    assert np.abs(np.diff(np.unwrap(along.poses[:, 2]))).max() <= 0.02 + 1e-9
    assert np.unwrap(along.poses[:, 2])[-1] == pytest.approx(0.015 + 8.0)

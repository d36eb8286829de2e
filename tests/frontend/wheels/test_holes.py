"""Holes in odometry: found, remarked, given a noise that holds what happened in them, and refused if too long."""

import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array, between, wrap
from slamduel.frontend.wheels.encoder import Encoder
from slamduel.frontend.wheels.holes import LEAST, outside
from slamduel.frontend.wheels.ticks import Ticks, Wheels
from slamduel.frontend.wheels.track import Track, TrackNoise

T: Array = np.round(np.arange(0.0, 60.0, 0.1), 6)


def bends(t: Array = T) -> Array:
    """(m, 3) a drive at 0.5 m/s in bends, at most 0.4 rad/s."""
    fine = np.linspace(0, 60, 60_001)
    heading = 2 * np.sin(0.2 * fine)
    x, y = (np.cumsum(0.5 * f(heading)) * 1e-3 for f in (np.cos, np.sin))
    return np.column_stack((np.interp(t, fine, x), np.interp(t, fine, y), wrap(np.interp(t, fine, heading))))


def cut(start: float, end: float, *, bridged: bool = True) -> Track:
    """The drive without its readings between `start` and `end`, s."""
    kept = (start >= T) | (end <= T)
    return Track(T[kept], bends()[kept], TrackNoise(), source="cart", bridged=bridged)


def test_without_a_hole_there_is_neither_a_remark_nor_a_noise() -> None:
    track = Track(T, bends(), TrackNoise())
    track.check()
    assert track.remarks(0, 60) == []
    expected = [track.odometry(start, start + 1.0) for start in range(10)]
    found = track.motions(np.arange(11.0))
    for k, one in enumerate(expected):
        np.testing.assert_array_equal(found.delta[k], one.delta)
        np.testing.assert_array_equal(found.cov[k], one.cov)


def test_a_hole_is_told_with_its_time_its_length_and_its_noise() -> None:
    track = cut(20, 25)
    (remark,) = track.remarks(0, 60)
    assert remark.startswith("cart: no reading for 5 s, from 20 to 25 s, where 0.1 s are usual (median)")
    assert "standard deviation of up to 2.5 m and 1." in remark
    assert track.remarks(0, 20) == track.remarks(25, 60) == []
    kept = ~((T > 20) & (T < 25)) & ~((T > 40) & (T < 42))
    (both,) = Track(T[kept], bends()[kept], TrackNoise()).remarks(0, 60)
    assert "no reading 2 times, the longest for 5 s, from 20 to 25 s" in both


def test_a_short_time_or_a_slow_clock_is_no_hole() -> None:
    assert len(cut(20, 20 + LEAST).holes.start) == 0
    slow = np.arange(0.0, 60.0, 3.0)
    assert Track(slow, bends(slow), TrackNoise()).remarks(0, 60) == []


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3])
def test_readings_lost_one_by_one_at_random_leave_no_hole(share: float) -> None:
    rng, found, kept = np.random.default_rng(1), 0, np.zeros(0, bool)
    for _ in range(200):
        kept = rng.random(len(T)) > share
        found += len(Track(T[kept], bends()[kept], TrackNoise()).holes.start) > 0
    assert found <= 6  # of 2 expected at most
    kept[250:265] = False
    assert len(Track(T[kept], bends()[kept], TrackNoise()).holes.start) == 1


@pytest.mark.parametrize("length", [1.0, 2.0, 4.0, 6.0])
def test_the_noise_in_a_hole_holds_what_happened_in_it(length: float) -> None:
    """Of many holes, the normalised squared error of the motion to their middle is that of a cautious belief."""
    errors = list[float]()
    for start in range(2, 52):
        middle = np.array([float(start), start + length / 2])
        found = cut(start, start + length).odometry(*middle)
        true = bends(middle)
        error = between(true[0], true[1]) - found.delta
        error[2] = wrap(error[2:])[0]
        errors.append(float(error @ np.linalg.solve(found.cov, error)))
    assert np.mean(errors) < 3
    without = Track(T, bends(), TrackNoise()).odometry(2.0, 2.0 + length / 2).cov
    assert cut(2, 2 + length).odometry(2.0, 2.0 + length / 2).cov[0, 0] > 4 * without[0, 0]


def test_the_noise_grows_with_the_hole_and_ends_with_it() -> None:
    def sd(track: Track, start: float, end: float) -> Array:
        return np.sqrt(np.diag(track.odometry(start, end).cov))

    longer = [sd(cut(20, 20 + length), 20.0, 20 + length / 2) for length in (1.0, 2.0, 4.0)]
    assert (np.diff(longer, axis=0) > 0).all()
    track = cut(20, 24)
    assert (sd(track, 20.0, 24.0) < 0.2 * sd(track, 20.0, 22.0)).all()  # the end is known again
    np.testing.assert_array_equal(sd(track, 30.0, 31.0), sd(Track(T, bends(), TrackNoise()), 30.0, 31.0))
    lost = cut(20, 24, bridged=False)
    assert (sd(lost, 20.0, 24.0) > sd(lost, 20.0, 22.0)).all()


def test_wheels_turn_as_counted_but_where_they_went_in_a_hole_is_unknown() -> None:
    turned = np.column_stack((400 * T + 60 * np.sin(T), 400 * T - 60 * np.sin(T)))
    kept = (T <= 20) | (T >= 24)
    encoder = Encoder(1e-3, 1e-3, 0.3, 0.02, "distance")
    whole, holed = Wheels(Ticks(T, turned), encoder), Wheels(Ticks(T[kept], turned[kept]), encoder, source="cart")
    holed.check()
    (remark,) = holed.remarks(0, 60)
    assert "no reading for 4 s, from 20 to 24 s" in remark
    before, after = whole.odometry(20.0, 24.0).cov, holed.odometry(20.0, 24.0).cov
    assert np.sqrt(after[0, 0]) == pytest.approx(0.4 * 4, rel=0.1)
    assert after[2, 2] < 1.1 * before[2, 2]
    np.testing.assert_array_equal(holed.odometry(30.0, 31.0).cov, whole.odometry(30.0, 31.0).cov)


def test_a_robot_that_stands_still_writes_nothing_and_has_no_hole() -> None:
    t = np.concatenate((T[:100], 30 + T[:100]))
    poses = np.concatenate((bends()[:100], bends()[99:199]))
    assert Track(t, poses, TrackNoise()).remarks(0, 60) == []


def test_a_hole_in_which_the_heading_is_lost_is_refused() -> None:
    cut(20, 28).check()
    refused(r"cart: found no reading from 20 to 35 s, 15 s, expected at most \d+\.?\d* s", cut(20, 35).check)


@pytest.mark.parametrize(("lost", "share"), [(2, ""), (84, "41 %"), (203, "all")])
def test_what_is_outside_is_counted_unless_it_is_a_handful(lost: int, share: str) -> None:
    found = outside("drive", lost, 203, "frame", "before or after the odometry, 0 to 30 s")
    sentence = f"drive: {lost} of 203 frames ({share}) are before or after the odometry, 0 to 30 s, and left out"
    assert found == ([sentence] if share else [])

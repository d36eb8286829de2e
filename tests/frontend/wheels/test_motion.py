"""Readings of motion -> factors: wheels, poses and nothing at all; counters that wrap, begin again or misread."""

import itertools
import re

import numpy as np
import pytest

from motions import chain, chained
from refusals import refusal, refused
from slamduel.core.se2 import Array, between, compose
from slamduel.frontend.wheels.counters import MAX_SPEED, check_counts, unwrap
from slamduel.frontend.wheels.diffusion import along
from slamduel.frontend.wheels.encoder import Encoder, Floors
from slamduel.frontend.wheels.motion import Drift, Motion
from slamduel.frontend.wheels.ticks import Ticks, Wheels
from slamduel.frontend.wheels.track import Track, TrackNoise

ENCODER = Encoder(1e-3, 1e-3, 0.3, 0.02, "distance", curve="arc")
T: Array = np.arange(121.0) / 20


def driven(t: Array = T) -> Array:
    """(m, 2) counts of a drive with bends both ways, some 400 and 300 a second."""
    return np.stack((400 * t + 60 * np.sin(2 * t), 300 * t - 80 * np.sin(2 * t)), axis=-1)


def wheels(counts: Array, t: Array = T, max_speed: float = 5.0) -> Wheels:
    return Wheels(Ticks(t, counts), ENCODER, max_speed, "cart: encoder")


def poses(counts: Array) -> Array:
    """(m, 3) where arcs between readings of `counts` lead."""
    steps = [ENCODER.odometry(step[None], np.ones(1)).delta for step in np.diff(counts, axis=0)]
    return chained(np.array(steps))


def in_between(motion: Motion, cuts: Array) -> Array:
    """(3,) the motion over all of `cuts`, piece by piece."""
    return chained(np.array([motion.odometry(start, end).delta for start, end in itertools.pairwise(cuts)]))[-1]


@pytest.mark.parametrize("bits", [8, 16, 32])
@pytest.mark.parametrize("signed", [False, True])
def test_wraps_are_undone_whatever_the_sign(bits: int, signed: bool) -> None:
    span = 2**bits
    per_reading = np.array([[0.4, -0.3]]) * span  # the fastest that may be told apart is half the range
    counts = np.rint(np.cumsum(np.repeat(per_reading, 40, axis=0), axis=0)).astype(np.int64)
    counter = (counts + span // 2) % span - span // 2 if signed else counts % span
    found = unwrap(counter.astype(float), bits)
    np.testing.assert_array_equal(found - found[0], counts - counts[0])
    np.testing.assert_array_equal(found[0], counter[0])


def test_counts_that_do_not_wrap_stay() -> None:
    np.testing.assert_allclose(unwrap(driven(), 32), driven(), rtol=0, atol=1e-9)  # sums of steps, up to 3,000
    assert unwrap(np.zeros((1, 2)), 8).tolist() == [[0.0, 0.0]]
    assert unwrap(np.zeros((0, 2)), 8).shape == (0, 2)


def test_good_readings_pass() -> None:
    wheels(driven()).check()
    wheels(np.rint(driven())).check()
    wheels(-driven()).check()
    wheels(np.zeros((121, 2))).check()
    wheels(np.ones((1, 2)), np.zeros(1)).check()


def test_bursts_of_messages_pass() -> None:
    """Half of the readings come 10 us after the one before, as from a buffer; counted at their time, 2,000 m/s."""
    t = T.copy()
    t[1::2] = t[::2][: len(t[1::2])] + 1e-5
    wheels(driven(), t).check()
    Track(t, poses(driven()), TrackNoise()).check()


@pytest.mark.parametrize(("bits", "begin"), [(8, 250), (16, 65000), (32, 2**32 - 700)])
def test_a_counter_that_wraps_is_refused_with_its_width(bits: int, begin: int) -> None:
    wrapped = (np.rint(driven()) + begin) % 2**bits
    said = refusal(wheels(wrapped).check)
    assert f"counter of {bits} bits wrapped, set counter_bits = {bits}" in said
    row, wheel = (int(index) for index in np.argwhere(np.abs(np.diff(wrapped, axis=0)) > 2 ** (bits - 1))[0])
    before, after = wrapped[row : row + 2, wheel]
    expected = (
        f"cart: encoder: between readings {row} and {row + 1}, at {T[row]} and {T[row + 1]} s, the "
        f"{('left', 'right')[wheel]} wheel's count goes from {before:.0f} to {after:.0f}, "
    )
    assert expected in said
    wheels(unwrap(wrapped, bits)).check()


def test_a_wrap_no_faster_than_a_wheel_can_be_is_seen_all_the_same() -> None:
    """65,536 counts of 2.3 um are 15 cm: with 1.6 m/s between two readings."""
    encoder = Encoder(2.3e-6, 2.3e-6, 0.7, 0.01)
    t = np.arange(200.0) / 10
    counts = np.rint(np.stack((30e3 * t, 31e3 * t), axis=-1)) % 2**16
    refused("set counter_bits = 16", Wheels(Ticks(t, counts), encoder).check)
    Wheels(Ticks(t, unwrap(counts, 16)), encoder).check()


def test_a_reset_is_refused() -> None:
    far = np.rint(driven()) + 40000
    far[70:] -= far[70]
    refused(r"between readings 69 and 70, .* left wheel.* this looks like a reset", wheels(far).check)


def test_a_reset_soon_after_the_start_is_seen_all_the_same() -> None:
    """0.3 m in 0.05 s are 6 m/s, which max_speed = 20 lets pass."""
    counts = np.rint(np.stack((300 * T, 310 * T), axis=-1))
    counts[20:] -= counts[20]
    refused(r"between readings 19 and 20, .* this looks like a reset", wheels(counts, max_speed=20.0).check)


def test_a_misread_count_is_refused() -> None:
    counts = np.rint(driven())
    counts[33, 1] += 3333
    found = r"between readings 32 and 33, .* right wheel.* expected at most max_speed = 5 m/s: a misread count"
    refused(found, wheels(counts).check)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_counts_and_poses_that_are_no_numbers_are_refused(value: float) -> None:
    counts, way = driven(), poses(driven())
    counts[5, 1] = way[5, 2] = value
    refused(f"encoder: in reading 5, at 0.25 s, the right wheel's count is {value}", wheels(counts).check)
    refused(f"odometry: in reading 5, at 0.25 s, heading is {value}, expected", Track(T, way, TrackNoise()).check)


def test_odometry_that_was_set_back_is_refused() -> None:
    way = poses(driven())
    Track(T, way, TrackNoise()).check()
    way[80:] -= way[80]
    found = r"between readings 79 and 80, .* expected at most max_speed = 5 m/s: an odometry reset"
    refused(found, Track(T, way, TrackNoise()).check)


def test_what_is_out_of_order_is_refused_by_its_source() -> None:
    back = wheels(np.zeros((3, 2)), np.array([0.0, 1.0, 0.0]))
    refused("cart: encoder: reading 2 is at 0.0 s, expected later than 1.0 s", back.check)
    refused("odometry: found no readings, expected", Track(np.zeros(0), np.zeros((0, 3)), TrackNoise()).check)


def test_wheels_and_the_track_they_make_agree() -> None:
    cuts = np.array([0.0, 0.5, 0.75, 2.0, 2.05, 6.0])  # at readings: between them one bends and the other is straight
    counts = driven()
    one, other = wheels(counts), Track(T, poses(counts), TrackNoise())
    for start, end in itertools.pairwise(cuts):
        np.testing.assert_allclose(one.odometry(start, end).delta, other.odometry(start, end).delta, atol=1e-12)


def test_a_track_does_not_depend_on_where_it_is_cut() -> None:
    way = poses(driven())
    track = Track(T, way, TrackNoise())
    rng = np.random.default_rng(3)
    for _ in range(20):
        cuts = np.concatenate(([0.0], np.sort(rng.uniform(0, 6, 6)), [6.0]))
        np.testing.assert_allclose(in_between(track, cuts), between(way[0], way[-1]), atol=1e-12)


def test_a_tracks_noise_composes_over_cuts_at_readings() -> None:
    """Without floors; within rounding, where nothing is linearised at another place."""
    track = Track(T, poses(driven()), TrackNoise(0.02, 0.03, 0.04, Floors(0.0, 0.0)))
    cuts = T[[0, 17, 60, 120]]
    delta, cov = np.zeros(3), np.zeros((3, 3))
    for start, end in itertools.pairwise(cuts):
        piece = track.odometry(start, end)
        delta, cov = chain(delta, cov, piece.delta, piece.cov)
    np.testing.assert_allclose(cov, track.odometry(cuts[0], cuts[-1]).cov, rtol=1e-10, atol=1e-15)


def test_a_tracks_covariance_is_that_of_noisy_steps() -> None:
    """Each step driven as stated in 16 pieces of its arc, n drives: entries within 6 of their standard errors.

    Of normal errors entry ij has variance (C_ij^2 + C_ii C_jj) / n; the second-order part is of the size of the
    covariance of the heading, here 0.8 %, twice as much as six standard errors at n = 5,000 leave room for.
    """
    noise = TrackNoise(0.01, 0.01, 0.01, Floors(0.0, 0.0))
    t, way = T[::4], poses(driven())[::4]
    stated = Track(t, way, noise).odometry(t[0], t[-1])
    rng, n, pieces = np.random.default_rng(5), 5_000, 16
    pose = np.zeros((n, 3))
    for step in between(way[:-1], way[1:]):
        half = along(step, np.array(0.5 / pieces))
        length = np.hypot(*step[:2]) / np.sinc(step[2] / 2 / np.pi) / pieces
        turn = np.sqrt(noise.turning**2 * length + noise.turning_by_turn**2 * abs(step[2]) / pieces)
        for _ in range(pieces):
            error = rng.normal(size=(n, 3)) * [noise.forward * np.sqrt(length), 0.0, turn]
            pose = compose(compose(compose(pose, half), error), half)
    found = np.cov((pose - stated.delta).T)
    scale = np.sqrt(np.outer(np.diag(stated.cov), np.diag(stated.cov)))
    bound = 6 * np.sqrt((stated.cov**2 + scale**2) / n) + 2 * stated.cov[2, 2] * scale
    assert (np.abs(found - stated.cov) < bound).all()


def test_a_track_between_readings_takes_the_short_way_round() -> None:
    track = Track(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]]), TrackNoise())
    assert track.odometry(0.0, 0.5).delta[2] == pytest.approx(np.pi - 3.0)


def test_drift_stands_still_and_grows_with_time() -> None:
    drift = Drift(0.3, 0.2, Floors(1e-3, 2e-3))
    drift.check()
    assert drift.t[0] == -np.inf
    assert drift.t[-1] == np.inf
    found = drift.odometry(1.0, 5.0)
    np.testing.assert_array_equal(found.delta, np.zeros(3))
    np.testing.assert_allclose(found.cov, np.diag([0.36 + 1e-6, 0.36 + 1e-6, 0.16 + 4e-6]), rtol=1e-14)
    without = Drift(0.3, 0.2, Floors(0.0, 0.0))
    pieces = sum(without.odometry(a, b).cov for a, b in ((1.0, 1.5), (1.5, 4.0), (4.0, 5.0)))
    np.testing.assert_allclose(pieces, without.odometry(1.0, 5.0).cov, rtol=1e-14)


def test_what_a_log_is_told() -> None:
    assert re.search("left.*max", str(wheels(driven()).settings)) is None  # the encoder, and not how it was checked
    assert wheels(driven()).settings["encoder"]["base"] == 0.3
    assert Drift(0.3, 0.2).settings["drift"]["turning"] == 0.2
    assert Track(T, poses(driven()), TrackNoise(0.5)).settings["odometry"]["forward"] == 0.5


def test_a_reset_soon_after_the_start() -> None:
    """Both wheels are back at nothing from five steps away: at a speed that is possible, and yet no wheel did that."""
    counts = 50.0 * np.concatenate((np.arange(6), np.arange(20)))[:, None] * np.ones(2)
    t: Array = np.arange(len(counts)) / 50.0
    said = "between readings 5 and 6.*from 250 to 0.*this looks like a reset"
    refused(said, check_counts, t, counts, np.full(2, 1e-4), MAX_SPEED, "ticks.csv")

"""The rendered drive as a dataset: what it promises of the log, the truth and the noise."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from drawn_errors import seen
from refusals import refused
from room_drives import room_drive
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import check
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.worlds.aruco_room import ENCODER, TICK, Options, aruco_room, record
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import count, drive, slipped
from slamduel.frontend.markers.noise import PropagatedNoise, ProportionalNoise
from slamduel.frontend.markers.noise_fit import squares
from slamduel.frontend.wheels.counters import unwrap
from slamduel.frontend.wheels.ticks import readings
from tiers import first_quick

SHORT = Options(seconds=2.0)


@pytest.fixture(scope="module")
def short() -> Dataset:
    return aruco_room(SHORT, np.random.default_rng(1))


@pytest.fixture(scope="module")
def lap() -> Dataset:
    return room_drive(2)[0]


def off(made: Dataset) -> Array:
    """(s, 2) errors of the range and bearing of every sighting."""
    poses = made.truth.poses[made.log.sighting_step]
    rows = np.searchsorted(made.truth.map.ids, made.log.ids)
    error = made.log.z - seen(poses, made.truth.map.xy[rows])
    error[:, 1] = wrap(error[:, 1])
    return error


def test_a_step_is_a_frame(short: Dataset) -> None:
    log, truth = short
    assert log.name == "aruco-room"
    check(log, "aruco-room")
    np.testing.assert_allclose(log.t, np.arange(11) / 5, atol=1e-12)
    np.testing.assert_array_equal(truth.t, log.t)
    np.testing.assert_array_equal(truth.poses[0], log.prior.pose)
    np.linalg.cholesky(log.prior.cov)
    assert truth.kind == "truth"
    assert truth.map.ids.tolist() == list(range(24))
    assert log[0].odometry is None
    assert log.sighting_first[1] > 0  # the robot sees markers before it moves
    assert len(log.ids) > 11
    assert log.notes["counts"]["frames"] == 11
    assert log.notes["counts"]["sightings"] == len(log.ids)
    assert log.notes["source"]


def test_measurements_are_what_they_claim(lap: Dataset) -> None:
    error = off(lap)
    assert (lap.log.z[:, 0] <= 3.0).all()
    # The body rocks, which moves markers on the walls, the upper half of the ids, by their height, and others hardly.
    normalised, on_floor = squares(error, lap.log.z_cov) / 2, lap.log.ids < 12
    for mine in (on_floor, ~on_floor):
        assert mine.sum() > 15
        assert abs(normalised[mine].mean() - 1) < 0.2 + 4 / np.sqrt(mine.sum())
    sd = np.sqrt(lap.log.z_cov[:, 0, 0])
    assert np.median(sd[on_floor]) < np.median(sd[~on_floor]) / 3
    assert np.abs(error[:, 0]).max() < 0.06


def test_equation_10_knows_nothing_of_heights() -> None:
    stated = record(Options(seconds=1.0, noise="proportional"), np.random.default_rng(1))[0].noise
    assert stated == ProportionalNoise(0.002, 0.002, 0.008, 0.003)
    stated = record(Options(seconds=1.0), np.random.default_rng(1))[0].noise
    assert stated == PropagatedNoise(sway=0.02)


def test_without_rocking_the_corners_know_how_wrong_they_are() -> None:
    still = aruco_room(Options(seconds=24.0, frame_rate=2.0, sway=0.0), np.random.default_rng(5))
    error = off(still)
    assert len(error) > 80
    # Sightings of one marker from much the same place hang together, so this is no chi-square of as many.
    assert 1.4 < np.mean(squares(error, still.log.z_cov)) < 2.8
    assert np.abs(error[:, 0]).max() < 0.03


def test_dead_reckoning_drifts_and_a_filter_does_not(lap: Dataset) -> None:
    ekf = TextbookEkf(lap.log.prior)
    poses, nees = [], []
    for step, true in zip(lap.log, lap.truth.poses, strict=True):
        pose = ekf.step(step)
        error = pose - true
        error[2] = wrap(error[2])
        poses.append(pose)
        nees.append(error @ np.linalg.solve(ekf.cov[:3, :3], error) / 3)
    adrift = np.linalg.norm((lap.log.dead_reckoned() - lap.truth.poses)[:, :2], axis=1)
    kept = np.linalg.norm((np.array(poses) - lap.truth.poses)[:, :2], axis=1)
    assert adrift.max() > 0.1
    assert np.sqrt((kept**2).mean()) < np.sqrt((adrift**2).mean()) / 2
    assert 0.05 < np.mean(nees) < 3
    _, seen = np.unique(lap.log.ids, return_counts=True)
    assert (seen > 1).sum() > 12


def test_wheel_noise_is_what_the_factors_state() -> None:
    """Heading and way of 2,000 keyframes, without a picture, against the stated covariance."""
    n = 2000
    frames = 0.2 * np.arange(n + 1.0)
    t = TICK * np.arange(10 * n + 1.0)
    ticks = count(*drive(LOOP, 0.4, t), t, ENCODER, np.random.default_rng(3))
    factors = [ENCODER.odometry(*readings(ticks, a, b)) for a, b in pairwise(frames)]
    poses, _ = drive(LOOP, 0.4, frames)
    error = np.array([f.delta for f in factors]) - between(poses[:-1], poses[1:])
    error[:, 2] = wrap(error[:, 2])
    for axis in (0, 2):
        squared = error[:, axis] ** 2 / np.array([f.cov[axis, axis] for f in factors])
        bias = error[:, axis] / np.sqrt([f.cov[axis, axis] for f in factors])
        # chi2 with n degrees of freedom, within 6 sigma; the floors take up to an eighth of the stated variance.
        assert 7 / 8 - 6 * np.sqrt(2 / n) < squared.mean() < 1 + 6 * np.sqrt(2 / n)
        assert abs(bias.mean()) < 6 / np.sqrt(n)


def test_the_true_drive_is_smooth_and_closed() -> None:
    t = np.linspace(0, 80, 8001)
    poses, way = drive(LOOP, 0.4, t)
    steps = np.diff(poses[:, :2], axis=0)
    length = np.linalg.norm(steps, axis=1)
    np.testing.assert_allclose(length, np.diff(way), atol=1e-6)
    assert (np.diff(way) > 0).all()
    assert way[1] < 1e-4  # it starts at rest
    np.testing.assert_allclose(np.diff(way)[1000:] / 0.01, 0.4, atol=1e-4)
    course = np.arctan2(steps[1:, 1], steps[1:, 0])
    assert np.abs(wrap(course - poses[1:-1, 2])).max() < 0.01  # it heads where it goes
    assert np.abs(np.diff(np.unwrap(poses[:, 2]))).max() < 0.4 * 0.01 / 0.5
    lap = np.interp(2 * np.interp(11.28, way, way), way, t)
    assert np.linalg.norm(poses[np.searchsorted(t, lap)][:2] - poses[0, :2]) < 0.1
    assert way[np.searchsorted(t, 60.0)] > 2 * 11.29


def test_a_seed_is_a_log(short: Dataset) -> None:
    again = aruco_room(SHORT, np.random.default_rng(1))
    assert again.log.digest == short.log.digest
    np.testing.assert_array_equal(again.truth.poses, short.truth.poses)
    assert aruco_room(Options(seconds=1.0), np.random.default_rng(2)).log.digest != short.log.head(6).digest


def test_options_are_taken() -> None:
    noise: Any = {"noise": "proportional", "k_range": 0.1, "floor_bearing": 0.5}
    options = Options(markers=2, seconds=1.0, frame_rate=2.0, speed=0.2, **noise)
    recording, truth = record(options, np.random.default_rng(0))
    assert len(truth.map.ids) == 2
    assert truth.t.tolist() == [0.0, 0.5, 1.0]
    assert recording.noise == ProportionalNoise(0.1, 0.002, 0.008, 0.5)
    recording, _ = record(replace(options, noise="propagated", k_range=None, sway=0.01), np.random.default_rng(0))
    assert recording.noise == PropagatedNoise(floor_bearing=0.5, sway=0.01)
    assert np.linalg.norm(truth.poses[-1, :2] - truth.poses[0, :2]) < 0.2


def test_frames_are_rendered_as_they_are_asked_for() -> None:
    recording, truth = record(Options(seconds=600.0), np.random.default_rng(0))
    frames = iter(recording.frames)
    assert next(frames).t == 0.0
    image = next(frames).image
    assert image.shape == (480, 640)
    assert len(truth.t) == 3001


def test_the_robot_rests_before_the_start() -> None:
    poses, way = drive(LOOP, 0.4, np.array([-1.0, -0.05, 0.0]))
    np.testing.assert_array_equal(poses, poses[[2, 2, 2]])
    assert (way == 0).all()


def test_slips_are_as_many_and_as_long_as_stated() -> None:
    """Without noise: the sum of all slips against the mean of a Pareto distribution that is cut off."""
    t: Array = np.linspace(0, 1200, 60_001, dtype=np.float64)
    way: Array = np.linspace(0, 480, 60_001, dtype=np.float64)
    rolled = np.full((60_000, 2), 0.008)
    off = slipped(rolled, way, t, 1.0, np.random.default_rng(5)) - rolled
    spun, held = np.where(off > 0, off, 0).sum(axis=0), -np.where(off < 0, off, 0).sum(axis=0)
    # Of X = min(Pareto(1.5), 20): E X = 1 + 2 (1 - 20^-1/2), E X^2 = 1 + 4 (20^1/2 - 1), in centimetres.
    count = 480 / 4
    expected, sd = 0.01 * count * (3 - 2 / np.sqrt(20)), 0.01 * np.sqrt(count * (4 * np.sqrt(20) - 3))
    np.testing.assert_allclose([*spun, *held], expected, atol=5 * sd)
    assert (rolled + off >= -1e-12).all()  # a wheel that stands still does not turn backwards
    assert np.abs(off).max() <= 0.4  # no counter takes this for a jump
    assert (off == 0).mean() > 0.5
    np.testing.assert_array_equal(slipped(rolled, way, t, 0.0, np.random.default_rng(5)), rolled)


def test_slip_is_beyond_the_stated_noise() -> None:
    t = TICK * np.arange(3001.0)
    frames = np.arange(0, 60, 0.2)
    driven = drive(LOOP, 0.4, t)
    true = between(*(drive(LOOP, 0.4, edges)[0] for edges in (frames[:-1], frames[1:])))
    worst: list[float] = []
    for rate in (0.0, 0.5):
        ticks = count(*driven, t, ENCODER, np.random.default_rng(4), rate)
        factors = [ENCODER.odometry(*readings(ticks, a, b)) for a, b in pairwise(frames)]
        miss = wrap(np.array([f.delta[2] for f in factors]) - true[:, 2])
        worst.append(float(np.abs(miss / np.sqrt([f.cov[2, 2] for f in factors])).max()))
    assert worst[0] < 4.5
    assert worst[1] > 4.5


def test_narrow_counters_wrap_and_come_back() -> None:
    t = TICK * np.arange(1501.0)
    ticks = count(*drive(LOOP, 0.4, t), t, ENCODER, np.random.default_rng(4))
    narrow = np.mod(ticks.counts, 2.0**16)
    assert np.diff(narrow, axis=0).min() < -60_000
    np.testing.assert_array_equal(unwrap(narrow, 16), ticks.counts)


@pytest.mark.parametrize("camera", first_quick(["fisheye", "wide", "tilted"]))
def test_a_hard_drive_is_still_a_log(camera: str) -> None:
    """Every disturbance at once, through every lens."""
    sight: Any = {"camera": camera, "exposure": 0.004, "gain_drift": 0.2, "shadow": 0.3, "occlusion": 0.3}
    options = Options(seconds=1.5, frame_rate=2.0, boxes=4, slip=0.2, counts_per_metre=1000.0, **sight)
    log, truth = aruco_room(options, np.random.default_rng(3))
    assert len(log) == 4
    assert len(log.ids) > 3
    default = record(Options(seconds=1.5, frame_rate=2.0), np.random.default_rng(3))[1]
    np.testing.assert_array_equal(truth.poses, default.poses)
    assert log.notes["encoder"]["left"] == 1e-3
    assert np.abs(off(Dataset(log, truth))[:, 0]).max() < 0.3


def test_options_are_checked() -> None:
    rng, slow = np.random.default_rng(0), Options(exposure=0.05, frame_rate=30.0)
    refused(r"option exposure=0\.05: expected at most .* 0\.03333 s at frame_rate=30", record, slow, rng)
    for given, said in ((("camera", "none"), "pinhole, wide, tilted, fisheye"), (("boxes", "9"), "from 0 to 8")):
        refused(said, read_options, Options, [given], "dataset aruco-room")


def test_a_constant_of_the_other_noise_is_refused() -> None:
    said = "found option k_bearing=0.05 beside noise=propagated, expected it beside noise=proportional"
    refused(said, record, Options(k_bearing=0.05), np.random.default_rng(0))


def test_a_marker_that_cannot_be_read_is_sighted_without_an_id_as_well_as_the_others(short: Dataset) -> None:
    made = aruco_room(Options(seconds=2.0, unreadable=0.3), np.random.default_rng(1))
    unread = made.log.ids == UNKNOWN
    assert unread.any()
    assert (~unread).any()
    assert len(made.log.ids) > 0.9 * len(short.log.ids)
    # Each is one of those in view, at its place, and none of those that are read.
    assigned = made.truth.assigned
    assert not set(assigned[unread].tolist()) & {UNKNOWN, *made.log.ids[~unread].tolist()}
    in_sd = off(Dataset(replace(made.log, ids=assigned), made.truth)) / np.sqrt(np.einsum("kii->ki", made.log.z_cov))
    assert (np.sqrt((in_sd[unread] ** 2).mean(axis=0)) < 2).all()
    both = {(k, name): z for k, name, z in zip(short.log.sighting_step, short.log.ids, short.log.z[:, 0], strict=True)}
    found = zip(made.log.sighting_step[~unread], made.log.ids[~unread], made.log.z[~unread, 0], strict=True)
    assert np.median([abs(both[k, name] - z) for k, name, z in found if (k, name) in both]) < 1e-3
    np.testing.assert_array_equal(made.log.delta, short.log.delta)
    check(made.log, "aruco-room")


def test_what_has_no_id_has_no_wrong_one() -> None:
    both = Options(seconds=2.0, unreadable=0.5, outliers=0.1)
    refused("unreadable=0.5 and outliers=0.1, expected one of them", aruco_room, both, np.random.default_rng(1))

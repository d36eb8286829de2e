"""One log of markers and scans: every reading once, on one clock."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import refused
from several_drives import Driven, driven, true_poses
from slamduel.backends.keeping.smoother import build as smoother
from slamduel.bench.measure.nees import nees
from slamduel.core.factors import Log
from slamduel.core.se2 import act, between
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.several import log as several_log
from slamduel.frontend.several.counted_once import check_counted_once
from slamduel.frontend.several.log import Scanned, Several, build, joined
from slamduel.frontend.wheels.track import Track, TrackNoise
from tiers import first_quick

DRIVES = range(16)
BAND = 0.57, 0.91
"""Of the mean NEES of these drives after their first 10 steps: 0.74, and four standard errors of 0.043, by the spread
of the drives, to either side. The wheels' floors at each step are cautious.
"""


def test_steps_are_those_of_frames_and_scans() -> None:
    made = driven(0)
    log, seen, alone = made.log, made.seen, made.alone
    np.testing.assert_array_equal(log.t, np.union1d(seen.t, alone.t))
    assert len(log) == len(seen) + len(alone)  # the scanner is not triggered with the camera
    np.testing.assert_array_equal(log.t[log.sighting_step], seen.t[seen.sighting_step])
    for column in ("ids", "z", "z_cov"):
        np.testing.assert_array_equal(getattr(log, column), getattr(seen, column))
    assert len(log.loop_to) == len(made.motions.at) + len(alone.loop_to)
    pairs = set(zip(log.t[log.loop_step], log.t[log.loop_to], strict=True))
    m = made.motions
    assert pairs >= set(zip(alone.t[m.at], alone.t[m.to], strict=True))
    for k in range(1, len(log)):
        ours = made.several.frames.motion.odometry(log.t[k - 1], log.t[k])
        np.testing.assert_array_equal(log.delta[k], ours.delta)
        np.testing.assert_array_equal(log.delta_cov[k], ours.cov)


def scans_of(made: Driven) -> LaserRecording:
    assert made.several.scans is not None
    return made.several.scans


def test_a_scan_at_a_frames_time_is_at_its_step() -> None:
    made = driven(0)
    later = made.alone.t[3]
    seen = replace(made.seen, t=np.where(np.arange(len(made.seen)) == 4, later + 4e-7, made.seen.t))
    assert (np.diff(seen.t) > 0).all()
    log = joined(made.several, seen, Scanned(scans_of(made), made.alone, made.front_end, made.motions)).log
    assert later + 4e-7 in log.t
    assert later not in log.t
    assert len(log) == len(seen) + len(made.alone) - 1


def test_scans_lie_where_the_front_end_has_them() -> None:
    """The points of all scans along the true path are on the walls of the room, 6 m by 5 m."""
    made = driven(0)
    scans, path = made.log.scans, true_poses(made.log.t)
    assert scans is not None
    assert len(scans.at.step) > 50
    poses = scans.at.along(path)
    for k in range(0, len(poses), 9):
        x, y = act(poses[k], scans.points(k)).T
        off = np.minimum(np.abs(np.abs(x) - 3.0), np.abs(np.abs(y) - 2.5))
        assert np.median(off) < 0.04


def mean_nees(log: Log) -> float:
    """NEES, over its degrees of freedom, of the smoother's poses at their own steps."""
    backend = smoother.make(log.prior, smoother.options(), np.random.default_rng(0))
    poses, covs = list[np.ndarray](), list[np.ndarray]()
    for step in log:
        pose = backend.step(step)
        cov = backend.belief().cov
        assert pose is not None
        assert cov is not None
        poses.append(pose)
        covs.append(cov)
    return float(nees(np.array(poses), np.array(covs), true_poses(log.t))[10:].mean() / 3)


def doubled(log: Log, sensor: str) -> Log:
    """The log with each measurement of a sensor twice: half the covariance."""
    if sensor == "nothing":
        return log
    columns = {"markers": "z_cov", "scans": "loop_cov", "wheels": "delta_cov"}
    return replace(log, **{columns[sensor]: getattr(log, columns[sensor]) / 2})


def of_all(sensor: str) -> np.ndarray:
    return np.array([mean_nees(doubled(driven(seed).log, sensor)) for seed in DRIVES])


@pytest.mark.slow
def test_counted_once_nees_is_in_its_band_and_doubled_out_of_it() -> None:
    """Each sensor counted twice is told on every drive, by the ratio of its NEES to that of the same drive as it is.

    How hard a drive is cancels in it. Measured, as geometric means: 1.41 for markers, 1.16 for scans, 1.48 for wheels.
    """
    once, low, high = of_all("nothing"), *BAND
    assert low < once.mean() < high
    for sensor in ("markers", "scans", "wheels"):
        twice = of_all(sensor)
        more = np.log(twice / once)
        assert (more > 0).all(), sensor
        assert more.mean() > 5 * more.std(ddof=1) / np.sqrt(len(more)), sensor
        if sensor != "scans":  # of these so much is known here that half their covariance is within the band
            assert twice.mean() > high, sensor


@pytest.mark.parametrize("sensor", ["markers", "scans", "wheels"])
def test_a_doubled_sensor_is_overconfident(sensor: str) -> None:
    log = driven(0).log
    assert mean_nees(doubled(log, sensor)) > 1.05 * mean_nees(log)


def as_track(made: Driven, noise: float) -> Track:
    """Odometry from the path of the laser's front end, with an error of its own."""
    path = made.front_end.path + noise * np.random.default_rng(1).standard_normal(made.front_end.path.shape)
    return Track(np.array(made.front_end.t), path, TrackNoise(), max_speed=10.0)


@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_odometry_made_of_the_scans_is_refused(seed: int) -> None:
    made = driven(seed)
    words = r"drive: motions by odometry differ from those that the scans tell by 0\.\d+ of the scans' own noise"
    refused(words, check_counted_once, "drive", as_track(made, 0.0), made.motions, made.alone.t)
    check_counted_once("drive", made.several.frames.motion, made.motions, made.alone.t)
    check_counted_once("drive", as_track(made, 0.01), made.motions, made.alone.t)


def test_other_clocks_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    made = driven(0)
    monkeypatch.setattr(several_log, "build_frames", lambda *_: made.seen)
    scans = replace(scans_of(made), t=scans_of(made).t + 1000)
    words = r"frames are from 0\.0 to 30\.0 s, scans from 1000\.05 to 10.* s, expected both at one time, by one clock"
    refused(words, build, Several(made.several.frames, scans, made.several.settings))


def test_a_part_is_the_beginning_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    made = driven(0)
    monkeypatch.setattr(several_log, "build_frames", lambda *_: made.seen.head(11))
    log = build(made.several, until_last_frame=True).log
    assert log.t[-1] == 10.0
    n = len(log)
    for column in ("t", "delta", "delta_cov"):
        np.testing.assert_array_equal(getattr(log, column), getattr(made.log, column)[:n])
    rows = made.log.loop_step < n
    np.testing.assert_array_equal(log.loop_delta, made.log.loop_delta[rows])
    np.testing.assert_allclose(between(log.loop_delta, made.log.loop_delta[rows]), 0, atol=1e-12)

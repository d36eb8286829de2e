"""The front end on rendered drives: its log, its refusals, and what backends make of it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from depth_drives import drive
from refusals import refused
from slamduel.backends.registry import find
from slamduel.bench.front_ends.depth_timed import held
from slamduel.core.factors import REMARKS, Log, Truth
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.worlds.depth_room import Drive
from slamduel.frontend.depth.log import build_log, log_of, looked_at
from slamduel.frontend.depth.recording import DepthFrame, DepthRecording
from slamduel.frontend.depth.settings import Settings

LOOPS = Settings(landmarks=False, loops=True)
VISUAL = Settings(landmarks=False, odometry="visual")


def short() -> DepthRecording:
    return drive(1, Drive(), 16)[0]


def poses_at(log: Log, truth: Truth) -> Array:
    return truth.poses[np.searchsorted(truth.t, log.t)]


def errors(log: Log, truth: Truth) -> tuple[Array, Array]:
    """(n - 1, 3) of the steps' motions, and (n - 1,) their squared Mahalanobis distances."""
    poses = poses_at(log, truth)
    e = log.delta[1:] - between(poses[:-1], poses[1:])
    e[:, 2] = wrap(e[:, 2])
    return e, np.einsum("ni,nij,nj->n", e, np.linalg.inv(log.delta_cov[1:]), e)


def test_a_step_begins_where_the_wheels_have_moved_enough() -> None:
    recording = short()
    log = build_log(recording, Settings(step=0.2, turn=0.2))
    counts = log.notes["depth"]["counts"]
    assert counts["frames"] == 16
    assert counts["frames looked at"] == len(log) < 16
    times = [frame.seconds for frame in recording.frames]
    at = [times.index(t) for t in log.t]
    for first, second in pairwise(at):
        motion = recording.motion.odometry(times[first], times[second])
        k = at.index(second)
        np.testing.assert_array_equal(log.delta[k], motion.delta)
        np.testing.assert_array_equal(log.delta_cov[k], motion.cov)
        for j in range(first + 1, second):  # none of those between had moved enough
            delta = recording.motion.odometry(times[first], times[j]).delta
            assert np.hypot(*delta[:2]) < 0.2
            assert abs(delta[2]) < 0.2


def test_a_log_is_the_same_each_time_and_tells_what_was_done() -> None:
    one, other = build_log(short(), Settings()), build_log(short(), Settings())
    assert one.digest == other.digest
    assert len(one.ids) > 5 * len(one) / 2
    told = one.notes["depth"]
    assert told["settings"]["features"] == "orb"
    assert told["counts"]["frames without a floor"] == 0
    assert told["counts"]["pairs registered"] > 0
    assert one.notes["camera"]["width"] == 640


def test_the_points_of_frames_are_not_in_memory() -> None:
    """Beside the sightings, a step is a pose and covariances; a place keeps what loops are searched by."""
    recording = short()
    front_end = looked_at(recording, Settings())
    log = log_of(recording, front_end)
    points = log.clouds.points.nbytes + log.clouds.colours.nbytes
    assert held(front_end.steps) < 1000 * len(log) < points / 10
    assert front_end.search.places
    assert not any(len(place.cloud.points) for place in front_end.search.places)


def test_landmarks_lie_where_they_are_seen_from_any_step() -> None:
    recording, _, truth = drive(1, Drive(), 16)
    log = build_log(recording, Settings())
    at = poses_at(log, truth)[np.repeat(np.arange(len(log)), np.diff(log.sighting_first))]
    bearing = log.z[:, 1] + at[:, 2]
    xy = at[:, :2] + log.z[:, :1] * np.column_stack((np.cos(bearing), np.sin(bearing)))
    for landmark in np.unique(log.ids):
        mine = xy[log.ids == landmark]
        assert len(mine) >= 4 or len(np.flatnonzero(log.ids == landmark)) <= 4
        # ranges err by 3 cm at 3 m, and a wrong id lies half a metre off
        assert np.hypot(*(mine - np.median(mine, axis=0)).T).max() < 0.2


def test_options_that_use_a_feature_twice_are_refused() -> None:
    refused(r"landmarks and loops.*counted twice", Settings, loops=True)
    refused(r"landmarks=true with odometry=visual.*counted twice", Settings, odometry="visual")
    refused(r"near and far: found 5 and 4\.5", Settings, near=5.0)


def test_a_recording_without_wheels_needs_visual_odometry() -> None:
    refused("but no readings of wheels; expected odometry=visual", build_log, replace(short(), motion=None), Settings())


def test_frames_out_of_order_of_another_size_or_too_few_are_refused() -> None:
    recording, shown, _ = drive(1, Drive(), 16)
    frames = list(shown)
    refused(r"frame 1 is at .* s, expected later than", build_log, replace(recording, frames=frames[1::-1]), Settings())
    small = frames[0]._replace(depth=frames[0].depth[::2, ::2])
    refused("found a depth image of 320 x 240 pixels,", build_log, replace(recording, frames=[small]), Settings())
    refused("found 2 frames and 1 steps, expected", build_log, replace(recording, frames=frames[:2]), Settings())
    refused(r"found 0 frames and 0 steps", build_log, replace(recording, frames=[]), Settings())


def test_frames_outside_the_time_of_the_wheels_are_counted() -> None:
    recording = short()
    early = [frame._replace(seconds=frame.seconds - 100) for frame in recording.frames]
    log = build_log(replace(recording, frames=[*early[:3], *recording.frames]), Settings())
    assert log.notes["depth"]["counts"]["frames without odometry"] == 3
    assert any("3 of 19 frames" in remark for remark in log.notes[REMARKS])
    assert log.t[0] == early[0].seconds + 100


@pytest.mark.parametrize("wheels", [True, False])
def test_visual_odometry_errs_as_stated(wheels: bool) -> None:
    recording, _, truth = drive(1, Drive(), 16)
    if not wheels:
        recording = replace(recording, motion=None)
    log = build_log(recording, VISUAL)
    assert len(log.ids) == len(log.loop_to) == 0
    e, squared = errors(log, truth)
    assert squared.max() < 25
    assert np.abs(e[:, :2]).max() < 0.015
    assert log.t[-1] == truth.t[-1]  # the last frame is a step


def blank(t: float) -> DepthFrame:
    return DepthFrame(t, np.full((480, 640), 90, np.uint8), np.zeros((480, 640), np.float32))


def test_frames_that_show_nothing_leave_a_motion_unknown_and_the_drive_goes_on() -> None:
    recording, shown, truth = drive(1, Drive(), 16)
    frames = list(shown)
    for k in (8, 9):
        frames[k] = blank(frames[k].seconds)
    log = build_log(replace(recording, frames=frames, motion=None), VISUAL)
    counts = log.notes["depth"]["counts"]
    assert counts["steps without a motion"] >= 2
    assert counts["frames without a floor"] == 2
    blind = np.sqrt(log.delta_cov[:, 0, 0]) > 0.2
    assert blind.sum() == counts["steps without a motion"]
    assert errors(log, truth)[1].max() < 25


def test_where_frames_show_nothing_the_wheels_tell_the_motion() -> None:
    recording, shown, _ = drive(1, Drive(), 16)
    frames = list(shown)
    frames[8] = blank(frames[8].seconds)
    log = build_log(replace(recording, frames=frames), VISUAL)
    counts = log.notes["depth"]["counts"]
    assert "steps without a motion" not in counts
    assert counts["steps by the wheels alone"] == 2
    k = int(np.flatnonzero(log.t == frames[8].seconds)[0])
    for step in (k, k + 1):
        wheels = recording.motion.odometry(log.t[step - 1], log.t[step])
        np.testing.assert_array_equal(log.delta[step], wheels.delta)
        np.testing.assert_array_equal(log.delta_cov[step], wheels.cov)


LAP = 175
"""Frames of a lap and a quarter."""


@pytest.mark.slow
@pytest.mark.parametrize("alike", [False, True])
def test_no_loop_is_wrong_and_nearly_all_places_are_found_again(alike: bool) -> None:
    recording, _, truth = drive(3, Drive(laps=1.25, alike=alike), LAP)
    front_end = looked_at(recording, LOOPS)
    log = log_of(recording, front_end)
    poses = poses_at(log, truth)
    at = np.repeat(np.arange(len(log)), np.diff(log.loop_first))
    e = log.loop_delta - between(poses[log.loop_to], poses[at])
    e[:, 2] = wrap(e[:, 2])
    squared = np.einsum("ni,nij,nj->n", e, np.linalg.inv(log.loop_cov), e)
    assert len(e) >= 20
    assert squared.max() < 45  # five standard deviations of three
    assert np.hypot(e[:, 0], e[:, 1]).max() < 0.15
    assert np.abs(e[:, 2]).max() < np.radians(3)
    near = set[int]()
    for place in front_end.search.places:
        off = between(poses[place.step], poses)
        close = (np.hypot(off[:, 0], off[:, 1]) < 0.5) & (np.abs(off[:, 2]) < np.radians(20))
        near |= set(np.flatnonzero(close & (log.t - place.t > LOOPS.loop_after)).tolist())
    assert len(near) >= 10
    assert len(near & set(at.tolist())) >= 0.9 * len(near)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["ekf", "isam2"])
def test_backends_are_close_and_consistent_on_landmarks(backend: str) -> None:
    recording, _, truth = drive(3, Drive(laps=1.25), LAP)
    log = build_log(recording, Settings())
    poses, builder = poses_at(log, truth), find(backend)
    estimator = builder.make(log.prior, builder.options(), np.random.default_rng(0))
    squared, off = np.empty(len(log)), np.empty((len(log), 3))
    for k, step in enumerate(log):
        estimator.step(step)
        belief = estimator.belief()
        off[k] = belief.pose - poses[k]
        off[k, 2] = wrap(off[k, 2])
        assert belief.cov is not None
        squared[k] = off[k] @ np.linalg.solve(belief.cov, off[k]) / 3
    assert np.sqrt((off[:, :2] ** 2).sum(axis=1).mean()) < 0.025
    # neighbours' errors are alike, so that the mean of a drive is that of a few draws
    assert squared[1:].mean() < 2.5

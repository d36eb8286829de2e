"""Joins the sightings of cameras and the motions and loop closures by a laser scanner: one log on one clock.

What carries what, so that no reading counts twice:

- the odometry is that of wheels, counters or commands, as it is without a scanner; without any it is a motion that
  nothing measured;
- sightings are those of the cameras;
- the scans are in relative poses alone: of a step to an earlier one that saw the same walls, with what the wheels told
  the matcher taken out (`scan_motions`), and loop closures to places of long ago;
- a gyro's turns are a factor of their own.

Steps are those of the frames and those of the laser's front end, each at its own time.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.beside import Scans
from ...core.check import check
from ...core.errors import InputError
from ...core.factors import REMARKS, Log
from ...core.relations import Anchors
from ...core.se2 import Array, Ints, between, compose, inverse
from ..laser.front_end import FrontEnd
from ..laser.log import log_of, scans_of
from ..laser.recording import LaserRecording, matched
from ..laser.settings import Settings
from ..markers.pipeline import FrameSightings, Recording
from ..markers.pipeline import build_log as build_frames
from ..wheels.motion import Motion
from .counted_once import check_counted_once
from .scan_motions import Motions, scan_motions

SAME = 1e-6
"""s, at most, between a frame and a scan that are one step."""


class Several(NamedTuple):
    """A recording of cameras and a laser scanner; the odometry of `scans` is that of the same motion, or none."""

    frames: Recording
    scans: LaserRecording
    settings: Settings  # of the laser's front end


class Built(NamedTuple):
    """A log of several sensors, and how its laser's front end came to its part."""

    log: Log
    scans: LaserRecording  # those that were taken
    path: Array  # (n, 3) the front end's own estimate of the log's steps, by scans and wheels


def build_log(recording: Several, observe: Callable[[FrameSightings], None] | None = None) -> Log:
    """Makes the log of all sensors; InputError as of the front ends for one of them, and for odometry made of scans."""
    return build(recording, observe).log


def build(
    recording: Several,
    observe: Callable[[FrameSightings], None] | None = None,
    *,
    until_last_frame: bool = False,
) -> Built:
    """Makes the log of all sensors; `observe` is called with each frame's sightings.

    `until_last_frame`: the scans after it are left out.
    """
    seen, scans = build_frames(recording.frames, observe), recording.scans
    if scans.t[0] > seen.t[-1] or scans.t[-1] < seen.t[0]:
        raise InputError(
            f"{seen.name}: frames are from {seen.t[0]!s} to {seen.t[-1]!s} s, scans from {scans.t[0]!s} to "
            f"{scans.t[-1]!s} s, expected both at one time, by one clock."
        )
    if until_last_frame:
        scans = scans.taken(scans.t <= seen.t[-1])
    recording = recording._replace(scans=scans)
    front_end = matched(scans, recording.settings)
    alone = log_of(scans, front_end)
    motions = scan_motions(front_end)
    check_counted_once(recording.frames.name, recording.frames.motion, motions, alone.t)
    return joined(recording, seen, alone, front_end, motions)


def joined(recording: Several, seen: Log, alone: Log, front_end: FrontEnd, motions: Motions) -> Built:
    """Joins the log of the frames and the steps of the front end, whose own log is `alone`."""
    t, frame, scan = _steps(seen.t, alone.t)
    delta, cov = _odometry(recording.frames.motion, t)
    at = np.concatenate((scan[motions.at], scan[alone.loop_step]))
    to = np.concatenate((scan[motions.to], scan[alone.loop_to]))
    order = np.lexsort((to, at))
    remarks = [*seen.remarks, *(one for one in alone.remarks if one not in seen.remarks)]
    laser = {**alone.notes["laser"], "motions": len(motions.at), "loops": len(alone.loop_to)}
    log = Log.from_arrays(
        seen.name,
        seen.prior,
        t,
        delta,
        cov,
        frame[seen.sighting_step],
        seen.ids,
        seen.z,
        seen.z_cov,
        loop_step=at[order],
        loop_to=to[order],
        loop_delta=np.concatenate((motions.delta, alone.loop_delta))[order],
        loop_cov=np.concatenate((motions.cov, alone.loop_cov))[order],
        notes={**seen.notes, "laser": laser, **({REMARKS: remarks} if remarks else {})},
    )
    check(log, seen.name)
    path = _along(front_end, front_end.path, t, delta)
    scans = scans_of(recording.scans, front_end)
    estimate = _along(front_end, _bent(front_end), t, delta)
    found = replace(log, scans=_placed(scans, path, front_end, t, scan))
    return Built(found, recording.scans, estimate)


def _steps(frames: Array, scans: Array) -> tuple[Array, Ints, Ints]:
    """The times (n,) of both, and the rows in them of each: a scan within SAME of a frame is at its time."""
    near = np.clip(np.searchsorted(frames, scans), 1, len(frames) - 1) if len(frames) > 1 else np.zeros(len(scans), int)
    near = np.where(np.abs(frames[near - 1] - scans) < np.abs(frames[near] - scans), near - 1, near)
    own = np.where(np.abs(frames[near] - scans) <= SAME, frames[near], scans)
    t = np.union1d(frames, own)
    return t, np.searchsorted(t, frames), np.searchsorted(t, own)


def _odometry(motion: Motion, t: Array) -> tuple[Array, Array]:
    """The motions (n, 3) between the times `t` (n,), s, with their covariances; NaN in row 0."""
    delta, cov = np.full((len(t), 3), np.nan), np.full((len(t), 3, 3), np.nan)
    for k in range(1, len(t)):
        delta[k], cov[k] = motion.odometry(float(t[k - 1]), float(t[k]))
    return delta, cov


def _bent(front_end: FrontEnd) -> Array:
    """The path (n, 3) of every scan, moved along with the steps to where the front end's pose graph has these."""
    path, steps = front_end.path, np.array([step.scan for step in front_end.steps])
    step = np.searchsorted(steps, np.arange(len(path)), side="right") - 1
    return compose(front_end.estimate[step], between(path[steps[step]], path))


def _along(front_end: FrontEnd, path: Array, t: Array, delta: Array) -> Array:
    """The poses (n, 3) at `t` (n,), s, on a `path` of the scans; before and after these by the odometry `delta`."""
    times = np.array(front_end.t)
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    share = np.clip((t - times[after - 1]) / (times[after] - times[after - 1]), 0.0, 1.0)
    poses = compose(path[after - 1], between(path[after - 1], path[after]) * share[:, None])
    inside = np.flatnonzero((times[0] - SAME <= t) & (t <= times[-1] + SAME))
    for k in range(int(inside[-1]) + 1, len(t)):
        poses[k] = compose(poses[k - 1], delta[k])
    for k in range(int(inside[0]) - 1, -1, -1):
        poses[k] = compose(poses[k + 1], inverse(delta[k + 1]))
    return poses


def _placed(scans: Scans, path: Array, front_end: FrontEnd, t: Array, scan: Ints) -> Scans:
    """The scans beside the steps at `t` (n,), s, whose poses (n, 3) on the matcher's path are `path`."""
    own, at = front_end.path[[step.scan for step in front_end.steps]], scans.at
    poses, start = compose(own[at.step], at.since), t[scan[at.step]]
    end = t[scan[np.minimum(at.step + 1, len(scan) - 1)]]
    times = start + at.share * np.where(end > start, end - start, 1.0)
    step = np.searchsorted(t, times + SAME, side="right") - 1
    until = np.minimum(step + 1, len(t) - 1)
    share = np.clip((times - t[step]) / np.where(until > step, t[until] - t[step], 1.0), 0.0, 1.0)
    return scans._replace(at=Anchors(step, between(path[step], poses), between(path[until], poses), share))

"""Joins the sightings of cameras with what a laser scanner and a depth camera tell of the motion: one log on one clock.

What carries what, so that no reading counts twice:

- the odometry is that of wheels, counters or commands, as it is without a scanner; without any it is a motion that
  nothing measured;
- sightings are those of the cameras, if markers are wanted at all;
- the scans are in relative poses alone: of a step to an earlier one that saw the same walls, with what the wheels told
  the matcher taken out (`scan_motions`), and loop closures to places of long ago;
- the depth camera's frames are in relative poses, too: of a step to the one before, by the features of both, and loop
  closures. Features are no landmarks here, whose ids are those of the markers. Wheels only check these motions;
- a gyro's turns are a factor of their own.

Steps are those of the frames and those of the other front ends, each at its own time.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from ...core.beside import Scans
from ...core.errors import InputError
from ...core.factors import REMARKS, Log
from ...core.factors.check import check
from ...core.relations import Anchors
from ...core.se2 import Array, Ints, between, compose, inverse
from ..depth.front_end import FrontEnd as DepthFrontEnd
from ..depth.log import log_of as depth_log_of
from ..depth.log import looked_at
from ..depth.recording import DepthFrame, DepthRecording
from ..depth.settings import Settings as DepthSettings
from ..inertial.imu import Imu
from ..laser.front_end import FrontEnd
from ..laser.log import log_of, scans_of
from ..laser.recording import LaserRecording, matched
from ..laser.settings import Settings
from ..markers.pipeline import FrameSightings, Recording
from ..markers.pipeline import build_log as build_frames
from ..wheels.motion import Motion
from .counted_once import check_counted_once
from .delays import Turned, delay, remark, turned, turning
from .scan_motions import Motions, scan_motions

SAME = 1e-6
"""s, at most, between a frame and a scan that are one step."""


class Several(NamedTuple):
    """A recording of cameras, with a laser scanner, a depth camera or both; all have the same motion, or none."""

    frames: Recording
    scans: LaserRecording | None = None
    settings: Settings = Settings()  # of the laser's front end
    depth: DepthRecording | None = None
    depth_settings: DepthSettings = DepthSettings(landmarks=False, loops=True)
    imu: Imu | None = None  # whose gyro tells delays
    markers: bool = True  # False: the frames are not looked at, and there are no sightings


class Scanned(NamedTuple):
    """The scans as their front end has them."""

    scans: LaserRecording  # those that were taken
    alone: Log  # of them
    front_end: FrontEnd
    motions: Motions


class Related(NamedTuple):
    """Relative poses between the steps of one sensor."""

    t: Array  # (n,) s, of its steps
    at: Ints  # (m,)
    to: Ints  # (m,) earlier than `at`
    delta: Array  # (m, 3)
    cov: Array  # (m, 3, 3)


class Built(NamedTuple):
    """A log of several sensors, and how its laser's front end came to its part."""

    log: Log
    scans: LaserRecording | None  # those that were taken
    path: Array  # (n, 3) the estimate of the log's steps by the laser's front end, or else by the wheels


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
    seen = build_frames(recording.frames, observe) if recording.markers else _unseen(recording)
    name, motion = recording.frames.name, recording.frames.motion
    end = float(seen.t[-1]) if until_last_frame else np.inf
    scanned = looked = None
    if recording.scans is not None:
        scans = recording.scans
        _check_clock(seen, scans.t, "scans")
        scans = scans.taken(scans.t <= end) if until_last_frame else scans
        front_end = matched(scans, recording.settings)
        scanned = Scanned(scans, log_of(scans, front_end), front_end, scan_motions(front_end))
        check_counted_once(name, motion, scanned.motions, scanned.alone.t)
    if recording.depth is not None:
        depth = recording.depth
        if until_last_frame:
            depth = replace(depth, frames=_Until(depth.frames, end))
        looked = looked_at(depth, recording.depth_settings)
        _check_clock(seen, np.array(looked.t), "depth frames")
        looked = depth_log_of(depth, looked), related_of(looked)
    return joined(recording, seen, scanned, looked)


def _unseen(recording: Several) -> Log:
    """A log of the motion alone, from the first scan to the last."""
    frames, scans = recording.frames, recording.scans
    assert scans is not None
    t, nothing = scans.t[[0, -1]], np.zeros(0, np.int64)
    delta, cov = _odometry(frames.motion, t)
    remarks = {REMARKS: list(frames.remarks)} if frames.remarks else {}
    return Log.from_arrays(
        frames.name, frames.prior, t, delta, cov, nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2, 2)),
        notes={**frames.notes, **frames.motion.settings, **remarks},
    )  # fmt: skip


def joined(recording: Several, seen: Log, scanned: Scanned | None, looked: tuple[Log, Related] | None = None) -> Built:
    """Joins the log of the frames and the steps of the other front ends; `looked` is the depth camera's own log."""
    parts, told, remarks, notes = list[Related](), list[Turned](), list[str](), dict[str, Any]()
    if scanned is not None:
        alone, motions = scanned.alone, scanned.motions
        related = Related(
            alone.t,
            np.concatenate((motions.at, alone.loop_step)),
            np.concatenate((motions.to, alone.loop_to)),
            np.concatenate((motions.delta, alone.loop_delta)),
            np.concatenate((motions.cov, alone.loop_cov)),
        )
        parts.append(related)
        told.append(turned(alone.t, motions.at, motions.to, motions.delta[:, 2], motions.cov[:, 2, 2]))
        notes["laser"] = {**alone.notes["laser"], "motions": len(motions.at), "loops": len(alone.loop_to)}
        remarks += alone.remarks
    if looked is not None:
        alone, related = looked
        parts.append(related)
        n = len(related.at) - len(alone.loop_to)
        told.append(turned(related.t, related.at[:n], related.to[:n], related.delta[:n, 2], related.cov[:n, 2, 2]))
        loops = len(alone.loop_to)
        notes["depth"] = {**alone.notes["depth"], "steps": len(alone), "motions": len(related.at) - loops}
        notes["depth"]["loops"] = {**alone.notes["depth"]["loops"], "in_log": loops}
        remarks += alone.remarks
    known = turning(recording.frames.motion, recording.imu)
    for sensor, one in zip(notes, told, strict=True):
        if known is not None and (found := delay(known, one)) is not None:
            notes[sensor]["late"] = {"seconds": found.seconds, "sd": found.sd, "by": known.by}
            remarks += [remark(seen.name, sensor, known.by, found)] if found.odd else []
    t, rows = _steps(seen.t, [part.t for part in parts])
    delta, cov = _odometry(recording.frames.motion, t)
    at = np.concatenate([row[part.at] for row, part in zip(rows[1:], parts, strict=True)])
    to = np.concatenate([row[part.to] for row, part in zip(rows[1:], parts, strict=True)])
    order = np.lexsort((to, at))
    remarks = [*seen.remarks, *(one for one in dict.fromkeys(remarks) if one not in seen.remarks)]
    log = Log.from_arrays(
        seen.name,
        seen.prior,
        t,
        delta,
        cov,
        rows[0][seen.sighting_step],
        seen.ids,
        seen.z,
        seen.z_cov,
        loop_step=at[order],
        loop_to=to[order],
        loop_delta=np.concatenate([part.delta for part in parts])[order],
        loop_cov=np.concatenate([part.cov for part in parts])[order],
        notes={**seen.notes, **notes, **({REMARKS: remarks} if remarks else {})},
    )
    check(log, seen.name)
    if scanned is None:
        return Built(log, None, log.dead_reckoned())
    front_end = scanned.front_end
    path = _along(front_end, front_end.path, t, delta)
    scans = scans_of(scanned.scans, front_end)
    estimate = _along(front_end, _bent(front_end), t, delta)
    found = replace(log, scans=_placed(scans, path, front_end, t, rows[1]))
    return Built(found, scanned.scans, estimate)


def related_of(front_end: DepthFrontEnd) -> Related:
    """The motions between consecutive steps of a depth camera that its features tell, and its loop closures."""
    told = [*front_end.told, *front_end.loops]
    return Related(
        np.array([step.t for step in front_end.steps]),
        np.array([one.step for one in told], np.int64),
        np.array([one.to for one in told], np.int64),
        np.array([one.motion.delta for one in told]).reshape(-1, 3),
        np.array([one.motion.cov for one in told]).reshape(-1, 3, 3),
    )


def _check_clock(seen: Log, t: Array, noun: str) -> None:
    """Raises InputError where nothing of another sensor is at the time of the frames."""
    if t[0] > seen.t[-1] or t[-1] < seen.t[0]:
        raise InputError(
            f"{seen.name}: frames are from {seen.t[0]!s} to {seen.t[-1]!s} s, {noun} from {t[0]!s} to {t[-1]!s} s, "
            "expected both at one time, by one clock."
        )


@dataclass(frozen=True)
class _Until:
    """The frames up to a time."""

    frames: Iterable[DepthFrame]
    end: float  # s

    def __iter__(self) -> Iterator[DepthFrame]:
        return takewhile(lambda frame: frame.seconds <= self.end, self.frames)


def _steps(frames: Array, others: Sequence[Array]) -> tuple[Array, list[Ints]]:
    """The times (n,) of all, and the rows in them of each: what is within SAME of a frame is at its time."""
    own, all_t = [frames], frames
    for t in others:
        near = np.clip(np.searchsorted(all_t, t), 1, len(all_t) - 1) if len(all_t) > 1 else np.zeros(len(t), int)
        near = np.where(np.abs(all_t[near - 1] - t) < np.abs(all_t[near] - t), near - 1, near)
        own.append(np.where(np.abs(all_t[near] - t) <= SAME, all_t[near], t))
        all_t = np.union1d(all_t, own[-1])
    return all_t, [np.searchsorted(all_t, one) for one in own]


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

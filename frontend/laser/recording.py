"""A recording of laser scans with odometry, and the log that the front end makes of it."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..factors import Log, Prior
from ..laser_scans import Scans
from ..se2 import Array, between, compose, wrap
from .anchors import anchors
from .front_end import FrontEnd
from .scanner import Scanner
from .settings import Settings

APART, TURNED = 0.1, 0.1
"""m and rad between the scans that are kept beside a log."""

FARTHEST = 50.0
"""m between two scans; the map of the last metres could not hold more."""

LEFT_OUT = (
    "the map's error that matches with one submap share, the opposite errors of neighbouring steps, and a submap's "
    "bend: a step's covariance holds, those of long chains are cautious"
)


@dataclass(frozen=True, eq=False)
class LaserRecording:
    """Scans in the order of time."""

    name: str
    scanner: Scanner
    t: Array  # (n,) s, strictly increasing
    ranges: Array  # (n, b) m; NaN, infinite or beyond the scanner's limits where there is no return
    odometry: Array | None  # (n, 3) the wheels' pose at each scan; None without wheels
    prior: Prior
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])  # the source and what its reader has done


def jump(odometry: Array) -> tuple[int, float] | None:
    """The row of `odometry` (n, 3) farthest from the one before it and how far, m, if the front end cannot bear it."""
    way = np.hypot(*np.diff(odometry[:, :2], axis=0).T)
    at = int(way.argmax())
    return None if way[at] <= FARTHEST else (at + 1, float(way[at]))


def build_log(recording: LaserRecording, settings: Settings) -> Log:
    """Makes the log: a step every so often, with one odometry factor by scans and wheels, and loop closures.

    InputError for a recording without two steps.
    """
    return log_of(recording, matched(recording, settings))


def matched(
    recording: LaserRecording, settings: Settings, observe: Callable[[FrontEnd], None] | None = None
) -> FrontEnd:
    """Takes a front end through all scans; `observe` is called after every one."""
    front_end = FrontEnd(recording.scanner, settings, recording.odometry is not None)
    motions: Any = [None] * len(recording.t)
    if recording.odometry is not None:
        motions[1:] = between(recording.odometry[:-1], recording.odometry[1:])
    for t, motion, ranges in zip(recording.t.tolist(), motions, recording.ranges, strict=True):
        front_end.scan(t, motion, ranges)
        if observe is not None:
            observe(front_end)
    front_end.finish()
    return front_end


def log_of(recording: LaserRecording, front_end: FrontEnd) -> Log:
    """The steps and loops of a front end as a log; InputError without two steps."""
    steps, loops = front_end.steps, sorted(front_end.loops, key=lambda one: (one.step, one.to))
    if len(steps) < 2:
        way = 0.0 if not front_end.path else float(np.hypot(*front_end.path[-1][:2]))
        raise InputError(
            f"{recording.name}: the robot moved {way:.3g} m in {len(front_end.t)} scans, expected at least one step of "
            f"{front_end.settings.step:g} m."
        )
    nothing = np.zeros(0)
    log = Log.from_arrays(
        recording.name,
        recording.prior,
        t=np.array([step.t for step in steps]),
        delta=np.array([step.delta for step in steps]),
        delta_cov=np.array([step.cov for step in steps]),
        sighting_step=nothing.astype(int),
        ids=nothing.astype(int),
        z=np.zeros((0, 2)),
        z_cov=np.zeros((0, 2, 2)),
        loop_step=np.array([loop.step for loop in loops], np.int64),
        loop_to=np.array([loop.to for loop in loops], np.int64),
        loop_delta=np.array([loop.delta for loop in loops]).reshape(-1, 3),
        loop_cov=np.array([(loop.cov + loop.cov.T) / 2 for loop in loops]).reshape(-1, 3, 3),
        notes={
            **recording.notes,
            "laser": {
                "scans": len(front_end.t),
                "lost": front_end.lost,
                "relocated": front_end.found_again,
                "searched": front_end.tried,
                "turned_down": dict(front_end.turned_down),
                "confirmed": front_end.confirmed,
                "submaps": len(front_end.submaps),
                "wheels": front_end.wheels,
                "left_out": LEFT_OUT,
                "settings": asdict(front_end.settings),
            },
        },
    )
    return replace(log, scans=scans_of(recording, front_end))


def scans_of(recording: LaserRecording, front_end: FrontEnd) -> Scans:
    """The scans of a recording, one wherever the robot has moved by APART or turned by TURNED."""
    kept, last = [0], front_end.path[0]
    for k, pose in enumerate(front_end.path):
        if np.hypot(pose[0] - last[0], pose[1] - last[1]) > APART or abs(wrap(pose[2] - last[2])) > TURNED:
            kept.append(k)
            last = pose
    scanner = recording.scanner
    ranges = recording.ranges[kept].astype(np.float32)
    ranges[~((ranges > scanner.least) & (ranges < scanner.most))] = np.nan
    return Scans(anchors(front_end, recording.t[kept]).anchors, ranges, scanner.angles, scanner.pose)


def placed(recording: LaserRecording, front_end: FrontEnd) -> Array:
    """The front end's own estimate (n, 3) of every scan, from the prior's pose on."""
    path = anchors(front_end, recording.t).anchors.along(np.array(front_end.estimate))
    return compose(recording.prior.pose, between(path[0], path))

"""The log of a front end's steps: odometry factors with loop closures, or on a given map with places on it.

On a map, step 0 of the log is no scan but the map's frame: a pose on the map that is exact by definition, the mean of
the start. Step 1 is the first scan, as uncertain as the start is, and a match with the map is a loop closure to step 0.
Any backend that takes loop closures localises.
"""

from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from ...core.beside import Scans
from ...core.errors import InputError
from ...core.factors import REMARKS, Log, Prior
from ...core.se2 import Array, Ints, between, rotation, wrap
from ..pauses import longest_pause
from .anchors import anchors
from .front_end import FrontEnd
from .localising import Localiser
from .recording import LaserRecording, matched
from .settings import Settings

APART, TURNED = 0.1, 0.1  # m and rad between the scans that are kept beside a log

LEFT_OUT = (
    "the map's error that matches with one submap share, and the opposite errors of neighbouring steps, which have a "
    "match in common: covariances of steps and of loops hold, those of long chains are cautious"
)

EXACT = 1e-6  # m and rad; standard deviation of the map's frame
BEFORE = 0.1  # s from the map's frame to the first scan

ON_MAP = "found_at_step"
"""The note of a log that was localised on a map: the front end's step at which it was found."""


class Factors(NamedTuple):
    """The columns of a log of n steps and l loop closures."""

    prior: Prior
    t: Array  # (n,)
    delta: Array  # (n, 3)
    cov: Array  # (n, 3, 3)
    at: Ints  # (l,) the step of a loop closure
    to: Ints  # (l,)
    loop_delta: Array  # (l, 3)
    loop_cov: Array  # (l, 3, 3)
    remarks: list[str]


def build_log(recording: LaserRecording, settings: Settings) -> Log:
    """Makes the log: steps with odometry by scans and wheels, and loop closures; InputError without two steps."""
    return log_of(recording, matched(recording, settings))


def log_of(recording: LaserRecording, front_end: FrontEnd) -> Log:
    """The steps and loops of a front end as a log; InputError without two steps."""
    if len(front_end.steps) < 2:
        way = 0.0 if not front_end.t else float(np.hypot(*front_end.path[-1][:2]))
        raise InputError(
            f"{recording.name}: the robot moved {way:.3g} m in {len(front_end.t)} scans, expected at least one step of "
            f"{front_end.settings.step:g} m."
        )
    localiser, nothing = front_end.localiser, np.zeros(0)
    found = _with_loops(recording, front_end) if localiser is None else _on_map(recording, front_end, localiser)
    log = Log.from_arrays(
        recording.name,
        found.prior,
        t=found.t,
        delta=found.delta,
        delta_cov=found.cov,
        sighting_step=nothing.astype(int),
        ids=nothing.astype(int),
        z=np.zeros((0, 2)),
        z_cov=np.zeros((0, 2, 2)),
        loop_step=found.at,
        loop_to=found.to,
        loop_delta=found.loop_delta,
        loop_cov=found.loop_cov,
        notes={
            **recording.notes,
            **longest_pause(float(found.t[0]), float(found.t[-1]), recording.t),
            "laser": {
                "scans": len(front_end.t),
                "lost": front_end.tracker.lost,
                "relocated": front_end.tracker.found_again,
                "by_wheels": front_end.tracker.by_wheels,
                "doubted": front_end.tracker.doubted,
                "undecided": front_end.tracker.undecided,
                "searched": front_end.tried,
                "turned_down": dict(front_end.turned_down),
                "confirmed": front_end.confirmed,
                "submaps": front_end.finished.count,
                "wheels": front_end.wheels,
                "left_out": LEFT_OUT,
                "settings": {name: value for name, value in asdict(front_end.settings).items() if value is not None},
                **({} if localiser is None else _told(localiser)),
            },
            **({REMARKS: said} if (said := [*recording.notes.get(REMARKS, ()), *found.remarks]) else {}),
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
    at = anchors(front_end, recording.t[kept])
    ranges = recording.ranges[kept].astype(np.float32)[at.known]
    ranges[~((ranges > scanner.least) & (ranges < scanner.most))] = np.nan
    angles = scanner.angles
    if recording.fans is not None:
        angles = np.array([recording.angles(k) for k in kept])[at.known]
    return Scans(at.anchors.taken(at.known), ranges, angles, scanner.pose)


def first_scan(log: Log) -> int:
    """The log's first step that is a scan: not 0 where that is a map's frame."""
    return int(ON_MAP in log.notes.get("laser", {}))


def _with_loops(recording: LaserRecording, front_end: FrontEnd) -> Factors:
    steps, loops = front_end.steps, sorted(front_end.loops, key=lambda one: (one.step, one.to))
    at, to = (np.array([getattr(loop, name) for loop in loops], np.int64) for name in ("step", "to"))
    return Factors(
        recording.prior,
        np.array([step.t for step in steps]),
        np.array([step.delta for step in steps]),
        np.array([step.cov for step in steps]),
        at,
        to,
        np.array([loop.delta for loop in loops]).reshape(-1, 3),
        np.array([(loop.cov + loop.cov.T) / 2 for loop in loops]).reshape(-1, 3, 3),
        _doubts(front_end),
    )


def _doubts(front_end: FrontEnd) -> list[str]:
    """A remark on the places between which neither scans nor wheels decided."""
    count = front_end.tracker.undecided
    if not count:
        return []
    remark = f"{count} times two places explain the scans alike, and the wheels do not tell which it was: "
    return [f"{remark}the covariance of such a step has the distance between them"]


def _on_map(recording: LaserRecording, front_end: FrontEnd, localiser: Localiser) -> Factors:
    """The steps from the one on at which the robot was found on the map; InputError if none is on it."""
    first, fixes = localiser.first, localiser.fixes
    if first is None:
        why = ", ".join(f"{reason} ({count})" for reason, count in localiser.why.most_common()) or "the drive is short"
        raise InputError(
            f"{recording.name}: the robot was not found on the grid in {len(front_end.steps)} steps: {why}; expected "
            "a drive on it."
        )
    steps, remarks = front_end.steps[first:], _doubts(front_end)
    start, cov = recording.prior.pose, recording.prior.cov
    if recording.start == "unknown":  # the match that found it is the start, and no further factor
        start, cov, fixes = fixes[0].pose, fixes[0].cov, fixes[1:]
        way = float(np.hypot(*np.array([step.delta for step in front_end.steps[: first + 1]]).T[:2]).sum())
        remarks.append(f"the robot was found on the grid after {first} steps and {way:.3g} m: the log begins there")
    if localiser.missed == len(steps):
        raise InputError(
            f"{recording.name}: none of its {len(steps)} steps matches the grid, from a start at x {start[0]:.3g} m, "
            f"y {start[1]:.3g} m; expected a drive on it that begins there, or start=unknown."
        )
    if localiser.missed:
        remarks.append(f"{localiser.missed} of {len(steps)} steps do not match the grid")
    R = rotation(float(start[2]))
    delta, delta_cov = np.array([step.delta for step in steps]), np.array([step.cov for step in steps])
    delta[0], delta_cov[0] = 0.0, R.T @ cov @ R
    loop_cov = R.T @ np.array([fix.cov for fix in fixes]).reshape(-1, 3, 3) @ R
    return Factors(
        Prior(start, EXACT**2 * np.eye(3)),
        np.array([steps[0].t - BEFORE, *(step.t for step in steps)]),
        np.concatenate((np.zeros((1, 3)), delta)),
        np.concatenate((np.zeros((1, 3, 3)), delta_cov)),
        np.array([fix.step - first + 1 for fix in fixes], np.int64),
        np.zeros(len(fixes), np.int64),
        between(start, np.array([fix.pose for fix in fixes]).reshape(-1, 3)),
        (loop_cov + loop_cov.swapaxes(1, 2)) / 2,
        remarks,
    )


def _told(localiser: Localiser) -> dict[str, Any]:
    """The log's notes on a localisation."""
    return {
        ON_MAP: localiser.first,
        "fixes": len(localiser.fixes),
        "steps_without_a_fix": localiser.missed,
        "points_not_of_the_map": round(localiser.moved / max(localiser.seen, 1), 4),
        "searched_on_the_map": localiser.searches,
        "turned_down": dict(localiser.why),
    }

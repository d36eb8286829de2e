"""The log of a depth camera's recording: odometry with landmarks or loop closures."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import REMARKS, Log
from ...core.factors.check import check
from ..inertial.tilts import LEVELS
from ..pauses import longest_pause
from ..wheels.holes import outside
from .front_end import BY_GRAVITY, DENIED, FrontEnd
from .recording import DepthRecording
from .settings import Settings

OFF, BEYOND = 4.0, 2.0
"""A median depth of less than `near` over the first, or more than `far` times the second, is in another unit."""

MANY = 0.1
"""Share of the steps above which frames that contradict the wheels are a remark: things that move do so at fewer."""

Observer = Callable[[FrontEnd], None]


def build_log(recording: DepthRecording, settings: Settings, observe: Observer | None = None) -> Log:
    """Makes the log: a step every so often, with the motion since the one before and landmarks or loop closures.

    `observe` is called after every frame. InputError for a recording without wheels where they are asked for, for
    frames out of order, and without two steps.
    """
    return log_of(recording, looked_at(recording, settings, observe))


def looked_at(recording: DepthRecording, settings: Settings, observe: Observer | None = None) -> FrontEnd:
    """Takes a front end through all frames; InputError for frames out of order or without the wheels asked for."""
    if recording.motion is None and settings.odometry == "wheels":
        raise InputError(
            f"{recording.name}: option odometry: found wheels, but no readings of wheels; expected "
            "odometry=visual with landmarks=false."
        )
    if recording.motion is not None:
        recording.motion.check()
    front_end = FrontEnd(recording.camera, settings, recording.motion, recording.tilts)
    for frame in recording.in_order():
        front_end.frame(frame)
        if observe is not None:
            observe(front_end)
    front_end.finish()
    return front_end


def log_of(recording: DepthRecording, front_end: FrontEnd) -> Log:
    """The steps, landmarks and loops of a front end as a log; InputError without two steps."""
    steps, settings = front_end.steps, front_end.settings
    if len(steps) < 2:
        raise InputError(
            f"{recording.name}: found {front_end.counts['frames']} frames and {len(steps)} steps, expected a drive "
            f"of at least one step of {settings.step:g} m or {settings.turn:g} rad."
        )
    nothing = np.full(3, np.nan), np.full((3, 3), np.nan)
    motions = [nothing if step.motion is None else step.motion for step in steps]
    seen = front_end.tracks.chosen()
    loops = sorted(front_end.loops if settings.loops else [], key=lambda loop: (loop.step, loop.to))
    log = Log.from_arrays(
        recording.name,
        recording.prior,
        t=np.array([step.t for step in steps]),
        delta=np.array([delta for delta, _ in motions]),
        delta_cov=np.array([cov for _, cov in motions]),
        sighting_step=seen.step,
        ids=seen.ids,
        z=seen.z,
        z_cov=seen.cov,
        loop_step=np.array([loop.step for loop in loops], np.int64),
        loop_to=np.array([loop.to for loop in loops], np.int64),
        loop_delta=np.array([loop.motion.delta for loop in loops]).reshape(-1, 3),
        loop_cov=np.array([loop.motion.cov for loop in loops]).reshape(-1, 3, 3),
        notes=_notes(recording, front_end),
    )
    check(log, recording.name)
    return replace(log, clouds=front_end.clouds.clouds(recording.camera))


def _notes(recording: DepthRecording, front_end: FrontEnd) -> dict[str, Any]:
    """The recording's notes, with the settings and what was left out."""
    motion, camera, steps, counts = recording.motion, recording.camera, front_end.steps, front_end.counts
    settings = front_end.settings
    remarks = list(recording.remarks)
    if motion is not None:
        first, last = motion.t[[0, -1]]
        name, lost = motion.readings, counts[f"frames without {motion.readings}"]
        remarks += motion.remarks(steps[0].t, steps[-1].t)
        clock = f"before or after the {name}, {first:.10g} to {last:.10g} s"
        denied = counts[DENIED]
        if settings.odometry == "wheels" and denied > MANY * len(steps):
            remarks.append(
                f"at {denied} of {len(steps)} steps the frames contradict the {name}: the covariance of these motions "
                "has the difference"
            )
        remarks += outside(recording.name, lost, counts["frames"], "frame", clock)
    if recording.tilts is not None:
        remarks += recording.tilts.remarks(
            front_end.floorless, "frames without a floor", "they are taken as the camera is mounted"
        )
    depth = float(np.median(front_end.depths)) if front_end.depths else None
    if depth is not None and not settings.near / OFF < depth < settings.far * BEYOND:
        remarks.append(
            f"{recording.name}: the median depth is {depth:.3g} m, and only depths from {settings.near:g} to "
            f"{settings.far:g} m are used (near, far): perhaps a metre has other [depth] units, or floats are no metres"
        )
    return {
        **recording.notes,
        **longest_pause(steps[0].t, steps[-1].t, front_end.t, () if motion is None else motion.t),
        **(motion.settings if motion is not None else {}),
        "camera": camera.settings,
        "depth": {
            "median": depth,
            "counts": {**counts, **recording.left_out},
            "turned_down": dict(front_end.turned_down),
            "loops": {
                "searched": front_end.search.searched,
                "found": len(front_end.loops),
                "places": len(front_end.search.places),
                "turned_down": dict(front_end.search.why),
            },
            "settings": asdict(settings),
        },
        **({LEVELS: recording.tilts.settings} if recording.tilts is not None and counts[BY_GRAVITY] else {}),
        **({REMARKS: remarks} if remarks else {}),
    }

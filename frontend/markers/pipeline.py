"""Builds a log from a recording of the frames of a camera, or several, and encoder readings."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.factors import REMARKS, Log, Prior, RangeBearing, RelativePoses, Step
from ...core.factors.check import check
from ...core.se2 import Array
from ..camera.camera import Camera
from ..camera.lens_misfit import Misfit
from ..camera.shutter import CameraMotion, carried
from ..inertial.tilts import LEVELS, Tilts
from ..pauses import longest_pause
from ..wheels.holes import outside
from ..wheels.motion import Motion
from .aruco import IGNORED, Detector, Image, Rejections, Sighting, on_robot
from .noise import Measured, Noise, leaning_or_sway, together

SPAN = 0.2
"""s, at least, over which the motion behind a rolling shutter is a mean.

In the time of a frame's rows alone, some hundredths of a second, coarse wheels count once or twice. A jerk of 5 m/s^3
makes the mean differ from the velocity in the middle by 8 mm/s.
"""


MOST_NAMED = 5  # ids in a remark

UNLEVELLED = "their sightings have the errors of sway"

JOINED = "sightings of markers that another camera saw at once: the log has the mean of both"
"""The reason for which a marker in two frames of one step is in the log once."""


class Frame(NamedTuple):
    """An image and its time."""

    t: float  # s, the middle of the exposure of its middle row, by the clock of the motion's readings
    image: Image | None  # (height, width) grey or (height, width, 3) BGR; None: not there, or not decoded
    found: tuple[list[Sighting], Rejections] | None = None  # by another program; None: to be detected
    camera: str = ""  # its name, of several
    clock: float = 0.0  # s by which `t` is later than its stamp


class FrameSightings(NamedTuple):
    """The front end's result for one frame."""

    frame: Frame
    sightings: list[Sighting]  # all found, distant ones included
    z: Array  # (k, 2) their ranges (m) and bearings (rad)
    cov: Array  # (k, 2, 2)
    kept: NDArray[np.bool_]  # (k,) near enough for the log
    rejected: Rejections
    height: Array  # (k,) m, of the markers over the robot's plane
    rocking: Array  # (k, 2, 2) the part of `cov` that is of the body's pitch and roll, which all its cameras share

    @property
    def near(self) -> RangeBearing:
        """Those that are near enough for the log."""
        ids = np.array([one.id for one in self.sightings], np.int64)
        return RangeBearing(ids[self.kept], self.z[self.kept], self.cov[self.kept])


@dataclass(frozen=True, eq=False)
class Recording:
    """A robot's recording and the settings needed to read it.

    `frames` is iterated once, in order, and may be lazy: one image of each camera in memory at a time.
    """

    name: str
    frames: Iterable[Frame]
    motion: Motion
    detector: Detector
    noise: Noise
    prior: Prior
    max_range: float = 3.0  # m in the robot's plane, from its origin; farther sightings are left out
    max_distance: float = np.inf  # m from the camera, in space, as in the program of ArUco EKF SLAM
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    remarks: list[str] = field(default_factory=list[str])  # grows while the frames are read
    others: Sequence[Detector] = ()  # of further cameras on the robot
    tilts: Tilts | None = None  # by gravity; None: sightings are not levelled

    @cached_property
    def detectors(self) -> Mapping[str, Detector]:
        """Those of all cameras, by the cameras' names."""
        return {one.camera.name: one for one in (self.detector, *self.others)}

    @property
    def reach(self) -> str:
        """Words from where on a sighting is too far."""
        range_ = f"{self.max_range:g} m"
        if np.isinf(self.max_distance):
            return range_
        distance = f"{self.max_distance:g} m from the camera"
        return distance if np.isinf(self.max_range) else f"{range_} or {distance}"


def build_log(recording: Recording, observe: Callable[[FrameSightings], None] | None = None) -> Log:
    """Builds the log, one step per frame; omissions are counted in `notes["counts"]`.

    Frames of several cameras at one time are one step. Frames outside the time of the motion's readings and undecodable
    frames are left out; what is legal yet odd is among the log's remarks. `observe` is called with the result of each
    of the others. InputError for frames or readings out of order, if no frame is left, and for values that no log may
    have.
    """
    recording.motion.check()
    first, last = recording.motion.t[[0, -1]]
    counts, twice = Counter[str](), Counter[int]()
    misfits = {name: Misfit() for name in recording.detectors}
    steps: list[Step] = []
    latest, cameras, measured = -np.inf, set[str](), _NONE
    looked = list[float]()  # times of frames that levels are sought for
    for number, frame in enumerate(recording.frames):
        if not (frame.t > latest or (frame.t == latest and frame.camera not in cameras)):
            raise InputError(f"{recording.name}: frame {number} is at {frame.t} s, expected later than {latest} s.")
        cameras = {frame.camera} if frame.t > latest else cameras | {frame.camera}
        latest = frame.t
        counts["frames"] += 1
        if not first <= frame.t <= last:
            counts[f"frames without {recording.motion.readings}"] += 1
            continue
        if frame.image is None and frame.found is None:
            counts["frames that could not be decoded"] += 1
            continue
        seen = see(recording, frame)
        looked.append(frame.t)
        counts.update(seen.rejected)
        twice.update(seen.rejected.twice)
        for one in seen.sightings:
            if np.isfinite(one.error):
                misfits[frame.camera].add(one.corners, one.corner_cov, one.error)
        counts[f"sightings beyond {recording.reach}"] += int((~seen.kept).sum())
        if observe is not None:
            observe(seen)
        new = Measured(seen.near, seen.rocking[seen.kept])
        if steps and steps[-1].t == frame.t:
            before, measured = measured, together(measured, new)
            both = len(before.rocking) + len(new.rocking) - len(measured.rocking)
            counts["sightings"] += len(new.rocking) - both
            if both:
                counts[JOINED] += both
            steps[-1] = steps[-1]._replace(sightings=measured.sightings)
            continue
        odometry = recording.motion.odometry(steps[-1].t, frame.t) if steps else None
        measured = new
        counts["sightings"] += len(new.rocking)
        steps.append(Step(frame.t, odometry, new.sightings, _NO_LOOPS))
    if not steps:
        clock = f"the time of the {recording.motion.readings}"
        raise InputError(f"{recording.name}: found no frame within {clock}, expected one.")
    remarks = [
        *_remarks(recording, counts, steps[0].t, steps[-1].t),
        *_of_twins(recording, twice, steps),
        *([] if recording.tilts is None else recording.tilts.remarks(looked, "frames", UNLEVELLED)),
        *(said for name, one in misfits.items() for said in one.remarks(called(recording.name, name))),
    ]
    pause = longest_pause(steps[0].t, steps[-1].t, [step.t for step in steps], recording.motion.t)
    notes = {**_settings(recording), **pause, "counts": dict(counts), **({REMARKS: remarks} if remarks else {})}
    log = Log.from_steps(recording.name, recording.prior, steps, notes)
    check(log, recording.name)
    return log


def called(name: str, camera: str) -> str:
    """The name of a recording, and of the camera of several."""
    return f"{name}: camera {camera}" if camera else name


def _remarks(recording: Recording, counts: Counter[str], start: float, end: float) -> list[str]:
    """The recording's remarks, with those on the motion from `start` to `end`, s, and on frames that are left out."""
    first, last = recording.motion.t[[0, -1]]
    name, clock = (
        recording.motion.readings,
        f"before or after the {recording.motion.readings}, {first:.10g} to {last:.10g} s",
    )
    lost = counts[f"frames without {name}"]
    return [
        *recording.remarks,
        *(
            f"{recording.name}: [markers] ignore has id {one}, which no frame has"
            for one in recording.detector.markers.ignore
            if not counts[IGNORED.format(one)]
        ),
        *recording.motion.remarks(start, end),
        *outside(recording.name, lost, counts["frames"], "frame", clock),
    ]


def _of_twins(recording: Recording, twice: Mapping[int, int], steps: Sequence[Step]) -> Iterator[str]:
    """The remark on ids that several markers of one frame had: frames that show one of them do not tell which."""
    if not twice:
        return
    order = sorted(twice, key=lambda name: (-twice[name], name))
    named = ", ".join(map(str, order[:MOST_NAMED])) + ", ..." * (len(order) > MOST_NAMED)
    frames = max(twice.values())
    left = sum(int(np.isin(step.sightings.ids, order).sum()) for step in steps)
    which = f"id {named} was" if len(order) == 1 else f"each of the ids {named} was"
    most = f"{frames:,} frame{'s' * (frames > 1)}"
    of = most if len(order) == 1 else f"up to {most}"
    kept = f", and the {left:,} sightings of other frames may be of any of them" if left else ""
    yield (
        f"{recording.name}: {which} on several markers of one frame, in {of}: none of these is in the log{kept}; an id "
        "is one landmark, so every marker needs its own"
    )


def see(recording: Recording, frame: Frame) -> FrameSightings:
    """Detects the markers in one frame, which has an image, or takes those that another program found in it.

    Where the body's tilt is known by gravity, they are seen from the level robot.
    """
    detector = recording.detectors[frame.camera]
    camera = detector.camera
    if frame.found is None:
        assert frame.image is not None
        found, rejected = detector.detect(frame.image, camera_motion(recording.motion, camera, frame.t))
    else:
        found, rejected = frame.found
    mounting, leaning, sway = camera.mounting, None, recording.noise.sway
    if recording.tilts is not None and (tilt := recording.tilts.at(frame.t, sway)) is not None:
        mounting, leaning = tilt.turn @ mounting, tilt.leaning
    z, cov = recording.noise.measure(found, mounting, leaning)
    distance = np.linalg.norm([one.centre for one in found], axis=1) if found else np.zeros(0)
    near = (z[:, 0] <= recording.max_range) & (distance <= recording.max_distance)
    height = on_robot(found, mounting)[:, 2]
    return FrameSightings(frame, found, z, cov, near, rejected, height, leaning_or_sway(leaning, sway, z, height))


def camera_motion(motion: Motion, camera: Camera, t: float) -> CameraMotion | None:
    """The motion of a camera with a rolling shutter at `t`, s, from the readings around; None for other cameras.

    It is the mean of SPAN or the frame's readout, less where the readings begin or end. Of a single reading, none.
    """
    first, last = motion.t[[0, -1]].tolist()
    around = max(SPAN, camera.readout) / 2
    start, end = max(t - around, first), min(t + around, last)
    if not camera.readout or not start < end:
        return None
    return carried(motion.odometry(start, end), end - start, camera.mounting)


def _settings(recording: Recording) -> dict[str, Any]:
    markers = recording.detector.markers
    cameras = {name: one.camera.settings for name, one in recording.detectors.items()}
    sizes = {"sides": {str(name): side for name, side in markers.sides.items()}} if markers.sides else {}
    return {
        **recording.notes,
        **recording.motion.settings,
        "noise": recording.noise.settings,
        **({} if recording.tilts is None else {LEVELS: recording.tilts.settings}),
        "camera": cameras.get("", cameras),
        "markers": {
            **({"dictionary": markers.dictionary} if markers.dictionary else {}),
            **({} if np.isnan(markers.side) else {"side": markers.side}),
            **sizes,
            **({"ignore": list(markers.ignore)} if markers.ignore else {}),
            **{
                name: limit
                for name, limit in (("max_range", recording.max_range), ("max_distance", recording.max_distance))
                if np.isfinite(limit)
            },
        },
    }


_NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))

_NONE = Measured(RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2))), np.zeros((0, 2, 2)))

"""Builds a log from a recording of camera frames and encoder readings."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.check import check
from ...core.errors import InputError
from ...core.factors import REMARKS, Log, Prior, RangeBearing, RelativePoses, Step
from ...core.pauses import longest_pause
from ...core.se2 import Array
from ..camera.lens_misfit import Misfit
from ..camera.shutter import CameraMotion, carried
from ..wheels.holes import outside
from ..wheels.motion import Motion
from .aruco import IGNORED, Detector, Image, Rejections, Sighting
from .noise import Noise

SPAN = 0.2
"""s, at least, over which the motion behind a rolling shutter is a mean.

In the time of a frame's rows alone, some hundredths of a second, coarse wheels count once or twice. A jerk of 5 m/s^3
makes the mean differ from the velocity in the middle by 8 mm/s.
"""

MOST_NAMED = 5  # ids in a remark


class Frame(NamedTuple):
    """An image and its time."""

    t: float  # s, the middle of the exposure of its middle row, by the clock of the motion's readings
    image: Image | None  # (height, width) grey or (height, width, 3) BGR; None: not there, or not decoded
    found: tuple[list[Sighting], Rejections] | None = None  # by another program; None: to be detected


class FrameSightings(NamedTuple):
    """The front end's result for one frame."""

    frame: Frame
    sightings: list[Sighting]  # all found, distant ones included
    z: Array  # (k, 2) their ranges (m) and bearings (rad)
    cov: Array  # (k, 2, 2)
    kept: NDArray[np.bool_]  # (k,) near enough for the log
    rejected: Rejections


@dataclass(frozen=True, eq=False)
class Recording:
    """A robot's recording and the settings needed to read it.

    `frames` is iterated once, in order, and may be lazy: one image in memory at a time.
    """

    name: str
    frames: Iterable[Frame]
    motion: Motion
    detector: Detector
    noise: Noise
    prior: Prior
    max_range: float = 3.0  # m in the robot's plane, from its origin; farther sightings are left out
    max_distance: float = np.inf  # m from the camera, in space, as in the program of ArUco EKF SLAM
    clock: float = 0.0  # s by which the frames' times are later than their stamps
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    remarks: list[str] = field(default_factory=list[str])  # grows while the frames are read

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

    Frames outside the time of the motion's readings and undecodable frames are left out; what is legal yet odd is among
    the log's remarks. `observe` is called with the result of each of the others. InputError for frames or readings out
    of order, if no frame is left, and for values that no log may have.
    """
    recording.motion.check()
    first, last = recording.motion.t[[0, -1]]
    counts, twice, misfit = Counter[str](), Counter[int](), Misfit()
    steps: list[Step] = []
    latest = -np.inf
    for number, frame in enumerate(recording.frames):
        if not frame.t > latest:
            raise InputError(f"{recording.name}: frame {number} is at {frame.t} s, expected later than {latest} s.")
        latest = frame.t
        counts["frames"] += 1
        if not first <= frame.t <= last:
            counts[f"frames without {recording.motion.readings}"] += 1
            continue
        if frame.image is None and frame.found is None:
            counts["frames that could not be decoded"] += 1
            continue
        odometry = recording.motion.odometry(steps[-1].t, frame.t) if steps else None
        seen = see(recording, frame)
        counts.update(seen.rejected)
        twice.update(seen.rejected.twice)
        for one in seen.sightings:
            if np.isfinite(one.error):
                misfit.add(one.corners, one.corner_cov, one.error)
        counts[f"sightings beyond {recording.reach}"] += int((~seen.kept).sum())
        counts["sightings"] += int(seen.kept.sum())
        if observe is not None:
            observe(seen)
        ids = np.array([sighting.id for sighting in seen.sightings], np.int64)
        near = RangeBearing(ids[seen.kept], seen.z[seen.kept], seen.cov[seen.kept])
        steps.append(Step(frame.t, odometry, near, _NO_LOOPS))
    if not steps:
        clock = f"the time of the {recording.motion.readings}"
        raise InputError(f"{recording.name}: found no frame within {clock}, expected one.")
    remarks = [
        *_remarks(recording, counts, steps[0].t, steps[-1].t),
        *_of_twins(recording, twice, steps),
        *misfit.remarks(recording.name),
    ]
    pause = longest_pause(steps[0].t, steps[-1].t, [step.t for step in steps], recording.motion.t)
    notes = {**_settings(recording), **pause, "counts": dict(counts), **({REMARKS: remarks} if remarks else {})}
    log = Log.from_steps(recording.name, recording.prior, steps, notes)
    check(log, recording.name)
    return log


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
    """Detects the markers in one frame, which has an image, or takes those that another program found in it."""
    if frame.found is None:
        assert frame.image is not None
        found, rejected = recording.detector.detect(frame.image, camera_motion(recording, frame.t))
    else:
        found, rejected = frame.found
    z, cov = recording.noise.measure(found, recording.detector.camera.mounting)
    distance = np.linalg.norm([one.centre for one in found], axis=1) if found else np.zeros(0)
    near = (z[:, 0] <= recording.max_range) & (distance <= recording.max_distance)
    return FrameSightings(frame, found, z, cov, near, rejected)


def camera_motion(recording: Recording, t: float) -> CameraMotion | None:
    """The motion of a camera with a rolling shutter at `t`, s, from the readings around; None for other cameras.

    It is the mean of SPAN or the frame's readout, less where the readings begin or end. Of a single reading, none.
    """
    camera = recording.detector.camera
    first, last = recording.motion.t[[0, -1]].tolist()
    around = max(SPAN, camera.readout) / 2
    start, end = max(t - around, first), min(t + around, last)
    if not camera.readout or not start < end:
        return None
    return carried(recording.motion.odometry(start, end), end - start, camera.mounting)


def _settings(recording: Recording) -> dict[str, Any]:
    camera, markers = recording.detector.camera, recording.detector.markers
    sizes = {"sides": {str(name): side for name, side in markers.sides.items()}} if markers.sides else {}
    return {
        **recording.notes,
        **recording.motion.settings,
        "noise": recording.noise.settings,
        "camera": camera.settings,
        "markers": {
            "dictionary": markers.dictionary,
            "side": markers.side,
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

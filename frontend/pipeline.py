"""A recording, camera frames and encoder readings, -> the log every backend is given."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .aruco import Detector, Image, range_bearing
from .check import check
from .encoder import Encoder
from .errors import InputError
from .factors import Log, Prior, RangeBearing, RelativePoses, Step
from .noise import ProportionalNoise
from .se2 import Array


class Frame(NamedTuple):
    """One image, and when it was taken."""

    t: float  # s
    image: Image  # (height, width) grey or (height, width, 3) BGR


class Ticks(NamedTuple):
    """The readings of a differential drive's counters."""

    t: Array  # (m,) s, strictly increasing
    counts: Array  # (m, 2) left and right, cumulative


@dataclass(frozen=True, eq=False)
class Recording:
    """What a robot recorded, and what has to be known of it to read it.

    `frames` is gone through once, in order, and may be lazy: no more than one image need be in memory.
    """

    name: str
    frames: Iterable[Frame]
    ticks: Ticks
    encoder: Encoder
    detector: Detector
    noise: ProportionalNoise
    prior: Prior
    max_range: float = 3.0  # m; ArUco EKF SLAM drops what is farther
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])


def build_log(recording: Recording) -> Log:
    """The recording as a log with a step a frame; what was left out is counted in `notes["counts"]`.

    Frames outside the time of the encoder's readings are left out. InputError for frames or readings out of order,
    where no frame is left, and for numbers that no log may have.
    """
    _check(recording.ticks)
    counts = Counter[str]()
    steps: list[Step] = []
    latest = -np.inf
    for number, frame in enumerate(recording.frames):
        if not frame.t > latest:
            raise InputError(f"{recording.name}: frame {number} is at {frame.t} s, expected later than {latest} s")
        latest = frame.t
        counts["frames"] += 1
        if not recording.ticks.t[0] <= frame.t <= recording.ticks.t[-1]:
            counts["frames without encoder readings"] += 1
            continue
        odometry = None
        if steps:
            odometry = recording.encoder.odometry(*readings(recording.ticks, steps[-1].t, frame.t))
        steps.append(Step(frame.t, odometry, _sightings(recording, frame, counts), _NO_LOOPS))
    if not steps:
        raise InputError(f"{recording.name}: found no frame within the time of the encoder's readings, expected one")
    notes = {**_settings(recording), "counts": dict(counts)}
    log = Log.from_steps(recording.name, recording.prior, steps, notes)
    check(log, recording.name)
    return log


def readings(ticks: Ticks, start: float, end: float) -> tuple[Array, Array]:
    """The count increments (n, 2) from `start` to `end`, s, and how long each took, (n,) s.

    A reading that `start` or `end` falls into is divided as if the wheels had turned evenly meanwhile.
    """
    inside = slice(np.searchsorted(ticks.t, start, "right"), np.searchsorted(ticks.t, end, "left"))
    t = np.concatenate(([start], ticks.t[inside], [end]))
    wheels = [np.interp(t, ticks.t, ticks.counts[:, wheel]) for wheel in (0, 1)]
    return np.diff(np.stack(wheels, axis=-1), axis=0), np.diff(t)


def _sightings(recording: Recording, frame: Frame, counts: Counter[str]) -> RangeBearing:
    found, rejected = recording.detector.detect(frame.image)
    z = range_bearing(found, recording.detector.camera.mounting)
    near = z[:, 0] <= recording.max_range
    counts.update(rejected)
    counts[f"sightings beyond {recording.max_range:g} m"] += int((~near).sum())
    counts["sightings"] += int(near.sum())
    ids = np.array([sighting.id for sighting in found], np.int64)
    return RangeBearing(ids[near], z[near], recording.noise.cov(z[near]))


def _check(ticks: Ticks) -> None:
    if len(ticks.t) == 0:
        raise InputError("encoder: found no readings, expected at least one")
    late = np.flatnonzero(~(np.diff(ticks.t) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"encoder: reading {row} is at {ticks.t[row]} s, expected later than {ticks.t[row - 1]} s")


def _settings(recording: Recording) -> dict[str, Any]:
    detector, camera = recording.detector, recording.detector.camera
    return {
        **recording.notes,
        "encoder": {name: value for name, value in asdict(recording.encoder).items() if value is not None},
        "noise": asdict(recording.noise),
        "camera": {**asdict(camera), "mounting": camera.mounting.tolist()},
        "markers": {"dictionary": detector.dictionary, "side": detector.side, "max_range": recording.max_range},
    }


_NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))

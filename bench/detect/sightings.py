"""Collects the front end's detections in a recording, and their errors where a truth is known."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Truth
from ...core.se2 import Array, Ints
from ...core.truth.errors import difference, rows_of, sighted_from
from ...frontend.markers.noise import Noise
from ...frontend.markers.pipeline import FrameSightings

AMBIGUOUS = 0.05  # ambiguous from here on: the likelihood of a marker's second pose over that of the better one

Mask = NDArray[np.bool_]


class Sightings(NamedTuple):
    """All detections, those too far away as well, in the order of the frames."""

    frame: Ints  # (s,) number of the frame among those used
    ids: Ints  # (s,)
    z: Array  # (s, 2) range (m), bearing (rad)
    cov: Array  # (s, 2, 2)
    corner_noise: Array  # (s, 2, 2) of z, from the corners alone; NaN where not requested
    height: Array  # (s,) m, over the robot's plane
    corner_sd: Array  # (s,) px, of a corner along an axis, root mean square
    error: Array  # (s,) px, of the reprojection; NaN: unknown
    ambiguity: Array  # (s,)
    kept: Mask  # (s,) in the log


class Marker(NamedTuple):
    """One marker over a recording; ranges, error and share of what is in the log."""

    id: int
    sightings: int
    first: float  # s
    last: float  # s
    nearest: float  # m
    farthest: float  # m
    error: float | None  # px, mean; None: unknown
    ambiguous: float  # share of the sightings


_NONE = Sightings(
    np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros((0, 2, 2)),
    np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_),
)  # fmt: skip


class OfCamera(NamedTuple):
    """The frames of a camera that were used."""

    frames: int = 0
    seeing: int = 0  # frames with a marker
    kept: int = 0  # sightings in the log
    size: tuple[int, int] = (0, 0)  # px, width and height of a frame; 0: without images


@dataclass
class Detection:
    """Collects the detections of `build_log`; a frame costs a kilobyte, its image is not kept."""

    corner_model: Noise | None = None  # where given, its covariances are kept as well
    found: int = 0  # detections so far
    cameras: dict[str, OfCamera] = field(default_factory=dict[str, OfCamera])  # by name; "": the only one
    times: list[float] = field(default_factory=list[float])  # s, of the frames
    _frames: list[Sightings] = field(default_factory=list[Sightings])

    def observe(self, seen: FrameSightings, mounting: Array) -> None:
        """Takes in a frame; `mounting` is T_robot_camera."""
        found, k = seen.sightings, len(seen.sightings)
        camera, image = self.cameras.get(seen.frame.camera, OfCamera()), seen.frame.image
        size = camera.size if image is None else (image.shape[1], image.shape[0])
        kept = camera.kept + int(seen.kept.sum())
        self.cameras[seen.frame.camera] = OfCamera(camera.frames + 1, camera.seeing + (k > 0), kept, size)
        self.times.append(seen.frame.t)
        model, covs = self.corner_model, np.array([one.corner_cov for one in found]).reshape(k, 8, 8)
        self.found += k
        self._frames.append(
            Sightings(
                np.full(k, len(self._frames)),
                np.array([one.id for one in found], np.int64),
                seen.z,
                seen.cov,
                np.full_like(seen.cov, np.nan) if model is None else model.measure(found, mounting)[1],
                seen.height,
                np.sqrt(np.diagonal(covs, axis1=1, axis2=2).mean(axis=1)),
                np.array([one.error for one in found], float),
                np.array([one.ambiguity for one in found], float),
                seen.kept,
            )
        )

    def sightings(self) -> Sightings:
        """Returns all sightings as columns."""
        return Sightings._make(np.concatenate(column) for column in zip(_NONE, *self._frames, strict=True))


def in_log(sightings: Sightings) -> Sightings:
    """Returns those of them that are in the log."""
    return Sightings._make(column[sightings.kept] for column in sightings)


def per_frame(sightings: Sightings, frames: int) -> Ints:
    """Counts the sightings of each frame (frames,)."""
    return np.bincount(sightings.frame, minlength=frames)


def markers(sightings: Sightings, t: Array) -> Iterator[Marker]:
    """Yields each marker among `sightings`, by id."""
    for name in np.unique(sightings.ids):
        mine = sightings.ids == name
        times, ranges = t[sightings.frame[mine]], sightings.z[mine, 0]
        yield Marker(
            int(name),
            int(mine.sum()),
            float(times[0]),
            float(times[-1]),
            float(ranges.min()),
            float(ranges.max()),
            known_or_none(float(sightings.error[mine].mean())),
            float((sightings.ambiguity[mine] > AMBIGUOUS).mean()),
        )


def known_or_none(value: float) -> float | None:
    """The value; None for NaN."""
    return None if np.isnan(value) else value


class TrueErrors(NamedTuple):
    """Errors of the sightings whose marker and pose are known."""

    known: NDArray[np.bool_]  # (s,) of all sightings
    errors: Array  # (m, 2) measured minus true range (m) and bearing (rad)


def true_errors(sightings: Sightings, t: Array, truth: Truth) -> TrueErrors:
    """Computes the errors of `sightings` in frames at `t` (n,), with `truth` at those of these times that it covers."""
    if truth.map is None:
        return TrueErrors(np.zeros(len(sightings.ids), bool), np.zeros((0, 2)))
    pose, place = rows_of(truth.t, t)[sightings.frame], rows_of(truth.map.ids, sightings.ids)
    known = (pose >= 0) & (place >= 0)
    right = sighted_from(truth.poses[pose[known]], truth.map.xy[place[known]])
    return TrueErrors(known, difference(sightings.z[known], right))

"""Collects the front end's detections in a recording, and their errors where a truth is known."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Truth
from ...core.se2 import Array, Ints
from ...core.truth_errors import difference, rows_of, sighted_from
from ...frontend.markers.noise import Noise
from ...frontend.markers.pipeline import FrameSightings

AMBIGUOUS = 0.05  # ambiguous from here on: the likelihood of a marker's second pose over that of the better one

Mask = NDArray[np.bool_]


class Sightings(NamedTuple):
    """All detections, those too far away as well, in the order of the frames."""

    frame: Ints  # (s,) number of the frame among those used: the step of the log
    ids: Ints  # (s,)
    z: Array  # (s, 2) range (m), bearing (rad)
    cov: Array  # (s, 2, 2)
    corner_noise: Array  # (s, 2, 2) of z, from the corners alone; NaN where not requested
    corner_sd: Array  # (s,) px, of a corner along an axis, root mean square
    error: Array  # (s,) px, of the reprojection
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
    error: float  # px, mean
    ambiguous: float  # share of the sightings


@dataclass
class Detection:
    """Collects the detections of `build_log`; a frame costs a few hundred bytes, its image is not kept."""

    corner_model: Noise | None = None  # where given, its covariances are kept as well
    rejected: Counter[str] = field(default_factory=Counter[str])
    size: tuple[int, int] = (0, 0)  # px, width and height of the frames
    _times: list[float] = field(default_factory=list[float])
    _rows: list[tuple[int, int, float, float, float, bool]] = field(
        default_factory=list[tuple[int, int, float, float, float, bool]]
    )
    _z: list[Array] = field(default_factory=list[Array])
    _cov: list[Array] = field(default_factory=list[Array])
    _corner_noise: list[Array] = field(default_factory=list[Array])

    def observe(self, seen: FrameSightings, mounting: Array) -> None:
        """Takes in a frame; `mounting` is T_robot_camera."""
        assert seen.frame.image is not None
        height, width = seen.frame.image.shape[:2]
        self.size = (width, height)
        number = len(self._times)
        self._times.append(seen.frame.t)
        self.rejected.update(seen.rejected)
        self._rows += [
            (
                number,
                sighting.id,
                float(np.sqrt(np.diag(sighting.corner_cov).mean())),
                sighting.error,
                sighting.ambiguity,
                bool(kept),
            )
            for sighting, kept in zip(seen.sightings, seen.kept, strict=True)
        ]
        self._z.append(seen.z)
        self._cov.append(seen.cov)
        if self.corner_model is not None:
            self._corner_noise.append(self.corner_model.measure(seen.sightings, mounting)[1])

    @property
    def frames(self) -> int:
        """Counts the frames that were used."""
        return len(self._times)

    @property
    def found(self) -> int:
        """Counts the markers that were found in them."""
        return len(self._rows)

    @property
    def t(self) -> Array:
        """Returns the times (n,) of the frames, s."""
        return np.array(self._times)

    def sightings(self) -> Sightings:
        """Returns all sightings as columns."""
        columns = zip(*self._rows, strict=True) if self._rows else ((),) * 6
        frame, ids, corner_sd, error, ambiguity, kept = columns
        cov = np.concatenate([np.zeros((0, 2, 2)), *self._cov])
        return Sightings(
            np.array(frame, np.int64),
            np.array(ids, np.int64),
            np.concatenate([np.zeros((0, 2)), *self._z]),
            cov,
            np.concatenate([np.zeros((0, 2, 2)), *self._corner_noise])
            if self._corner_noise
            else np.full_like(cov, np.nan),
            np.array(corner_sd, float),
            np.array(error, float),
            np.array(ambiguity, float),
            np.array(kept, bool),
        )


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
            float(sightings.error[mine].mean()),
            float((sightings.ambiguity[mine] > AMBIGUOUS).mean()),
        )


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

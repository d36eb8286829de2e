"""Measures the cost and accuracy of each corner refinement, on frames with known truth."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from ...core.se2 import Array, wrap
from ...datasets.rendering.cameras import CAMERAS, MOUNTING
from ...datasets.rendering.clutter import clutter
from ...datasets.rendering.marker_shots import Placement, crowds, placements
from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Detector, Image, Refinement
from ...frontend.markers.markers import Markers
from ...frontend.markers.noise import PropagatedNoise

REFINEMENTS: tuple[Refinement, ...] = ("none", "subpix", "contour", "apriltag", "template")

MARKERS = Markers("4X4_50", 0.16)

SMALL = CAMERAS["pinhole"]
LARGE = Camera(1280, 720, (1002.1, 1000.8), (641.3, 357.9), (-0.208, 0.062, 0.0008, -0.0006, 0.0), MOUNTING)

STILL = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)  # m, the distances from a still camera
MOVING = (1.0, 2.0, 3.0, 4.0)  # m, the distances from a moving one
STREAK = 4.0  # px, the most that motion blurs a marker
NEAR, FAR, CROWD = 0.8, 3.5, 6  # m, range of the markers of a crowded frame, and their number
NORMAL_95 = 1.96  # standard deviations either side of the mean that hold 95 % of a normal distribution


class Cost(NamedTuple):
    """The cost of one refinement at one frame size."""

    refinement: Refinement
    camera: Camera
    frames: int
    ms: float  # CPU time of a frame with CROWD markers, the median

    @property
    def rate(self) -> float:
        """Returns frames per second on one core."""
        return 1e3 / self.ms


class Accuracy(NamedTuple):
    """The accuracy of one refinement at one distance."""

    refinement: Refinement
    distance: float  # m
    streak: float  # px, the most that motion drew the markers out; 0: a still camera
    placements: int
    found: int
    wrong: int  # sightings of a marker that was not there
    bias: float  # m, mean error of the distance from camera to marker; NaN, as the rest, where too few were found
    sd: float  # m, its standard deviation
    bearing_bias: float  # rad, mean error of the bearing in the robot's plane
    nees: float  # of (range, bearing) by `PropagatedNoise`, over its two degrees of freedom; 1 is exact
    nees_half: float  # half of its 95 % interval

    @property
    def refused(self) -> float:
        """Share of the placements whose marker was not found."""
        return 1 - self.found / self.placements


class Misreadings(NamedTuple):
    """The number of detections of markers that were not there."""

    kind: str  # of frames
    refinement: Refinement
    frames: int
    sightings: int
    wrong: int


class CornerExtent(NamedTuple):
    """The extent of the study."""

    timed: int  # frames of either size
    placements: int  # for each distance
    clutter: int  # frames
    crowded: int  # frames


QUICK, FULL = CornerExtent(10, 20, 20, 20), CornerExtent(40, 200, 200, 200)


@dataclass(frozen=True, eq=False)
class Study:
    """The detectors, one per refinement, on the same frames."""

    seed: int = 0
    refinements: Sequence[Refinement] = REFINEMENTS

    def costs(self, frames: int, progress: Callable[[], None]) -> Iterator[Cost]:
        """Yields every refinement's CPU time on frames of two sizes, in turn so that disturbances affect all."""
        cv2.setNumThreads(1)
        for number, camera in enumerate((SMALL, LARGE)):
            detectors: dict[Refinement, Detector] = {n: Detector(MARKERS, camera, n) for n in self.refinements}
            spent: dict[Refinement, list[float]] = {name: [] for name in self.refinements}
            shots = crowds(camera, (NEAR, FAR), CROWD, frames + 1, self._rng(1, number), samples=4)
            for index, shot in enumerate(shots):
                for name, detector in detectors.items():
                    start = time.thread_time()
                    detector.detect(shot.image)
                    if index > 0:  # the first compiles and works out the rays
                        spent[name].append(time.thread_time() - start)
                progress()
            for name, times in spent.items():
                yield Cost(name, camera, frames, 1e3 * float(np.median(times)))

    def accuracy(self, distance: float, streak: float, count: int, progress: Callable[[], None]) -> list[Accuracy]:
        """Measures every refinement at one distance."""
        rng = self._rng(2, round(1000 * distance), round(1000 * streak))
        shots = placements(SMALL, distance, count, rng, streak=streak)
        return accuracies(self._detectors, shots, distance, streak, count, progress)

    def misreadings(self, extent: CornerExtent, progress: Callable[[], None]) -> Iterator[Misreadings]:
        """Counts wrong ids in clutter and crowded frames: with no refinement, as OpenCV reads them, and the last."""
        nobody = ((frozenset[int](), image) for image in clutter(SMALL, extent.clutter, self._rng(3)))
        crowded = crowds(SMALL, (NEAR, FAR), CROWD, extent.crowded, self._rng(4), samples=4)
        yield from self._misread("clutter", nobody, progress)
        yield from self._misread("six markers", ((frozenset(crowd.ids), crowd.image) for crowd in crowded), progress)

    def _misread(
        self, kind: str, frames: Iterable[tuple[frozenset[int], Image]], progress: Callable[[], None]
    ) -> Iterator[Misreadings]:
        names = (self.refinements[0], self.refinements[-1])
        seen, wrong, count = dict.fromkeys(names, 0), dict.fromkeys(names, 0), 0
        for there, image in frames:
            for name in names:
                sightings, _ = self._detectors[name].detect(image)
                seen[name] += len(sightings)
                wrong[name] += sum(sighting.id not in there for sighting in sightings)
            count += 1
            progress()
        for name in names:
            yield Misreadings(kind, name, count, seen[name], wrong[name])

    @cached_property
    def _detectors(self) -> dict[Refinement, Detector]:
        return {name: Detector(MARKERS, SMALL, name) for name in self.refinements}

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *stream])


def steps(extent: CornerExtent) -> int:
    """Returns how often a study of that extent reports progress."""
    still_and_moving = len(STILL) + len(MOVING)
    return 2 * (extent.timed + 1) + still_and_moving * extent.placements + extent.clutter + extent.crowded


def accuracies(
    detectors: Mapping[Refinement, Detector],
    shots: Iterable[Placement],
    distance: float,
    streak: float,
    count: int,
    progress: Callable[[], None],
) -> list[Accuracy]:
    """Measures each of the detectors on the same `count` shots of markers at one distance."""
    found: dict[Refinement, list[tuple[float, float, float]]] = {name: [] for name in detectors}
    wrong = dict.fromkeys(detectors, 0)
    for shot in shots:
        for name, detector in detectors.items():
            errors, strangers = errors_in(detector, shot)
            found[name] += errors
            wrong[name] += strangers
        progress()
    return [
        _accuracy(name, distance, streak, count, np.array(found[name]).reshape(-1, 3), wrong[name])
        for name in detectors
    ]


def errors_in(detector: Detector, shot: Placement) -> tuple[list[tuple[float, float, float]], int]:
    """Returns errors of distance (m) and bearing (rad), normalised squared errors, and the number of wrong ids.

    A detector that knows of its camera's rolling shutter is given the shot's motion.
    """
    sightings, _ = detector.detect(shot.image, shot.motion if detector.camera.readout else None)
    right = [sighting for sighting in sightings if sighting.id == shot.id]
    mounting = detector.camera.mounting
    z, cov = PropagatedNoise().measure(right, mounting)
    x, y = mounting[:2, :3] @ shot.pose[:3, 3] + mounting[:2, 3]
    errors: list[tuple[float, float, float]] = []
    for k, sighting in enumerate(right):
        miss = np.array([z[k, 0] - np.hypot(x, y), wrap(z[k, 1] - np.arctan2(y, x))])
        farther = np.linalg.norm(sighting.centre) - np.linalg.norm(shot.pose[:3, 3])
        errors.append((float(farther), float(miss[1]), float(miss @ np.linalg.solve(cov[k], miss))))
    return errors, len(sightings) - len(right)


def _accuracy(
    refinement: Refinement, distance: float, streak: float, count: int, errors: Array, wrong: int
) -> Accuracy:
    if len(errors) < 2:
        return Accuracy(refinement, distance, streak, count, len(errors), wrong, *[np.nan] * 5)
    (bias, bearing_bias, square), (sd, _, scatter) = errors.mean(axis=0).tolist(), errors.std(axis=0, ddof=1).tolist()
    nees, half = square / 2, NORMAL_95 * scatter / 2 / float(np.sqrt(len(errors)))
    return Accuracy(refinement, distance, streak, count, len(errors), wrong, bias, sd, bearing_bias, nees, half)

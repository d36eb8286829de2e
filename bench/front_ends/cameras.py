"""Measures what each effect of a real camera, and of print and paper, does to the sightings of markers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...datasets.rendering.marker_shots import Studio
from ...datasets.rendering.sensor import IDEAL, SENSORS, SRGB, Sensor
from ...datasets.rendering.sheet import PERFECT, Print
from ...frontend.markers.aruco import Detector, Refinement
from .corners import MARKERS, SMALL, Accuracy, accuracies

COMPARED: tuple[Refinement, ...] = ("subpix", "template")

DISTANCES = (1.0, 2.0, 3.0, 4.0)  # m

PACE = 250.0
"""px/s, at most, at which a marker moves through the image of a camera whose exposure or readout takes time."""


class Effect(NamedTuple):
    """A camera, or one effect of one, and the print of its markers."""

    name: str
    sensor: Sensor = IDEAL
    prints: Print = PERFECT
    modelled: bool = True  # detection is given the rolling shutter and the motion of the camera

    @property
    def streak(self) -> float:
        """px, at most, by which a marker is drawn out."""
        return PACE * self.sensor.exposure

    @property
    def skew(self) -> float:
        """px, at most, by which a marker moves while a frame is read."""
        return PACE * self.sensor.readout


EFFECTS = (
    Effect("ideal"),
    Effect("tone curve, sRGB", Sensor(tone=SRGB)),
    Effect("tone curve, gamma 1.8", Sensor(tone=1.8)),
    Effect("tone curve, gamma 2.4", Sensor(tone=2.4)),
    Effect("mosaic, bilinear", Sensor(mosaic="bilinear")),
    Effect("mosaic, edge-aware", Sensor(mosaic="edge-aware")),
    Effect("sharpening 0.8, 1.2 px", Sensor(sharpen=0.8, radius=1.2)),
    Effect("JPEG, quality 85", Sensor(jpeg=85)),
    Effect("JPEG, quality 70", Sensor(jpeg=70)),
    Effect("photon noise 0.02", Sensor(photon=0.02)),
    Effect("aberration 0.1 %", Sensor(aberration=0.001)),
    Effect("exposure 8 ms", Sensor(exposure=0.008)),
    Effect("rolling shutter 30 ms", Sensor(readout=0.03)),
    Effect("rolling shutter 30 ms, ignored", Sensor(readout=0.03), modelled=False),
    Effect("ink +0.5 %", prints=Print(ink=0.005)),
    Effect("ink -0.2 %", prints=Print(ink=-0.002)),
    Effect("curl +3 mm", prints=Print(curl=0.003)),
    Effect("curl -3 mm", prints=Print(curl=-0.003)),
    Effect("gloss 60", prints=Print(gloss=60.0)),
    *(Effect(name, SENSORS[name]) for name in ("phone", "webcam", "industrial")),
)


class CameraAccuracy(NamedTuple):
    """The accuracy of one refinement at one distance, on frames of one camera."""

    camera: str
    accuracy: Accuracy


@dataclass(frozen=True, eq=False)
class CameraStudy:
    """The same markers at the same places, seen by every camera."""

    seed: int = 0
    effects: Sequence[Effect] = EFFECTS

    def accuracy(self, distance: float, count: int, progress: Callable[[], None]) -> list[CameraAccuracy]:
        """Measures every refinement on the frames of every camera at one distance."""
        found = list[CameraAccuracy]()
        for effect in self.effects:
            studio = Studio(SMALL, sensor=effect.sensor, prints=effect.prints)
            rngs = (np.random.default_rng([self.seed, 5, round(1000 * distance), k]) for k in range(count))
            shots = (studio.place(distance, rng, effect.streak, effect.skew) for rng in rngs)
            detectors = self._detectors[effect.sensor.readout if effect.modelled else 0.0]
            rows = accuracies(detectors, shots, distance, effect.streak, count, progress)
            found += [CameraAccuracy(effect.name, row) for row in rows]
        return found

    @property
    def steps(self) -> int:
        """The number of times that a study of one placement per camera and distance reports progress."""
        return len(DISTANCES) * len(self.effects)

    @cached_property
    def _detectors(self) -> dict[float, dict[Refinement, Detector]]:
        """The detectors by the time of readout that they are given, s."""
        readouts = {0.0, *(effect.sensor.readout for effect in self.effects)}
        cameras = {readout: replace(SMALL, readout=readout) for readout in sorted(readouts)}
        return {
            readout: {name: Detector(MARKERS, camera, name) for name in COMPARED} for readout, camera in cameras.items()
        }

"""The camera's sensor and the markers' print, as options of a rendered world."""

from dataclasses import dataclass, replace

from ...core.options import option
from ...frontend.camera.camera import Camera
from ..rendering.sensor import LINEAR, MOSAICS, SENSORS, SRGB, Sensor
from ..rendering.sheet import Print


@dataclass(frozen=True)
class CameraOptions:
    """A sensor by name, any of its effects by itself, and the faults of printed markers; by default none."""

    sensor: str = option("ideal", "sensor and processing of the camera", choices=tuple(SENSORS))
    grain: float = option(2.0, "standard deviation of the sensor's noise, grey levels", minimum=0.0, maximum=40.0)
    photon: float | None = option(
        None, "variance of the photons' noise per grey level; none, here and below: that of `sensor`",
        minimum=0.0, maximum=1.0,
    )  # fmt: skip
    exposure: float | None = option(None, "exposure time, s, which causes motion blur", minimum=0.0, maximum=0.1)
    readout: float | None = option(
        None, "rolling shutter: time from the first row to the last, s", minimum=0.0, maximum=0.1
    )
    shutter: str = option(
        "modelled", "whether detection knows of the rolling shutter; ignored: as if it were a global one",
        choices=("modelled", "ignored"),
    )  # fmt: skip
    aberration: float | None = option(
        None, "share by which the red image is larger, and the blue one smaller, than the green one",
        minimum=-0.01, maximum=0.01,
    )  # fmt: skip
    mosaic: str | None = option(None, "Bayer filter, by how colours are interpolated", choices=tuple(MOSAICS))
    tone: float | str | None = option(
        None, "tone curve, a number being its gamma", minimum=1.0, maximum=3.0, choices=(LINEAR, SRGB)
    )
    sharpen: float | None = option(None, "amount of sharpening by an unsharp mask", minimum=0.0, maximum=3.0)
    sharpen_radius: float | None = option(None, "standard deviation of its blur, px", minimum=0.3, maximum=8.0)
    jpeg: int | None = option(None, "quality of JPEG compression; 0: not compressed", minimum=0, maximum=100)
    ink: float = option(
        0.0, "share of a marker's side by which black is wider at each edge; negative: narrower",
        minimum=-0.02, maximum=0.02,
    )  # fmt: skip
    curl: float = option(
        0.0, "bend of the paper: left and right edges in front of the middle, m; negative: behind it",
        minimum=-0.02, maximum=0.02,
    )  # fmt: skip
    gloss: float = option(0.0, "highlight of a lamp on the paper, grey levels", minimum=0.0, maximum=255.0)

    @property
    def made_sensor(self) -> Sensor:
        """The named sensor, with each effect that is given in place of its own."""
        names = ("photon", "exposure", "readout", "aberration", "mosaic", "tone", "sharpen", "jpeg")
        given = {name: getattr(self, name) for name in names} | {"radius": self.sharpen_radius}
        own = {name: value for name, value in given.items() if value is not None}
        return replace(SENSORS[self.sensor], grain=self.grain, **own)

    def known(self, camera: Camera) -> Camera:
        """The camera as detection knows it."""
        readout = self.made_sensor.readout if self.shutter == "modelled" else 0.0
        return replace(camera, readout=readout) if readout else camera

    @property
    def prints(self) -> Print:
        """The faults of the markers' print."""
        return Print(self.ink, self.curl, self.gloss)

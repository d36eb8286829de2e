"""A camera's sensor and what its processor makes of the light: from linear light to a grey picture of 8 bits.

In the order of a real camera: a rolling shutter reads row after row, a colour filter lets one of three colours through
to each pixel, photons and electronics add noise, the missing colours are interpolated, a tone curve makes shadows
lighter, edges are sharpened, and the picture is rounded to 8 bits and compressed. Each step is off by default, apart
from the noise of reading.

Tone curves are tables rounded to 1/256 of a grey level. OpenCV interpolates, sharpens and compresses: such pictures, as
all rendered ones, may differ in last bits between processors.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import cv2
import numpy as np
from scipy.special import ndtri

from ...core.se2 import Array
from ...frontend.markers.aruco import Image
from .lens import COLOURS, Singles

LINES = 10  # rows of a frame that a rolling shutter is taken to read at once
LEVELS = 65535 / 255  # levels of the converter behind the sensor, of 16 bits, per grey level

LINEAR, SRGB = "linear", "srgb"

MOSAICS: Mapping[str, int | None] = MappingProxyType(
    {"off": None, "bilinear": cv2.COLOR_BayerRGGB2RGB, "edge-aware": cv2.COLOR_BayerRGGB2RGB_EA}
)
"""A Bayer filter's interpolations, OpenCV's; off: a sensor without filter."""


@dataclass(frozen=True)
class Sensor:
    """A sensor and its processing; by default linear, in grey, and at rest in time."""

    grain: float = 2.0  # grey levels of linear light, standard deviation of the noise of reading
    photon: float = 0.0  # grey levels, the variance of the photons' noise per grey level of linear light
    exposure: float = 0.0  # s
    readout: float = 0.0  # s from the first row's exposure to the last's
    aberration: float = 0.0  # share by which the red image is larger, and the blue one smaller, than the green one
    mosaic: str = "off"  # how colours are interpolated, of MOSAICS
    tone: float | str = LINEAR  # LINEAR, SRGB, or a gamma
    sharpen: float = 0.0  # amount of an unsharp mask
    radius: float = 1.2  # px, standard deviation of the mask's blur
    jpeg: int = 0  # quality; 0: not compressed

    def delays(self, height: int) -> Array:
        """(bands,) s, when each band of LINES rows is exposed, from the middle of the frame; one band at rest."""
        if not self.readout:
            return np.zeros(1)
        first = np.arange(0, height, LINES)
        middle = (first + np.minimum(first + LINES, height)) / 2
        return self.readout * (middle / height - 0.5)

    def picture(self, light: Singles, rng: np.random.Generator) -> Image:
        """(height, width) the picture of `light`, grey levels of linear light, at least 0, which are overwritten.

        `light` is (height, width), or (3, height, width) in red, green and blue. The noise of reading takes one random
        byte per pixel from `rng`, and that of photons as many from a child of it.
        """
        raw = self._filtered(light)
        if self.photon:
            (photons,) = rng.spawn(1)
            raw += np.sqrt(np.float32(self.photon) * np.maximum(raw, 0)) * _normal(raw, self._quantiles, photons)
        raw += _normal(raw, self._grains, rng)
        grey = self._developed(raw)
        if self.sharpen:
            soft = np.asarray(cv2.GaussianBlur(grey, (0, 0), self.radius), np.float32)
            grey += np.float32(self.sharpen) * (grey - soft)
        picture = np.asarray(cv2.convertScaleAbs(np.maximum(grey, 0, out=grey)), np.uint8)
        return _compressed(picture, self.jpeg) if self.jpeg else picture

    @cached_property
    def curve(self) -> Singles:
        """(65536,) the grey level of each level of the converter, rounded to 1/256."""
        share = np.arange(65536) / 65535
        if self.tone == LINEAR:
            toned = share
        elif self.tone == SRGB:  # IEC 61966-2-1
            toned = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
        else:
            toned = share ** (1 / float(self.tone))
        return (np.round(255 * 256 * toned) / 256).astype(np.float32)

    @cached_property
    def _quantiles(self) -> Singles:
        """(256,) of a normal distribution, scaled to variance 1, indexed by one random byte per pixel."""
        return self._scaled(1.0)

    @cached_property
    def _grains(self) -> Singles:
        """(256,) likewise, of the noise of reading."""
        return self._scaled(self.grain)

    @staticmethod
    def _scaled(sd: float) -> Singles:
        quantiles = ndtri((np.arange(256) + 0.5) / 256)
        return (sd * quantiles / quantiles.std()).astype(np.float32)

    def _filtered(self, light: Singles) -> Singles:
        """(height, width) the light that reaches each pixel, through its colour filter or, without one, all of it."""
        if light.ndim == 2:
            return light
        red, green, blue = light
        if MOSAICS[self.mosaic] is None:
            return np.tensordot(COLOURS, light, axes=1)
        raw = green.copy()
        raw[::2, ::2], raw[1::2, 1::2] = red[::2, ::2], blue[1::2, 1::2]
        return raw

    def _developed(self, raw: Singles) -> Singles:
        """(height, width) grey levels of what was read: colours interpolated, tones by the curve."""
        code = MOSAICS[self.mosaic]
        if code is None and self.tone == LINEAR and not self.sharpen:
            return raw
        levels = np.rint(np.clip(raw * np.float32(LEVELS), 0, 65535)).astype(np.uint16)
        if code is None:
            return self.curve[levels]
        return self.curve[np.asarray(cv2.cvtColor(levels, code), np.uint16)] @ COLOURS


IDEAL = Sensor()

SENSORS: Mapping[str, Sensor] = MappingProxyType(
    {
        "ideal": IDEAL,
        "phone": Sensor(mosaic="edge-aware", tone=SRGB, sharpen=0.8, radius=1.2, jpeg=85),
        # At 1/125 s a marker is drawn out to 2 px where it moves through the image at 250 px/s.
        "webcam": Sensor(exposure=0.008, tone=2.2, jpeg=70),
        # A full well of 12,750 electrons: at a full 255 grey levels the noise of photons is of 2.3.
        "industrial": Sensor(photon=0.02, mosaic="bilinear"),
    }
)
"""Cameras with several effects at once."""


def _normal(like: Singles, table: Singles, rng: np.random.Generator) -> Singles:
    """Noise of the shape of `like`, by a `table` (256,) of its quantiles."""
    drawn = np.frombuffer(rng.bytes(like.size), np.uint8).reshape(like.shape)
    return np.asarray(cv2.LUT(drawn, table), np.float32)


def _compressed(picture: Image, quality: int) -> Image:
    """The picture after JPEG."""
    _, code = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, quality))
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_GRAYSCALE), np.uint8)

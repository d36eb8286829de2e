"""Cameras for a rendered drive: one of each lens model, 640x480, all mounted alike."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ...frontend.camera.camera import Camera, Model
from ...frontend.camera.mounting import mounting

MOUNTING = mounting(forward=0.12, left=0.0, up=0.75, tilt=np.deg2rad(20))


def _camera(
    focal: tuple[float, float], centre: tuple[float, float], *distortion: float, model: Model = "pinhole"
) -> Camera:
    return Camera(640, 480, focal, centre, distortion, MOUNTING, model)


_TILTED = (
    0.7188, 0.0664, -0.0005, 0.0003, 0.0009, 1.0495, 0.2306, 0.0027, 0.0012, -0.0004, -0.0009, 0.0003, 0.011, -0.008,
)  # fmt: skip

CAMERAS: Mapping[str, Camera] = MappingProxyType(
    {
        # 58 degrees across, barrel distortion of five coefficients: a webcam.
        "pinhole": _camera((576.4, 575.8), (321.7, 238.4), -0.208, 0.062, 0.0008, -0.0006, 0.0),
        # 97 degrees across; the rational model's eight coefficients.
        "wide": _camera(
            (379.2, 378.9), (317.9, 241.6), 0.7634, 0.0702, 0.0004, -0.0003, 0.0011, 1.1032, 0.2413, 0.0031
        ),
        # 84 degrees across; fourteen coefficients, with thin prisms and a sensor slightly tilted to its lens.
        "tilted": _camera((431.5, 430.8), (323.4, 236.2), *_TILTED),
        # 150 degrees across; the corners of its frames are beyond the field of view and black.
        "fisheye": _camera((245.6, 245.1), (320.8, 240.9), -0.0121, 0.0043, -0.0021, 0.0003, model="fisheye"),
    }
)

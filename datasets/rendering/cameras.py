"""Cameras for a rendered drive: one of each lens model, 640x480, all mounted alike."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ...frontend.camera.camera import Camera
from ...frontend.camera.mounting import mounting

MOUNTING = mounting(forward=0.12, left=0.0, up=0.75, tilt=np.deg2rad(20))

CAMERAS: Mapping[str, Camera] = MappingProxyType(
    {
        # 58 degrees across, barrel distortion of five coefficients: a webcam.
        "pinhole": Camera(
            width=640,
            height=480,
            focal=(576.4, 575.8),
            centre=(321.7, 238.4),
            distortion=(-0.208, 0.062, 0.0008, -0.0006, 0.0),
            mounting=MOUNTING,
        ),
        # 97 degrees across; the rational model's eight coefficients.
        "wide": Camera(
            width=640,
            height=480,
            focal=(379.2, 378.9),
            centre=(317.9, 241.6),
            distortion=(0.7634, 0.0702, 0.0004, -0.0003, 0.0011, 1.1032, 0.2413, 0.0031),
            mounting=MOUNTING,
        ),
        # 84 degrees across; fourteen coefficients, with thin prisms and a sensor slightly tilted to its lens.
        "tilted": Camera(
            width=640,
            height=480,
            focal=(431.5, 430.8),
            centre=(323.4, 236.2),
            distortion=(
                *(0.7188, 0.0664, -0.0005, 0.0003, 0.0009, 1.0495, 0.2306, 0.0027),
                *(0.0012, -0.0004, -0.0009, 0.0003),
                *(0.011, -0.008),
            ),
            mounting=MOUNTING,
        ),
        # 150 degrees across; the corners of its frames are beyond the field of view and black.
        "fisheye": Camera(
            width=640,
            height=480,
            focal=(245.6, 245.1),
            centre=(320.8, 240.9),
            distortion=(-0.0121, 0.0043, -0.0021, 0.0003),
            mounting=MOUNTING,
            model="fisheye",
        ),
    }
)

"""Latitude and longitude as metres east and north of an origin."""

import numpy as np

from ...core.elementary import sincos
from ...core.se2 import Array

AXIS, SQUARED = 6378137.0, 0.00669437999014
"""m, the larger half axis of the ellipsoid WGS84, and its squared eccentricity."""


def metres(degrees: Array, origin: Array) -> Array:
    """(n, 2) m east and north of `origin` (2,) of latitudes and longitudes `degrees` (n, 2).

    Equirectangular, with the ellipsoid's radii at the origin: within 10 km it is off by some metres in 10 km.
    """
    apart = degrees - origin
    apart[:, 1] -= 360 * np.rint(apart[:, 1] / 360)
    s, c = sincos(np.radians(origin[0]))
    inside = 1 - SQUARED * s**2
    across = AXIS / np.sqrt(inside)  # radius of curvature from east to west
    along = across * (1 - SQUARED) / inside  # and from south to north
    return np.column_stack((across * c * np.radians(apart[:, 1]), along * np.radians(apart[:, 0])))

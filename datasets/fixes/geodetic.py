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
    return np.radians(apart[:, ::-1]) * _radii(origin)


def degrees(metres: Array, origin: Array) -> Array:
    """(n, 2) latitudes and longitudes of places `metres` (n, 2), or of one, east and north of `origin` (2,)."""
    return origin + np.degrees(metres / _radii(origin))[..., ::-1]


def _radii(origin: Array) -> Array:
    """(2,) m that a radian of longitude and one of latitude are at the origin."""
    s, c = sincos(np.radians(origin[0]))
    inside = 1 - SQUARED * s**2
    across = AXIS / np.sqrt(inside)  # radius of curvature from east to west
    return np.array([across * c, across * (1 - SQUARED) / inside])  # and from south to north

"""Converts between our coordinates and others': points and range-bearing, covariances after and before a motion.

All are first order and exactly invertible, up to rounding.
"""

import numpy as np

from .elementary import arctan2, hypot, sincos
from .se2 import Array


def as_range_bearing(xy: Array, cov: Array) -> tuple[Array, Array]:
    """Points `xy` (s, 2) of the body frame, with `cov` (s, 2, 2), as range and bearing: (s, 2), and (s, 2, 2).

    C' = J C J' with J = [[x/r, y/r], [-y/r^2, x/r^2]].
    """
    x, y = xy.T
    r = hypot(x, y)
    xx, xy_, yy = cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]
    rr = (x * x * xx + 2 * x * y * xy_ + y * y * yy) / r**2
    rb = (x * y * (yy - xx) + (x * x - y * y) * xy_) / (r * r * r)
    bb = (y * y * xx - 2 * x * y * xy_ + x * x * yy) / (r * r) ** 2
    return np.stack((r, arctan2(y, x)), axis=-1), np.stack((rr, rb, rb, bb), axis=-1).reshape(-1, 2, 2)


def as_points(z: Array, cov: Array) -> tuple[Array, Array]:
    """Ranges and bearings `z` (s, 2), with `cov` (s, 2, 2), as points of the body frame: (s, 2), and (s, 2, 2).

    C' = J C J' with J = [[cos b, -r sin b], [sin b, r cos b]].
    """
    r, b = z.T
    s, c = sincos(b)
    rr, rb, bb = cov[:, 0, 0], r * cov[:, 0, 1], r * r * cov[:, 1, 1]
    xx = c * c * rr - 2 * c * s * rb + s * s * bb
    xy = c * s * (rr - bb) + (c * c - s * s) * rb
    yy = s * s * rr + 2 * c * s * rb + c * c * bb
    return np.stack((r * c, r * s), axis=-1), np.stack((xx, xy, xy, yy), axis=-1).reshape(-1, 2, 2)


def before_motion(delta: Array, cov: Array) -> Array:
    """Converts `cov` (m, 3, 3) from the body frame after the motions `delta` (m, 3) to the frame before them."""
    return _turned(delta[:, 2], cov)


def after_motion(delta: Array, cov: Array) -> Array:
    """Converts `cov` (m, 3, 3) from the body frame before the motions `delta` (m, 3) to the frame after them.

    GTSAM and g2o use the latter: their residual is taken at the motion's end.
    """
    return _turned(-delta[:, 2], cov)


def _turned(angle: Array, cov: Array) -> Array:
    """R C R' with R = diag(rotation by `angle` (m,), 1): symmetric to the last bit."""
    s, c = sincos(angle)
    xx, xy, xt = cov[:, 0, 0], cov[:, 0, 1], cov[:, 0, 2]
    yy, yt, tt = cov[:, 1, 1], cov[:, 1, 2], cov[:, 2, 2]
    rows = (
        (c * c * xx - 2 * c * s * xy + s * s * yy, c * s * (xx - yy) + (c * c - s * s) * xy, c * xt - s * yt),
        (c * s * (xx - yy) + (c * c - s * s) * xy, s * s * xx + 2 * c * s * xy + c * c * yy, s * xt + c * yt),
        (c * xt - s * yt, s * xt + c * yt, tt),
    )
    return np.moveaxis(np.array(rows), 2, 0)

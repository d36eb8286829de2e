"""A camera model and its mounting on the robot.

Pixels are OpenCV's: u to the right, v down, integers at the pixels' centres. The camera frame is x right, y down, z
forward. A ray is the point (x, y) at which it meets the plane z = 1 of the camera frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import cv2
import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from ...core.errors import InputError
from ...core.se2 import Array
from .response import Response

Model = Literal["pinhole", "fisheye"]

DISTORTION_LENGTHS: dict[str, tuple[int, ...]] = {"pinhole": (0, 4, 5, 8, 12, 14), "fisheye": (4,)}
"""The numbers of coefficients OpenCV accepts: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]], and k1 k2 k3 k4."""

_EXACT = 1e-8  # px; largest reprojection error of an undistorted pixel

_ROUNDS = 50
"""Most iterations; five to ten suffice away from the angle at which the lens model turns back."""

_SETTLED = 1e-14  # iteration steps, in rays or angles, that are mere rounding
_FAR = 1e3  # ray length treated as infinite: a thousandth of a radian from 90 degrees


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera with OpenCV's lens distortion, pinhole or fisheye, mounted on a robot.

    A lens model holds only out to some angle from its axis: farther out its polynomial turns back, and two rays share a
    pixel. Such rays, and for the fisheye all from 90 degrees on, are outside the camera's field of view.
    """

    width: int  # px
    height: int  # px
    focal: tuple[float, float]  # fx, fy, px
    centre: tuple[float, float]  # cx, cy, px
    distortion: tuple[float, ...]  # in OpenCV's order
    mounting: Array  # (4, 4) T_robot_camera: from the camera's frame to the robot's, m
    model: Model = "pinhole"
    response: Response | None = None  # None: not calibrated
    readout: float = 0.0  # s from the first row's exposure to the last's: a rolling shutter; 0: a global one
    projection: tuple[float, float, float, float] | None = None  # fx, fy, cx, cy, px, of its rectified images, if known
    name: str = ""  # of one of several on a robot

    @classmethod
    def unknown(cls, mounting: Array) -> "Camera":
        """A camera of which only the mounting is known: of 0 x 0 pixels."""
        return cls(0, 0, (0.0, 0.0), (0.0, 0.0), (), mounting)

    @property
    def known(self) -> bool:
        """True if more than its mounting is known."""
        return self.width > 0

    @property
    def distorted(self) -> bool:
        """True if the lens is not that of a pinhole alone."""
        return self.model == "fisheye" or any(self.distortion)

    @property
    def rectified(self) -> "Camera | None":
        """The camera of its rectified images, which have no distortion; None where its calibration does not tell."""
        if self.projection is None:
            return None if self.distorted else self
        fx, fy, cx, cy = self.projection
        return replace(self, focal=(fx, fy), centre=(cx, cy), distortion=(0.0,) * 5, model="pinhole")

    @property
    def settings(self) -> dict[str, Any]:
        """The camera as an entry of a log's notes."""
        if not self.known:
            return {"mounting": self.mounting.tolist()}
        response = {} if self.response is None else {"response": self.response.entries}
        return {
            "width": self.width,
            "height": self.height,
            "focal": self.focal,
            "centre": self.centre,
            "distortion": self.distortion,
            "mounting": self.mounting.tolist(),
            "model": self.model,
            **({"readout": self.readout} if self.readout else {}),
            **response,
        }

    def window(self, corner: tuple[int, int], size: tuple[int, int], binning: tuple[int, int] = (1, 1)) -> "Camera":
        """The camera of a part of its pixels, from `corner` on and of that `size`, px, combined by `binning` each way.

        A combined pixel's centre is that of its pixels, which for an even number is between two of them.
        """
        (x, y), (right, down) = corner, binning

        def part(fx: float, fy: float, cx: float, cy: float) -> tuple[float, float, float, float]:
            return fx / right, fy / down, (cx - x + 0.5) / right - 0.5, (cy - y + 0.5) / down - 0.5

        fx, fy, cx, cy = part(*self.focal, *self.centre)
        return replace(
            self,
            width=size[0] // right,
            height=size[1] // down,
            focal=(fx, fy),
            centre=(cx, cy),
            projection=None if self.projection is None else part(*self.projection),
        )

    @cached_property
    def matrix(self) -> Array:
        """(3, 3) K."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @cached_property
    def coefficients(self) -> Array:
        """(d,) the distortion as OpenCV expects it. InputError for an unknown model or number of coefficients."""
        lengths = DISTORTION_LENGTHS.get(self.model)
        if lengths is None:
            raise InputError(f"camera model: found {self.model!r}, expected pinhole or fisheye")
        if len(self.distortion) not in lengths:
            known = ("one of " if len(lengths) > 1 else "") + ", ".join(map(str, lengths))
            raise InputError(f"camera distortion: found {len(self.distortion)} coefficients, expected {known}")
        return np.array(self.distortion, float)

    @cached_property
    def reach(self) -> float:
        """The ray length |(x, y)| at which the lens model turns back; infinite where it does not.

        The pinhole models are judged by their radial part, which dominates far from the axis.
        """
        if self.model == "fisheye":
            return float(np.tan(self._widest))
        _, bottom, slope = self._radial
        return float(np.sqrt(min(_first_root(slope), _first_root(bottom))))

    @cached_property
    def rays(self) -> Array:
        """(height, width, 2) the ray of every pixel, computed once; NaN where a pixel has none."""
        v, u = np.mgrid[: self.height, : self.width]
        rays = self.undistort(np.stack((u.ravel(), v.ravel()), axis=-1).astype(float))
        return np.ascontiguousarray(rays.reshape(*u.shape, 2))

    def delays(self, rows: Array) -> Array:
        """(...) s, when `rows` (...), px, are exposed, from the middle of the frame, which its time and pose are of."""
        return self.readout * ((np.asarray(rows, float) + 0.5) / self.height - 0.5)

    def undistort(self, pixels: Array) -> Array:
        """Computes the rays (n, 2) of `pixels` (n, 2); each projects to its pixel again to 1e-8 px.

        NaN for a pixel that no ray within `reach` projects to, or where the iteration does not converge: past the angle
        at which the lens model turns back, and at 90 degrees and beyond.
        """
        if len(pixels) == 0:
            return np.zeros((0, 2))
        pixels = np.asarray(pixels, float)
        if self.model == "fisheye":
            return self._undistort_fisheye(pixels)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, _ROUNDS, 1e-12)
        points = np.ascontiguousarray(pixels).reshape(-1, 1, 2)
        rays = np.asarray(cv2.undistortPoints(points, self.matrix, self.coefficients, criteria=criteria), float)
        rays = rays.reshape(-1, 2)
        if len(self.distortion) == 0:
            return rays
        wrong = ~self._explains(rays, pixels)
        if wrong.any():
            rays[wrong] = self._newton(pixels[wrong])
        return rays

    def project(self, points: Array) -> Array:
        """Projects `points` (n, 3), m, in front of the camera and in its frame, to pixels (n, 2).

        Points beyond `reach` get the pixels of OpenCV's formula as well, which they share with other rays.
        """
        if len(points) == 0:
            return np.zeros((0, 2))
        points = np.ascontiguousarray(points, float).reshape(-1, 1, 3)
        take = cv2.fisheye.projectPoints if self.model == "fisheye" else cv2.projectPoints
        pixels, _ = take(points, np.zeros(3), np.zeros(3), self.matrix, self.coefficients)
        return np.asarray(pixels, float).reshape(-1, 2)

    @cached_property
    def _radial(self) -> tuple[Polynomial, Polynomial, Polynomial]:
        """The pinhole models' radial factor, in the squared ray length: numerator, denominator and slope.

        The slope is the derivative of length times factor by length, times the denominator squared.
        """
        k1, k2, _, _, k3, k4, k5, k6 = np.pad(self.coefficients, (0, 14))[:8]
        top, bottom, squared = Polynomial([1.0, k1, k2, k3]), Polynomial([1.0, k4, k5, k6]), Polynomial([0.0, 1.0])
        slope = (top + 2 * squared * top.deriv()) * bottom - 2 * squared * top * bottom.deriv()
        return top, bottom, slope

    @cached_property
    def _angular(self) -> tuple[Polynomial, Polynomial]:
        """The fisheye model's factor in the squared angle from the axis, and the slope of angle times factor."""
        return Polynomial([1.0, *self.coefficients]), Polynomial([1.0, *(self.coefficients * [3, 5, 7, 9])])

    @cached_property
    def _widest(self) -> float:
        """rad, the angle from the axis at which the fisheye model turns back: 90 degrees at most."""
        return float(min(np.sqrt(_first_root(self._angular[1])), np.pi / 2))

    def _undistort_fisheye(self, pixels: Array) -> Array:
        """Inverts the distorted angle, then returns the ray at that angle."""
        flat = (pixels - self.centre) / self.focal
        distorted = np.hypot(flat[:, 0], flat[:, 1])
        factor, slope = (part.coef for part in self._angular)
        angle = _invert(
            lambda a: (a * polyval(a**2, factor), np.asarray(polyval(a**2, slope), float)), distorted, self._widest
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            stretch = np.where(distorted > 0, np.tan(angle) / distorted, 1.0)
        return flat * stretch[:, None]

    def _newton(self, pixels: Array) -> Array:
        """Undistorts pixels at which the fixed-point iteration did not converge, as in the image's corners.

        Newton's method from the solution of the radial part alone, which dominates there.
        """
        flat = (pixels - self.centre) / self.focal
        distorted = np.hypot(flat[:, 0], flat[:, 1])
        top, bottom, slope = self._radial
        farthest = min(self.reach, _FAR)
        curve = lambda r: (r * top(r**2) / bottom(r**2), slope(r**2) / bottom(r**2) ** 2)  # noqa: E731
        length = _invert(curve, distorted, farthest)
        rays = flat * (length / np.maximum(distorted, 1e-300))[:, None]
        still = np.zeros(3)
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                points = np.column_stack((rays, np.ones(len(rays)))).reshape(-1, 1, 3)
                seen, slopes = cv2.projectPoints(points, still, still, self.matrix, self.coefficients)
                (a, b), (c, d) = np.moveaxis(slopes[:, 3:5].reshape(-1, 2, 2), 0, -1)  # by the shift: d pixel / d ray
                du, dv = (np.asarray(seen).reshape(-1, 2) - pixels).T
                step = np.stack((d * du - b * dv, a * dv - c * du), axis=-1) / (a * d - b * c)[:, None]
                if not (np.abs(step) > _SETTLED).any():
                    break
                rays = rays - np.nan_to_num(step, nan=0.0, posinf=0.0, neginf=0.0)
            rays[~self._explains(rays, pixels)] = np.nan
        return rays

    def _explains(self, rays: Array, pixels: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n,) which rays project to their pixels without passing the angle at which the lens model turns back."""
        points = np.column_stack((rays, np.ones(len(rays))))
        misses = np.abs(self.project(points) - pixels).max(axis=1)
        return (misses < _EXACT) & (np.hypot(rays[:, 0], rays[:, 1]) < self.reach)


def _first_root(polynomial: Polynomial) -> float:
    """The smallest positive real root; infinity where there is none."""
    roots = polynomial.roots()
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(real.min(initial=np.inf))


def _invert(curve: Callable[[Array], tuple[Array, Array]], values: Array, farthest: float) -> Array:
    """Solves curve(x) = `values` (n,) for a `curve` from the origin, with values and slopes, rising up to `farthest`.

    Newton's method within shrinking bounds; NaN for values that the curve does not reach.
    """
    hopeless = ~(values < curve(np.array([farthest]))[0])
    values = np.where(hopeless, 0.0, values)
    low, high = np.zeros_like(values), np.full_like(values, farthest)
    place = np.minimum(values, farthest / 2)
    for _ in range(_ROUNDS):
        reached, slope = curve(place)
        beyond = reached > values
        low, high = np.where(beyond, low, place), np.where(beyond, place, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            target = place - (reached - values) / slope
        target = np.where((target >= low) & (target <= high), target, (low + high) / 2)
        if (np.abs(target - place) <= _SETTLED * target).all():
            break
        place = target
    return np.where(hopeless, np.nan, place)

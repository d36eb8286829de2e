"""A differential-drive robot on a closed path: its true poses and its wheel counters' readings."""

from typing import NamedTuple

import numpy as np

from ...core.elementary import arctan2, exp, sincos
from ...core.se2 import Array, wrap
from ...core.small_matrices import product
from ...frontend.wheels.encoder import Encoder
from ...frontend.wheels.ticks import Ticks

RISE = 1.0  # s, time constant of the robot's acceleration

SLIP, SLIP_TAIL, SLIP_MOST = 0.01, 1.5, 0.2
"""The least slip of a wheel, m, the exponent of larger slips' frequency, and the largest, m.

An exponent below 2 would have no variance.
"""

TABLE = np.linspace(0.0, 2 * np.pi, 4097)  # angles of a lap at which its length is computed
SPIN = 0.3  # s, duration of a spin


class ClosedPath(NamedTuple):
    """A smooth closed path: x and y as Fourier series of the lap's angle."""

    cos: Array  # (h, 2) coefficients of cos(angle), cos(2 angle) ..., m
    sin: Array  # (h, 2)

    def at(self, angle: Array) -> tuple[Array, Array]:
        """The points (n, 2) at the angles (n,), and d point / d angle, (n, 2)."""
        order = np.arange(1, len(self.cos) + 1)
        turned = np.multiply.outer(angle, order)
        s, c = sincos(turned)
        points = product(c, self.cos) + product(s, self.sin)
        return points, product(-s * order, self.cos) + product(c * order, self.sin)

    @property
    def lap(self) -> float:
        """The length of a lap, m."""
        return float(self.ways(TABLE)[-1])

    def ways(self, angles: Array) -> Array:
        """(n,) m, the way to each of the `angles` (n,), evenly spaced, from the first."""
        pace = np.linalg.norm(self.at(angles)[1], axis=1)
        return np.concatenate(([0.0], np.cumsum((pace[1:] + pace[:-1]) / 2) * (angles[1] - angles[0])))


def drive(loop: ClosedPath, speed: float, t: Array) -> tuple[Array, Array]:
    """The true poses (n, 3) at the times `t` (n,), s, and the distance driven, (n,) m.

    The robot is at rest at angle 0 until t = 0, heads along the path, and accelerates to `speed` (m/s).
    """
    t = np.maximum(t, 0.0)
    way = speed * (t - RISE * (1 - exp(-t / RISE)))
    lengths = loop.ways(TABLE)
    points, tangents = loop.at(np.interp(np.mod(way, lengths[-1]), lengths, TABLE))
    return np.column_stack((points, wrap(arctan2(tangents[:, 1], tangents[:, 0])))), way


def count(poses: Array, way: Array, t: Array, encoder: Encoder, rng: np.random.Generator, slip: float = 0.0) -> Ticks:
    """The counters' readings along the true `poses` (n, 3), `way` (n,) m and times `t` (n,).

    Each wheel reads its rolled distance plus white noise of the variance that `encoder` states, in whole counts; and,
    not covered by that, a wheel spins or skids `slip` times per metre, on average.
    """
    turned = wrap(np.diff(poses[:, 2]))
    rolled = np.diff(way)[:, None] + encoder.base / 2 * turned[:, None] * np.array([-1.0, 1.0])
    noisy = rolled + np.sqrt(encoder.variance(rolled, np.diff(t))) * rng.standard_normal(rolled.shape)
    total = np.vstack((np.zeros(2), np.cumsum(slipped(noisy, way, t, slip, rng), axis=0)))
    return Ticks(t, np.round(total / np.array([encoder.left, encoder.right])))


def slipped(read: Array, way: Array, t: Array, rate: float, rng: np.random.Generator) -> Array:
    """(n - 1, 2) the wheels' readings with slips, from those without, `read`, in m.

    A Poisson process along the `way` (n,), `rate` per metre. Half of the time a wheel spins: it turns by some metres
    more than it rolls. The other half it skids: it stands still for some metres of the way. The lengths are drawn from
    a Pareto distribution, so that a few slips cause most of the error.
    """
    read = read.copy()
    for place in rng.uniform(way[0], way[-1], rng.poisson(rate * (way[-1] - way[0]))):
        wheel, spins = rng.integers(2), rng.uniform() < 0.5
        metres = min(float(slip_lengths(rng)), SLIP_MOST)
        axis, start, end = (way, place, place + metres)
        if spins:
            start = np.interp(place, way, t)
            axis, end = t, start + SPIN
        meanwhile = slice(np.searchsorted(axis, start, "right") - 1, np.searchsorted(axis, end) + 1)
        inside = np.diff(np.clip(axis[meanwhile], start, end))
        intervals = slice(meanwhile.start, meanwhile.start + len(inside))
        if spins:
            read[intervals, wheel] += metres * inside / SPIN
        else:
            read[intervals, wheel] *= 1 - inside / np.diff(axis[meanwhile])
    return read


def slip_lengths(rng: np.random.Generator, slips: int | None = None) -> Array:
    """(slips,) m, or one number, of SLIP times a Pareto variate with the exponent SLIP_TAIL, not truncated."""
    return SLIP * exp(rng.standard_exponential(slips) / SLIP_TAIL)

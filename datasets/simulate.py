"""A differential-drive robot on a closed path: its true poses, and what its wheel counters read."""

from typing import NamedTuple

import numpy as np

from ..frontend.encoder import Encoder
from ..frontend.motion import Ticks
from ..frontend.se2 import Array, wrap

RISE = 1.0
"""s, the time constant in which the robot gets up to speed."""


class Loop(NamedTuple):
    """A smooth closed path: x and y as Fourier series of the lap's angle."""

    cos: Array  # (h, 2) coefficients of cos(angle), cos(2 angle) ..., m
    sin: Array  # (h, 2)

    def at(self, angle: Array) -> tuple[Array, Array]:
        """The points (n, 2) at the angles (n,), and d point / d angle, (n, 2)."""
        order = np.arange(1, len(self.cos) + 1)
        turned = np.multiply.outer(angle, order)
        c, s = np.cos(turned), np.sin(turned)
        return c @ self.cos + s @ self.sin, (-s * order) @ self.cos + (c * order) @ self.sin


def drive(loop: Loop, speed: float, t: Array) -> tuple[Array, Array]:
    """The true poses (n, 3) at the times `t` (n,), s, and the way covered, (n,) m.

    The robot starts at rest at angle 0, heads along the path, and settles at `speed` (m/s).
    """
    way = speed * (t - RISE * -np.expm1(-t / RISE))
    table = np.linspace(0.0, 2 * np.pi, 4097)
    pace = np.linalg.norm(loop.at(table)[1], axis=1)
    lengths = np.concatenate(([0.0], np.cumsum((pace[1:] + pace[:-1]) / 2) * (table[1] - table[0])))
    points, tangents = loop.at(np.interp(np.mod(way, lengths[-1]), lengths, table))
    return np.column_stack((points, wrap(np.arctan2(tangents[:, 1], tangents[:, 0])))), way


def count(poses: Array, way: Array, t: Array, encoder: Encoder, rng: np.random.Generator) -> Ticks:
    """The counters' readings along the true `poses` (n, 3), `way` (n,) m and times `t` (n,).

    Each wheel reads what it rolled plus white noise of the variance that `encoder` states, in whole counts.
    """
    turned = wrap(np.diff(poses[:, 2]))
    rolled = np.diff(way)[:, None] + encoder.base / 2 * turned[:, None] * np.array([-1.0, 1.0])
    noisy = rolled + np.sqrt(encoder.variance(rolled, np.diff(t))) * rng.standard_normal(rolled.shape)
    total = np.vstack((np.zeros(2), np.cumsum(noisy, axis=0)))
    return Ticks(t, np.round(total / np.array([encoder.left, encoder.right])))

"""How the body of a robot with an inertial measurement unit rocks: smoothly, as its readings and its frames both see.

Pitch and roll are sums of oscillations, as of a body on springs, whose frequencies and phases are drawn.
"""

from dataclasses import dataclass

import numpy as np

from ...core.se2 import Array

BEATS, WAVES = (0.5, 1.5), 6  # Hz, between which the frequencies are, and how many of them pitch and roll have each


@dataclass(frozen=True, eq=False)
class Rocking:
    """Pitch and roll as functions of time."""

    size: float  # rad, of each wave
    frequency: Array  # (2, w) rad/s
    phase: Array  # (2, w) rad

    @classmethod
    def drawn(cls, sway: float, rng: np.random.Generator) -> "Rocking":
        """A body whose pitch and roll have the standard deviation `sway`, rad, over time."""
        frequency, phase = rng.uniform(*BEATS, (2, WAVES)), rng.uniform(0, 2 * np.pi, (2, WAVES))
        return cls(sway * np.sqrt(2 / WAVES), 2 * np.pi * frequency, phase)

    def at(self, t: Array) -> Array:
        """(n, 2) rad, pitch and roll at `t` (n,), s."""
        return self.size * np.sin(self.frequency * t[:, None, None] + self.phase).sum(axis=-1)

    def rates(self, t: Array) -> Array:
        """(n, 2) rad/s, how fast they change."""
        return self.size * (self.frequency * np.cos(self.frequency * t[:, None, None] + self.phase)).sum(axis=-1)

"""A body that rocks as it drives."""

from dataclasses import dataclass

import numpy as np

from ...core.se2 import Array

RATES, WAVES = (0.5, 1.5), 6  # Hz, between which a body rocks, and the number of waves of its pitch and of its roll


@dataclass(frozen=True, eq=False)
class Rocking:
    """Pitch and roll of a body that rocks smoothly, as its frames and its inertial readings both see.

    They are sums of oscillations, as of a body on springs, whose frequencies and phases are drawn.
    """

    size: float  # rad, of each wave
    frequency: Array  # (2, w) rad/s
    phase: Array  # (2, w) rad

    @classmethod
    def drawn(cls, sway: float, rng: np.random.Generator) -> "Rocking":
        """A body whose pitch and roll have the standard deviation `sway`, rad, over time."""
        frequency, phase = rng.uniform(*RATES, (2, WAVES)), rng.uniform(0, 2 * np.pi, (2, WAVES))
        return cls(sway * np.sqrt(2 / WAVES), 2 * np.pi * frequency, phase)

    def at(self, t: Array) -> Array:
        """(n, 2) rad, pitch and roll at `t` (n,), s."""
        return self.size * np.sin(self.frequency * t[:, None, None] + self.phase).sum(axis=-1)

    def rates(self, t: Array) -> Array:
        """(n, 2) rad/s, how fast they change."""
        return self.size * (self.frequency * np.cos(self.frequency * t[:, None, None] + self.phase)).sum(axis=-1)

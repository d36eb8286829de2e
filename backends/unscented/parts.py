"""Partial sightings and fixes in a joint belief, by the unscented transform: see `..gaussian.late_starts`."""

import numpy as np

from ...core.se2 import Array, Ints
from ..gaussian._ekf import STANDARD
from ..gaussian.joint import Joint
from ..gaussian.joint_parts import JointParts
from . import _partial


class UnscentedParts(JointParts):
    """The methods of `Parts` by sigma points over the entries that a measurement depends on.

    Their `scaling` is as in `_partial`. Landmarks held fixed are in `known` (., 2), number k as -1 - k. What
    places a landmark late is linearised at its place: sigma points as wide as a belief without prior information would
    say nothing of it.
    """

    def __init__(self, whole: Joint, known: Array, scaling: Array) -> None:
        super().__init__(whole, STANDARD)
        self._known, self._scaling = known, scaling

    def partly(self, entries: Ints, slot: int, kind: int, z: float, var: float, gate: float) -> tuple[int, float]:
        """Corrects by a partial sighting."""
        place = np.zeros(2) if slot >= 0 else self._known[-1 - slot]
        return _partial.partly(
            self._whole.address, 2 * self._whole.pairs, entries, place, kind, z, var, self._scaling, gate
        )

    def fixed(self, offset: int, z: Array, cov: Array, arm: Array, gate: float) -> tuple[int, float, int]:
        """Corrects by a fix."""
        pose = np.array((-3, -2, -1, offset), np.int64)
        return _partial.fixed(self._whole.address, 2 * self._whole.pairs, pose, z, cov, arm, self._scaling, gate)

"""Tells when a robot is no longer where it is thought to be, by Page's test on its sightings of the map."""

import numpy as np

from ...core.factors import UNKNOWN, Step
from ...core.se2 import Array, Ints, compose
from ._map_index import MapIndex
from ._watch import evidence

LOST = 10.0
"""Logarithm of the likelihood of chance over that of the pose, for sightings since some step, from which on the robot
is looked for. Where the pose is right this is reached with a probability below exp(-10) from any step (Wald)."""


class Watch:
    """Page's cumulative sum (Biometrika 41, 1954) of how much likelier sightings are by chance than at the pose."""

    def __init__(self, on: MapIndex) -> None:
        self._on = on
        self._row = {landmark: row for row, landmark in enumerate(on.ids.tolist())}
        self.reset()

    def reset(self) -> None:
        """Starts anew from a pose that is believed."""
        self.sum, self.since = 0.0, 0

    @property
    def lost(self) -> bool:
        """True where the robot is likely elsewhere, and has been for the last `since` steps."""
        return self.sum > LOST

    def step(self, before: Array, step: Step) -> None:
        """Adds a step after the pose `before`, to which its odometry leads from there."""
        pose, drift = before, np.zeros(2)
        if step.odometry is not None:
            pose = compose(before, step.odometry.delta)
            drift = np.array((np.trace(step.odometry.cov[:2, :2]) / 2, step.odometry.cov[2, 2]))
        ids, z, z_cov = step.sightings
        if len(ids):
            gain = evidence(self._on, pose, drift, self.rows(ids), np.array(z), np.array(z_cov))
            self.sum = max(0.0, self.sum - gain)
        self.since = self.since + 1 if self.sum > 0 else 0

    def rows(self, ids: Ints) -> Ints:
        """Returns the landmark of each sighting by its row in the map; -1: without an id, -2: not on the map."""
        return np.array([-1 if one == UNKNOWN else self._row.get(one, -2) for one in ids.tolist()], np.int64)

"""FastSLAM without ids: every particle decides by itself which landmark a sighting is of.

Montemerlo and Thrun, "Simultaneous localization and mapping with unknown data association using FastSLAM" (ICRA 2003);
Thrun, Burgard, Fox, Probabilistic Robotics (2005), chapter 13, without its evidence that a landmark exists. Particles
differ in what they took a sighting for; those that were wrong become unlikely later and have no descendants: so a
decision is taken back without a search.
"""

from math import log1p
from typing import Any

import numpy as np

from ...core.factors import UNKNOWN, Map, Prior, RangeBearing, Step
from ...core.se2 import Ints
from ..api import Belief, Unsuited
from ._choosing import choose
from ._own_maps import Decisions, keep
from ._particles import LOGGED, correct, move
from ._proposal import Motion
from .own_maps import OwnMaps
from .particle_paths import ParticlePaths
from .path_particles import PathParticles, with_blocks

WIDER = 2.0
"""A new landmark is as unlikely as one at the gate times this. A particle's landmarks are as sure as if its path were
the true one: where it is off, the gate alone would double them."""

NODE = 8  # decisions stored in one node of their tree

NO_MOTION = Motion(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 0)))


class AssociatingFastSlam(PathParticles):
    """FastSLAM with a decision for every sighting without an id in every particle.

    Map, ids and decisions given are those of the heaviest particle. An id that is known stays so in every particle. The
    n-th sighting of the log, from 0, makes up the id -2 - n where it is of a new landmark, the same in all particles;
    if one without an id is later sighted with one, that is its id from the start.

    Random numbers are those of `FastSlam`.
    """

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        if prior.loops:
            raise Unsuited("association=particle takes no loop closures, and the log has some; association=jcbb does")
        if prior.partial or prior.fixes:
            raise Unsuited(
                "association=particle takes whole sightings alone, and the log has others; association=jcbb does"
            )
        super().__init__(prior, options, rng)
        self._gate = -2 * WIDER * log1p(-options.new)
        self._maps = OwnMaps(options.particles)
        self._decisions = ParticlePaths(options.particles, np.zeros((0, NODE), np.int32))
        self._rows = np.zeros((0, options.particles), np.int32)  # of the last step's sightings
        self._sighted = 0  # sightings so far
        if prior.map is not None:
            self._maps.adopt(prior.map)

    def belief(self) -> Belief:
        """That of the particles, and the landmark that the heaviest has taken each sighting of the last step for."""
        best = self._heaviest()
        return super().belief()._replace(assigned=self._maps.of(best)[0][self._rows[:, best]])

    def map(self) -> Map:
        """The heaviest particle's map, with covariance given its path."""
        return self._map_of(self._heaviest())

    def assigned(self) -> Ints:
        """(s,) the landmark of every sighting so far, as the heaviest particle and its ancestors have taken it."""
        best = self._heaviest()
        rows = self._decisions.path(best).ravel()
        return self._maps.of(best)[0][rows[rows >= 0]]

    def _see(self, step: Step) -> None:
        """Samples the poses, decides on the sightings, weights the particles by them, and corrects their landmarks."""
        ids, z, cov = step.sightings
        ids, z, cov = sightings = RangeBearing(ids.copy("C"), z.copy("C"), cov.copy("C"))
        k, M, odometry = len(ids), len(self._weights), self._motion(step)
        motion = NO_MOTION if odometry is None else Motion(*odometry, self._normals())
        proposes = odometry is not None and self._options.version == 2
        if odometry is not None and not proposes:
            move(self._poses, *motion)
        self._maps.reserve(k)
        own = self._maps.landmarks
        decisions = Decisions(np.empty((k, M), np.int32), np.empty((k, 5, M)), np.zeros(M))
        choose(
            self._poses, proposes, motion, self._heaviest(), sightings, self._gate, UNKNOWN - 1 - self._sighted,
            own, decisions,
        )  # fmt: skip
        correct(self._poses, decisions.seen, np.arange(k), z, cov, np.empty(M), np.empty((-(-k // LOGGED), M)))
        keep(self._poses, sightings, own, decisions)
        if k:
            self._weigh(decisions.surprise)
        self._rows = rows = decisions.rows
        self._sighted += k
        for first in range(0, k, NODE):
            node = np.full((NODE, M), -1, np.int32)
            node[: k - first] = rows[first : first + NODE]
            self._decisions.add(node)

    def _copy(self, ancestors: Ints) -> None:
        """Copies maps and decisions."""
        self._maps.resampled(ancestors)
        self._decisions.resampled(ancestors)

    def _map_of(self, particle: int) -> Map:
        """A particle's map, with covariance given its path."""
        names, filters = self._maps.of(particle)
        return Map(names, filters[:, :2].copy(), with_blocks(np.zeros((2 * len(names),) * 2), filters[:, 2:]))

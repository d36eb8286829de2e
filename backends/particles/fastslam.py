"""FastSLAM 1.0 and 2.0 (Montemerlo, Thrun, Koller, Wegbreit, AAAI 2002 and IJCAI 2003): Rao-Blackwellized particles.

Each particle is a sample of the path with a small EKF for every landmark: given the path the landmarks are independent,
so M particles and N landmarks are M N filters of size two. Version 1.0 draws a particle's next pose from its odometry
alone and weights it by the sightings; version 2.0 draws it from odometry and sightings together, so that fewer
particles are wasted where sightings are sharper than odometry.

A loop closure is a measurement of a particle's pose from its own earlier one, which is a part of its path: version 1.0
weights particles by it, version 2.0 draws the pose from odometry, loop closures and sightings together.

Ranges and bearings alone, and fixes: see `parts`. Of these version 2.0 draws the pose too, but of no sighting of a
landmark that may still be in several places: the pose would be in several, too. Such ones weight particles, as in 1.0.
On logs with ranges or bearings alone, without fixes or a given map, nothing measures the start: all particles are then
at its mean, and its covariance, which turns and moves path and map together, is added to what they believe. Drawn, it
would take particles from the hypotheses, and their mean would be no path.

A gyro's bias is Gaussian in every particle, given its path: see `turns`.
"""

from functools import partial
from itertools import islice

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from ...core.gyro import Turn
from ...core.se2 import Array, Ints
from ..api import COMPILED_HERE, Belief, Builder, Expected, Solution
from ..vicinity import Vicinity
from . import _loops
from ._loops import Loops
from ._particles import LOGGED, correct, move, place
from ._proposal import Motion, propose
from .associating import AssociatingFastSlam
from .particle_maps import ParticleMaps
from .parts import PartialSightings
from .path_particles import Cloud, Options, PathParticles, with_blocks
from .turns import GyroBias


class FastSlam(PathParticles):
    """FastSLAM 2.0, or 1.0 with version=1: particles over the path, a 2x2 EKF for every landmark in each.

    The online pose is the particles' weighted mean; the solution is the path of the heaviest particle and its
    ancestors, with that particle's map. On a given map a particle cannot represent correlated landmark errors: only the
    2x2 blocks on the diagonal of the map's covariance are used, and a map without one is held fixed.

    Random numbers, in this order: at every step, the resampling's own, if any; then, where the pose is sampled,
    `standard_normal((3, M))`, rows that multiply the columns of a Cholesky factor: at the first step that of the
    prior's covariance, later, in version 1.0, of the odometry's covariance in the body frame, in 2.0 of the proposal's
    in the world frame.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        super().__init__(prior, options, rng)
        parts = prior.partial or prior.fixes
        self._parts = PartialSightings(prior, options.particles, options.gate) if parts else None
        self._maps = ParticleMaps(options.particles, self._parts.columns if self._parts else 5)
        self._vicinity = Vicinity()
        if prior.map is not None:
            self._adopt(prior.map)
        self._draws_start = self._parts is None or prior.fixes or prior.map is not None
        self._turn: Turn | None = None  # of the next step, where that has been told

    def foresee(self, turn: Turn | None) -> None:
        """Takes the next step's turn, by which sightings are expected."""
        self._turn = turn

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by mean and covariance of the weighted particles."""
        pose, cov = self._moments()
        cloud = self._cloud()
        if odometry is not None and self._bias is not None and self._turn is not None and self._started:
            cloud, odometry = self._ahead(self._bias, odometry, self._turn), None
            pose, cov = cloud.moments()
        new = list(islice(reversed(self._maps.row), len(self._maps) - len(self._vicinity)))
        return self._vicinity.expected(pose, cov, odometry, seen, gate, new[::-1], partial(self._marginals, cloud))

    def map(self) -> Map:
        """Weighted mean of the particles' maps; the covariance is the mixture's, within and between particles."""
        filters = self._maps.all()
        shared = 0.0 if self._parts is None else self._parts.shared(filters, self._weights)
        filters = self._marginal(filters)
        n, w = len(filters), self._weights
        xy = filters[:, :2] @ w
        apart = (filters[:, :2] - xy[..., None]).reshape(2 * n, len(w))
        cov = (apart * w) @ apart.T
        cov = with_blocks((cov + cov.T) / 2 + shared, filters[:, 2:] @ w)
        return Map(self._ids(), xy, cov if self._draws_start else cov + self._of_start(xy)[: 2 * n, : 2 * n])

    def belief(self) -> Belief:
        """That of the particles; a measurement is refused by those of more than half of the weight."""
        found = super().belief()
        if self._parts is None:
            return found
        cov = found.cov
        if cov is not None and self._started and not self._draws_start:
            cov = cov + self._of_start(found.pose[None, :2])
        return found._replace(cov=cov, refused=self._parts.refused(self._weights))

    def finish(self) -> Solution:
        """The path, map and constant errors of the heaviest particle; landmarks not placed are at their likeliest."""
        found, parts = super().finish(), self._parts
        if parts is None:
            return found
        best = self._heaviest()
        ids, xy, blocks = parts.unplaced(self._poses, best)
        filters = self._maps.all()
        placed, constant = self._marginal(filters)[..., best], parts.estimated(filters, ids, best, self._weights)
        within = np.concatenate((placed[:, 2:], blocks))
        cov = with_blocks(np.zeros((2 * len(within), 2 * len(within))), within)
        landmarks = Map(np.concatenate((self._ids(), ids)), np.concatenate((placed[:, :2], xy)), cov)
        return found._replace(map=landmarks, constant=constant)

    def _see(self, step: Step) -> None:
        """Samples the poses, weights them by the sightings, corrects landmarks and adds new ones."""
        self._turn = None
        ids, z, cov = step.sightings if self._parts is None else self._parts.take(step)
        rows = np.array([self._maps.row.get(landmark, -1) for landmark in ids.tolist()], np.int64)
        old, new = np.flatnonzero(rows >= 0), np.flatnonzero(rows < 0)
        slots = self._maps.slots(rows[old])
        loops = self._loops(step.loops) if self._prior.loops else None
        self._fold(self._motion(step), slots, np.take(z, old, axis=0), np.take(cov, old, axis=0), loops)
        for landmark, at, spread in zip(
            ids[new].tolist(), np.take(z, new, axis=0), np.take(cov, new, axis=0), strict=True
        ):
            slot = self._maps.add(landmark)
            place(self._poses, self._maps.filters, slot, at, spread)
        if self._parts is not None:
            self._weigh(self._parts.correct(self._poses, self._maps, self._weights))

    def _copy(self, ancestors: Ints) -> None:
        """Maps are updated on demand."""
        self._maps.resampled(ancestors)
        if self._parts is not None:
            self._parts.resampled(ancestors)

    def _map_of(self, particle: int) -> Map:
        """A particle's map, with covariance given its path."""
        filters = self._marginal(self._maps.all())[..., particle]
        within = with_blocks(np.zeros((2 * len(filters), 2 * len(filters))), filters[:, 2:])
        return Map(self._ids(), filters[:, :2].copy(), within)

    def _loops(self, loops: RelativePoses) -> Loops:
        """Loop closures with every particle's poses at the steps that they are to."""
        to, delta, cov = loops
        return Loops(self._paths.at(to), delta.copy("C"), cov.copy("C"))

    def _fold(self, motion: Odometry | None, slots: Ints, z: Array, cov: Array, loops: Loops | None) -> None:
        """Samples the poses, weights them by loop closures and sightings (k,) of known landmarks; corrects these."""
        M, k = len(self._weights), len(slots)
        distance, volume = np.zeros(M), np.ones((-(-k // LOGGED), M))
        seen = (self._maps.filters, slots, z, cov)
        if motion is not None and self._options.version == 2:
            moved = Motion(*motion, self._normals())
            if self._parts is not None:
                self._parts.propose(self._poses, moved, loops, self._maps, slots, z, cov, distance, volume)
            elif loops is None:
                propose(self._poses, moved, *seen, distance, volume)
            else:
                _loops.propose(self._poses, moved, loops, *seen, distance, volume)
            correct(self._poses, *seen, np.empty(M), np.empty_like(volume))  # already weighted by the marginals
        else:
            if motion is not None:
                move(self._poses, *motion, self._normals())
            if loops is not None:
                _loops.weigh(self._poses, loops, distance)
            correct(self._poses, *seen, distance, volume)
        if k > 0:
            self._weigh(distance + (np.log(volume).sum(axis=0) if k > LOGGED else np.log(volume[0])))
        elif self._parts is not None or (loops is not None and len(loops.delta)):
            self._weigh(distance)

    def _of_start(self, xy: Array) -> Array:
        """(2n + 1, 2n + 1) covariance of places (n, 2) and a heading at the end, by the prior's of the start.

        It moves and turns all of them together.
        """
        n = len(xy)
        J = np.zeros((2 * n + 1, 3))
        J[: 2 * n : 2, 0] = J[1 : 2 * n : 2, 1] = J[-1, 2] = 1.0
        J[: 2 * n : 2, 2], J[1 : 2 * n : 2, 2] = self._prior.pose[1] - xy[:, 1], xy[:, 0] - self._prior.pose[0]
        return J @ self._prior.cov @ J.T

    def _adopt(self, known: Map) -> None:
        """Gives every particle the same map: its covariance's diagonal blocks; held fixed without one."""
        for k, (landmark, xy) in enumerate(zip(known.ids.tolist(), known.xy, strict=True)):
            slot = self._maps.add(landmark)
            filters = self._maps.filters[slot]
            filters[:2] = xy[:, None]
            if self._parts is not None:
                self._parts.adopted(filters)
            if known.cov is not None:
                i, j = 2 * k, 2 * k + 1
                filters[2:5] = np.array((known.cov[i, i], known.cov[i, j], known.cov[j, j]))[:, None]

    def _ahead(self, bias: GyroBias, odometry: Odometry, turn: Turn) -> Cloud:
        """The particles after the next step's motion, by the wheels and its turn."""
        poses, surprise, cov = bias.ahead(self._poses, odometry, turn)
        likelier = self._log_weights - 0.5 * surprise
        weights = np.exp(likelier - likelier.max())
        weights /= weights.sum()
        to_world = np.zeros((len(weights), 3, 3))
        cos, sin = self._poses[3], self._poses[4]
        to_world[:, 0, 0], to_world[:, 0, 1], to_world[:, 1, 0], to_world[:, 1, 1] = cos, -sin, sin, cos
        to_world[:, 2, 2] = 1.0
        within: Array = (weights[:, None, None] * (to_world @ cov @ to_world.swapaxes(1, 2))).sum(axis=0)
        return Cloud(poses, weights, within)

    def _marginals(self, cloud: Cloud, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The mean pose, the landmarks' mean places and the mixture's joint covariance, the pose last."""
        n, w = 2 * len(landmarks), cloud.weights
        slots = self._maps.slots(np.array([self._maps.row[landmark] for landmark in landmarks], np.int64))
        filters = self._marginal(self._maps.filters[slots])
        xy = filters[:, :2] @ w
        at_start = np.array(self._prior.pose), np.zeros((3, len(w)))
        pose, error = cloud.scatter() if self._started else at_start
        apart = np.concatenate(((filters[:, :2] - xy[..., None]).reshape(n, len(w)), error))
        cov = (apart * w) @ apart.T
        if not self._started:  # nothing is drawn yet
            cov[-3:, -3:] = self._prior.cov
        if cloud.within is not None:
            cov[-3:, -3:] += cloud.within
        cov[:n, :n] = with_blocks(cov[:n, :n].copy(), filters[:, 2:] @ w)
        return pose, xy, (cov + cov.T) / 2

    def _marginal(self, filters: Array) -> Array:
        """(N, 5, M) landmarks' mean and covariance, of their filters (N, C, M)."""
        return filters if self._parts is None else self._parts.marginals(filters)

    def _ids(self) -> Ints:
        return np.fromiter(self._maps.row, np.int64, len(self._maps))


build = Builder(
    FastSlam,
    options=Options,
    random=True,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    implementation=COMPILED_HERE,
    rules={"particle": AssociatingFastSlam},
)

"""Converts our factors to GTSAM's: order of a measurement, frame of a covariance, names of variables.

GTSAM measures (bearing, range), and keeps pose covariances in the frame of the pose itself, where ours are in the world
frame, or, for odometry, in the frame before the motion. Every rotation between the two is done in this file.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial

import gtsam
import numpy as np

from ...core.factors import Map, Odometry, Prior, Step
from ...core.gyro import Bias
from ...core.partial import RANGE
from ...core.se2 import Array, Ints, rotation
from ..api import Expected
from ..common_options import LOSSES
from ..newcomers import Newcomers
from ..smoothing._graph import NEAR_SDS
from ..starting.late_places import LatePlaces, Seen
from ..vicinity import with_held
from .gtsam_parts import ConstantKeys, GyroBiases, fix_factors, part_factor

FIXED_SD = 1e-6
"""m; standard deviation that holds a landmark given without covariance in place."""

ESTIMATORS = {
    "huber": gtsam.noiseModel.mEstimator.Huber,
    "cauchy": gtsam.noiseModel.mEstimator.Cauchy,
    "geman-mcclure": gtsam.noiseModel.mEstimator.GemanMcClure,
}
"""Robust losses."""


NEAREST = 1e-3
"""m; least initial distance of a landmark from the robot: at zero distance its bearing has no derivative."""

FIRST_POSE, FIRST_LANDMARK = gtsam.symbol("x", 0), gtsam.symbol("l", 0)
"""Keys of the first pose and landmark; those of the others follow."""

BYTES = 4 * np.dtype(np.float64).itemsize
"""Bytes of a sighting's covariance."""


class Keys:
    """Variable names: x0, x1, ... for the poses, l0, l1, ... for landmarks in order of first sighting.

    An id may be any 64-bit number; GTSAM's symbols hold 56 bits. A forgotten landmark gets a new key when seen again.
    """

    def __init__(self) -> None:
        self.landmarks: dict[int, int] = {}
        self._named = 0

    @staticmethod
    def pose(step: int) -> int:
        """The key of the pose at `step`."""
        return FIRST_POSE + step

    def landmark(self, landmark: int) -> int:
        """The key of a landmark's position, created for a new id."""
        key = self.landmarks.get(landmark)
        if key is None:
            key = self.landmarks[landmark] = FIRST_LANDMARK + self._named
            self._named += 1
        return key


class Factors:
    """Converts a log's steps to GTSAM's factors, with initial values of new variables.

    Sightings and loop closures have the robust `loss`, with `loss_scale` in standard deviations, 0 being the loss's own
    of `LOSSES`. The sightings of a new landmark are held back until they determine its position and, with a loss, two
    agree, unless `at_once`. Partial ones are held back until they place it.
    """

    def __init__(self, prior: Prior, loss: str = "none", loss_scale: float = 0.0, at_once: bool = False) -> None:
        self.keys = Keys()
        self._prior = prior
        self.weighed = partial(_weighed, loss, loss_scale)
        """Gives a noise model the loss."""
        self.noise = lru_cache(64)(partial(_sighting_noise, loss, loss_scale))
        """The noise of a sighting, by the bytes of its covariance (2, 2) in GTSAM's order."""
        self._robust = loss != "none"
        self.closest = math.inf
        """m; the nearest sighting's range, or NEAR_SDS standard deviations of it if that is more."""
        self._newcomers = None if at_once else Newcomers(two=self._robust)
        self._late = LatePlaces()
        self.late = False
        """True if the last step has started a landmark by partial sightings that were held back."""
        self.constant = ConstantKeys(prior.systematic)
        """The constant errors' variables."""
        self.biases = GyroBiases(prior.gyro or Bias())
        """Those of a gyro's biases."""

    def prior(self) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The prior at step 0, the given map included."""
        graph, values, (pose, cov, known, *_) = gtsam.NonlinearFactorGraph(), gtsam.Values(), self._prior
        R = rotation(pose[2])
        graph.add(gtsam.PriorFactorPose2(self.keys.pose(0), pose2(pose), noise(R.T @ cov @ R)))
        values.insert(self.keys.pose(0), pose2(pose))
        if known is not None:
            _add_known_map(known, self.keys, graph, values)
        return graph, values

    def step(
        self,
        k: int,
        step: Step,
        guess: gtsam.Pose2,
        since: int = 0,
        estimated: Callable[[Sequence[int]], Array] | None = None,
        bias: Bias | None = None,
    ) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The factors of step `k`, and initial values of the variables they introduce, seen from pose `guess`.

        A new landmark is initialised by ArUco EKF SLAM, eq. (17). A held-back sighting is used if its step is not
        before `since`. `estimated` has the present estimates (k, 3) of the poses of k steps from there on, for
        landmarks that partial sightings place, `bias` that of a gyro's.
        """
        graph, values, here = gtsam.NonlinearFactorGraph(), gtsam.Values(), FIRST_POSE + k
        self.late = False
        if step.odometry is not None:
            values.insert(j=here, pose2=guess)  # by name: else GTSAM tries four conversions first
            graph.add(motion_factor(here - 1, here, step.odometry))
        if step.gyro is not None:
            self.biases.add(here, step.gyro, bias, graph, values)
        if len(step.loops.to):
            for to, delta, cov in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
                graph.add(motion_factor(self.keys.pose(to), here, Odometry(delta, cov), self.weighed))
        if self._robust and self._newcomers is not None:
            self._newcomers.move(step.odometry)
        if self._late.waits:
            self._late.move(step.odometry)
        if len(step.fixes.z):
            for one in fix_factors(here, self.constant.heading(graph, values), step.fixes):
                graph.add(one)
        if len(step.sightings.ids):
            self._add_sightings(k, step, guess, since, graph, values)
        if len(step.partial.ids) and estimated is not None:
            self._add_parts(k, step, guess, since, estimated, graph, values)
        return graph, values

    def _add_parts(
        self,
        k: int,
        step: Step,
        guess: gtsam.Pose2,
        since: int,
        estimated: Callable[[Sequence[int]], Array],
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> None:
        """Adds partial sightings of landmarks on the map, and of those that they place now, all that were held back."""

        def poses(steps: Sequence[int]) -> Array:
            before = estimated([one for one in steps if one < k])
            return np.concatenate((before, np.tile(array(guess), (len(steps) - len(before), 1))))

        for landmark, kind, z, var in zip(*(column.tolist() for column in step.partial), strict=True):
            self._late.hold(landmark, Seen(k, kind, z, var))
            if landmark not in self.keys.landmarks:
                xy = self._late.found(landmark, poses, since)
                if xy is None:
                    continue
                values.insert(self.keys.landmark(landmark), xy)
            held = self._late.taken(landmark, since)
            self.late = self.late or len(held) > 1
            self._add_held(landmark, held, graph, values)

    def _add_held(
        self, landmark: int, held: list[Seen], graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
    ) -> None:
        """Adds partial sightings of a landmark on the map."""
        for seen in held:
            errors = self.constant.of(landmark, graph, values) if seen.kind == RANGE else None
            pose, to = self.keys.pose(seen.step), self.keys.landmarks[landmark]
            graph.add(part_factor(pose, to, errors, seen, self.weighed))

    def _add_sightings(
        self,
        k: int,
        step: Step,
        guess: gtsam.Pose2,
        since: int,
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> None:
        """Adds whole sightings, with those that were held back until now."""
        here = FIRST_POSE + k
        known, covs = self.keys.landmarks, in_order(step.sightings.cov)  # once per step: one by one is slow
        add, factor, Rot2, noise_of = graph.add, gtsam.BearingRangeFactor2D, gtsam.Rot2, self.noise
        for i, (landmark, z) in enumerate(zip(step.sightings.ids.tolist(), step.sightings.z.tolist(), strict=True)):
            cov = covs[BYTES * i : BYTES * (i + 1)]
            if z[0] < self.closest:
                self.closest = min(self.closest, max(z[0], NEAR_SDS * math.sqrt(step.sightings.cov[i, 0, 0])))
            to = known.get(landmark)
            if to is None:
                if self._newcomers is not None:
                    held = self._newcomers.sighted(landmark, (k, step.sightings.z[i], step.sightings.cov[i]), since)
                    if not held:
                        continue
                    for at, z_before, cov_before in held[:-1]:
                        before = self.keys.pose(at), self.keys.landmark(landmark)
                        r, bearing = z_before.tolist()
                        add(factor(*before, Rot2(bearing), r, noise_of(in_order(cov_before[None]))))
                to = self.keys.landmark(landmark)
                r = max(z[0], NEAREST)
                values.insert(to, guess.transformFrom(np.array((r * math.cos(z[1]), r * math.sin(z[1])))))
                if self._late.waits:
                    held_back = self._late.taken(landmark, since)
                    self.late = self.late or len(held_back) > 0
                    self._add_held(landmark, held_back, graph, values)
            add(factor(here, to, Rot2(z[1]), z[0], noise_of(cov)))

    def forget(self, landmarks: Iterable[int]) -> None:
        """Removes these landmarks; sighted again they are new ones."""
        for landmark in landmarks:
            del self.keys.landmarks[landmark]

    def ended(self, path: Array) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The factors of landmarks that partial sightings have not started, which the whole `path` (n, 3) places."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for landmark, xy in self._late.ended(path):
            values.insert(self.keys.landmark(landmark), xy)
            self._add_held(landmark, self._late.taken(landmark), graph, values)
        return graph, values

    def with_newcomers(self, path: Array, landmarks: Map) -> Map:
        """The map, with landmarks still held back added without covariance, at their last sighting."""
        landmarks = self._late.added_to(landmarks, path)
        return landmarks if self._newcomers is None else self._newcomers.added_to(landmarks, path)

    def with_held(self, found: Expected, odometry: Odometry | None, last: int) -> Expected:
        """The expectation after step `last`, with landmarks that are held back."""
        held = self._newcomers.alone() if self._robust and self._newcomers is not None else {}
        return with_held(found, held, self._newcomers, odometry, last) if held and self._newcomers else found


def pose2(pose: Array) -> gtsam.Pose2:
    """(3,) as a Pose2."""
    return gtsam.Pose2(*pose.tolist())


def array(pose: gtsam.Pose2) -> Array:
    """Converts a Pose2 to (3,)."""
    heading = pose.theta()
    return np.array((pose.x(), pose.y(), heading if heading > -math.pi else math.pi))


def turned(delta: Array, cov: Array) -> Array:
    """Turns covariances (k, 3, 3) of motions (k, 3) from the frame before a motion to the one after it."""
    R = np.zeros_like(cov)
    s, c = np.sin(delta[:, 2]), np.cos(delta[:, 2])
    R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
    return R.swapaxes(1, 2) @ cov @ R


def in_order(cov: Array) -> bytes:
    """The covariances (k, 2, 2) of sightings in GTSAM's order, as bytes."""
    return cov[:, ::-1, ::-1].tobytes()


def noise(cov: Array) -> gtsam.noiseModel.Gaussian:
    """Converts a full covariance to a noise model."""
    return gtsam.noiseModel.Gaussian.Covariance(cov)


def to_world(pose: Array, cov: Array) -> Array:
    """Rotates GTSAM's marginal covariance (3, 3) from the pose's own frame to the world frame."""
    R = rotation(pose[2])
    return R @ cov @ R.T


def path_and_map(keys: Keys, steps: int, values: gtsam.Values) -> tuple[Array, Map]:
    """The poses (steps, 3) and the landmarks, without covariance, in `values`."""
    path = np.array([array(values.atPose2(keys.pose(k))) for k in range(steps)])
    return path, Map(
        ids(keys), np.array([values.atPoint2(key) for key in keys.landmarks.values()]).reshape(-1, 2), None
    )


def ids(keys: Keys) -> Ints:
    """(n,) the ids of the landmarks in the graph."""
    return np.fromiter(keys.landmarks, np.int64, len(keys.landmarks))


def joint_covariance(keys: Keys, marginals: gtsam.Marginals | gtsam.ISAM2) -> Array:
    """(2n, 2n) of all landmarks in the order of `keys`, which is GTSAM's too."""
    if not keys.landmarks:
        return np.zeros((0, 0))
    return marginals.jointMarginalCovariance(list(keys.landmarks.values())).fullMatrix()


def failure(error: Exception) -> str:
    """GTSAM's error message on one line, without its page of advice."""
    return "GTSAM: " + " ".join(str(error).split()).partition(" Thrown when")[0]


def motion_factor(
    before: int,
    after: int,
    motion: Odometry,
    weighed: Callable[[gtsam.noiseModel.Base], gtsam.noiseModel.Base] | None = None,
) -> gtsam.BetweenFactorPose2:
    """A motion between two poses; its covariance C rotated from the frame before the motion to the one after it.

    `weighed` gives a loop closure's noise its robust loss.
    R(dtheta)' C R(dtheta), entry by entry: this dominates the cost in Python of a step.
    """
    dx, dy, dtheta = motion.delta.tolist()
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = motion.cov.tolist()
    c, s = math.cos(dtheta), math.sin(dtheta)
    twice, along, across = 2 * c * s * xy, c * xt + s * yt, c * yt - s * xt
    mixed = c * s * (yy - xx) + (c * c - s * s) * xy
    turned = ((c * c * xx + twice + s * s * yy, mixed, along), (mixed, s * s * xx - twice + c * c * yy, across))
    model = noise(np.array((*turned, (along, across, tt))))
    if weighed is not None:
        model = weighed(model)
    return gtsam.BetweenFactorPose2(before, after, gtsam.Pose2(dx, dy, dtheta), model)


def _sighting_noise(loss: str, loss_scale: float, cov: bytes) -> gtsam.noiseModel.Base:
    """The noise of a sighting with covariance `cov`, the bytes of (2, 2) in GTSAM's order, and its robust loss."""
    return _weighed(loss, loss_scale, noise(np.frombuffer(cov).reshape(2, 2)))


def _weighed(loss: str, loss_scale: float, model: gtsam.noiseModel.Base) -> gtsam.noiseModel.Base:
    """The noise `model` with a robust loss."""
    if loss == "none":
        return model
    return gtsam.noiseModel.Robust.Create(ESTIMATORS[loss](loss_scale or LOSSES[loss]), model)


def _add_known_map(known: Map, keys: Keys, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """Adds a given map to `graph` and `values`: one joint Gaussian, or fixed landmarks where cov is None."""
    for landmark, xy in zip(known.ids.tolist(), known.xy, strict=True):
        values.insert(keys.landmark(landmark), xy)
    if known.cov is None:
        held = gtsam.noiseModel.Isotropic.Sigma(2, FIXED_SD)
        for landmark, xy in zip(known.ids.tolist(), known.xy, strict=True):
            graph.add(gtsam.PriorFactorPoint2(keys.landmark(landmark), xy, held))
    else:
        graph.add(_joint_prior([keys.landmark(i) for i in known.ids.tolist()], known.cov, values))


def _joint_prior(keys: list[int], cov: Array, values: gtsam.Values) -> gtsam.LinearContainerFactor:
    """The Gaussian with covariance `cov` (2n, 2n) around `values`, as one factor on all of `keys`.

    Python cannot create factors of many keys directly; a sum of pairwise quadratic ones can, and only that sum is
    positive definite.
    """
    information = np.linalg.inv(cov)
    block = [[information[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] for j in range(len(keys))] for i in range(len(keys))]
    zero, none = np.zeros(2), np.zeros((2, 2))
    pairs = gtsam.GaussianFactorGraph()
    for i, key in enumerate(keys):
        pairs.add(gtsam.HessianFactor(key, block[i][i], zero, 0.0))
        for j in range(i + 1, len(keys)):
            pairs.add(gtsam.HessianFactor(key, keys[j], none, block[i][j], zero, none, zero, 0.0))
    here = gtsam.Values()
    for key in keys:
        here.insert(key, values.atPoint2(key))
    return gtsam.LinearContainerFactor(gtsam.JacobianFactor(gtsam.HessianFactor(pairs)), here)

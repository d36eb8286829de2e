"""Fixed-lag smoothing by GTSAM: iSAM2 over the last seconds, older variables marginalised.

Poses and landmarks enter and leave as in `window/fixed_lag.py`, and constant errors stay.
"""

from collections import deque
from collections.abc import Sequence

import gtsam
import numpy as np

from ...core.factors import Map, Prior, Step
from ...core.gyro import Bias
from ...core.se2 import Array
from ..api import Belief, Diverged, Pose, Solution
from ..window.fixed_lag import Options
from ._gtsam import Factors, array, failure, pose2, to_world
from .gtsam_parts import FAILURES
from .isam2 import ahead


class GtsamFixedLag:
    """The incremental fixed-lag smoother (GTSAM): iSAM2 over poses and landmarks of the last seconds."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(options.relinearize_threshold)
        self._skip = 1 if prior.gyro is not None else options.relinearize_skip  # as in `isam2.parameters`
        params.relinearizeSkip = self._skip
        params.setFactorization("QR")
        params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(0.0))
        self._prior, self._options = prior, options
        self._smoother = gtsam.IncrementalFixedLagSmoother(options.lag, params)
        self._factors = Factors(prior, options.loss, options.loss_scale)
        self._pose = pose2(prior.pose)
        self._path: list[Array] = []  # of the poses that left the window
        self._window: deque[float] = deque()  # the times of those in it
        self._seen: dict[int, float] = {}  # landmark -> time of its last sighting, in this order
        self._given = () if prior.map is None else tuple(prior.map.ids.tolist())
        self._kept = -np.inf  # time of the given landmarks' last refresh
        self._gone: dict[int, Array] = {}  # landmark -> (2,) position when it last left

    def step(self, step: Step) -> Pose:
        """Adds the step's factors, drops variables older than the lag and returns the latest pose."""
        k = len(self._path) + len(self._window)
        bias = None if step.gyro is None else Bias(self._bias())
        guess = ahead(self._pose, step, bias)
        graph, values = self._factors.prior() if k == 0 else (gtsam.NonlinearFactorGraph(), gtsam.Values())
        more, more_values = self._factors.step(k, step, guess, len(self._path), self._estimated, bias)
        graph.push_back(more)
        values.insert(more_values)
        times = self._refreshed(k, step)
        leaving = self._let_go(step.t - self._options.lag)
        self._update(graph, values, times)
        self._factors.forget(leaving)
        self._pose = self._latest(k)
        return array(self._pose)

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        if not self._window:
            return Belief(self._prior.pose, self._prior.cov)
        pose = array(self._pose)
        key = self._factors.keys.pose(len(self._path) + len(self._window) - 1)
        return Belief(pose, to_world(pose, self._smoother.marginalCovariance(key)))

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at the last step; None without a gyro."""
        key = self._factors.biases.last
        if key is None:
            return self._prior.gyro
        return Bias(self._bias(), float(np.sqrt(self._smoother.marginalCovariance(key)[0, 0])))

    def map(self) -> Map:
        """Landmarks in the window at the current estimate, the others at their position when they last left."""
        if not self._window:
            return self._prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)
        inside = {i: self._smoother.calculateEstimatePoint2(key) for i, key in self._factors.keys.landmarks.items()}
        places = self._gone | inside
        return Map(np.fromiter(places, np.int64, len(places)), np.array([*places.values()]).reshape(-1, 2), None)

    def finish(self) -> Solution:
        """Each pose as it left the window, the last ones at the final estimate, relinearized once more."""
        for _ in range(self._options.final_checks * self._skip):
            self._update(gtsam.NonlinearFactorGraph(), gtsam.Values(), {})
        first = len(self._path)
        keys = [self._factors.keys.pose(first + i) for i in range(len(self._window))]
        last = [array(self._smoother.calculateEstimatePose2(key)) for key in keys]
        path = np.array([*self._path, *last]).reshape(-1, 3)
        landmarks = self._factors.with_newcomers(path, self.map())
        constant = self._factors.constant
        found = None
        if constant.used:
            at, cov_of = self._smoother.calculateEstimate(), self._smoother.marginalCovariance
            found = constant.read(landmarks.ids, at, cov_of)
        return Solution(path, landmarks, constant=found, gyro_bias=self.gyro_bias)

    def _bias(self) -> float:
        """The estimate of a gyro's bias at the last step, rad/s."""
        key = self._factors.biases.last
        if key is None:
            return 0.0 if self._prior.gyro is None else self._prior.gyro.mean
        return float(self._smoother.calculateEstimatePoint2(key)[0])

    def _estimated(self, steps: Sequence[int]) -> Array:
        """The estimates (k, 3) of the poses of k steps in the window."""
        keys = [self._factors.keys.pose(k) for k in steps]
        return np.array([array(self._smoother.calculateEstimatePose2(key)) for key in keys]).reshape(-1, 3)

    def _refreshed(self, k: int, step: Step) -> dict[int, float]:
        """Times assigned to variables by this step: its pose and landmarks, constant errors, a given map's when due."""
        keys = self._factors.keys
        self._window.append(step.t)
        ids = step.sightings.ids.tolist() + step.partial.ids.tolist()
        sighted = [landmark for landmark in ids if landmark in keys.landmarks]
        if self._given and self._kept <= step.t - self._options.lag / 2:
            sighted, self._kept = [*self._given, *sighted], step.t
        for landmark in sighted:
            self._seen.pop(landmark, None)
            self._seen[landmark] = step.t
        times = {keys.pose(k): step.t} | {keys.landmark(landmark): step.t for landmark in sighted}
        if self._factors.biases.last is not None:
            times[self._factors.biases.last] = step.t
        return times | dict.fromkeys(self._factors.constant.all, step.t)

    def _let_go(self, before: float) -> list[int]:
        """Stores every variable older than `before`, which the next update drops; returns the landmarks among them.

        Estimates are those of the last step: the update that adds the next one marginalises these together with it.
        """
        while self._window[0] < before:
            key = self._factors.keys.pose(len(self._path))
            self._path.append(array(self._smoother.calculateEstimatePose2(key)))
            self._window.popleft()
        leaving: list[int] = []
        for landmark, t in self._seen.items():
            if t >= before:
                break
            leaving.append(landmark)
        for landmark in leaving:
            del self._seen[landmark]
            self._gone.pop(landmark, None)
            self._gone[landmark] = self._smoother.calculateEstimatePoint2(self._factors.keys.landmark(landmark))
        return leaving

    def _update(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, times: dict[int, float]) -> None:
        """Adds factors."""
        try:
            self._smoother.update(graph, values, times)  # pyright: ignore[reportArgumentType] - Mapping is invariant  # ty: ignore[invalid-argument-type]
        except FAILURES as error:
            raise Diverged(failure(error)) from None

    def _latest(self, k: int) -> gtsam.Pose2:
        """The pose of step `k`."""
        try:
            pose = self._smoother.calculateEstimatePose2(self._factors.keys.pose(k))
        except FAILURES as error:
            raise Diverged(failure(error)) from None
        if not np.isfinite(array(pose)).all():
            raise Diverged("the latest pose is not finite")
        return pose

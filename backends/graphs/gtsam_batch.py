"""Minimises J by GTSAM's optimizers, from dead reckoning or from iSAM2's path: a check independent of our solver.

GTSAM's error is half of J. Graduated non-convexity is GTSAM's, too.
"""

import contextlib
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import gtsam
import numpy as np

from ...core.factors import Log, Map, Prior, Step
from ...core.gyro import Bias, Gyro
from ...core.se2 import Array
from ..api import Diverged, Solution
from . import isam2
from ._gtsam import Factors, failure, joint_covariance, path_and_map, pose2
from .distances import unevenness
from .first_values import by_headings
from .graph_options import Options
from .gtsam_parts import FAILURES, FIRST_BIAS
from .gtsam_whole import whole

CHUNK = 100
"""Most steps per iSAM2 update for the initial values: as good as one by one, and much cheaper."""

TURNED = 0.03
"""rad; fewer steps are given at once where odometry alone leaves the heading less certain than this (1 sd).

Worse initial values are useless: on Huang's circle, where odometry loses 2 degrees a second, chunks of 100 steps leave
Levenberg-Marquardt at a J two thousand times its minimum; with 0.1 it ends at 8.8 times that of `city-trees10000`.
"""

Params = TypeVar("Params", bound=gtsam.NonlinearOptimizerParams)

AT_ONCE, NEARLY = 10, 1e-6
"""A fit from a cheap start is trusted if after that many iterations the error falls by no more than that share."""

ROUNDING = 1e-11
"""Share of the error below which Levenberg-Marquardt damps more and more to find it fall: it is known no better."""

SIGHTINGS = (gtsam.BearingRangeFactor2D, gtsam.RangeFactor2D, gtsam.BearingFactor2D)
"""Factors that graduated non-convexity weighs; ranges with constant errors are kept as they are."""

INLIERS = 0.999
"""Share of correct sightings and loops that graduated non-convexity is to keep: chi-square, of 2 and of 3 dof."""


class Fit(NamedTuple):
    """A graph, its factors' names of variables, and the optimizer with their values."""

    factors: Factors
    graph: gtsam.NonlinearFactorGraph
    optimizer: gtsam.NonlinearOptimizer


class GtsamBatch:
    """Batch GraphSLAM by GTSAM."""

    def __init__(self, prior: Prior, options: Options, steps: Sequence[Step]) -> None:
        self._prior, self._options, self._steps = prior, options, steps
        self._log = Log.from_steps("batch", prior, steps)

    def optimum(self) -> Solution:
        """Path, map and, where J is curved in every direction, the map's joint covariance."""
        options = self._options
        try:
            fit = self._fitted()
            path, landmarks = self._found(fit)
        except FAILURES as error:
            raise Diverged(failure(error)) from None
        if not np.isfinite(path).all() or not np.isfinite(landmarks.xy).all():
            raise Diverged("the optimum is not finite")
        values, cov_of = fit.optimizer.values(), None
        if fit.factors.constant.used:
            with contextlib.suppress(*FAILURES):
                cov_of = gtsam.Marginals(fit.graph, values).marginalCovariance
        constant = fit.factors.constant.read(landmarks.ids, values, cov_of)
        bias = None if self._log.gyro is None else self._bias(self._log.gyro, fit)
        if not 0 < len(landmarks.ids) <= options.joint_up_to:
            return Solution(path, landmarks, constant=constant, gyro_bias=bias)
        with contextlib.suppress(*FAILURES):  # J may be flat in some direction, as for a landmark at the robot itself
            cov = joint_covariance(fit.factors.keys, gtsam.Marginals(fit.graph, fit.optimizer.values()))
            return Solution(path, landmarks._replace(cov=cov), constant=constant, gyro_bias=bias)
        return Solution(path, landmarks, constant=constant, gyro_bias=bias)

    @staticmethod
    def _bias(gyro: Gyro, fit: Fit) -> Bias:
        """The gyro's bias at the end; without a standard deviation where J is not curved."""
        key, values, sd = FIRST_BIAS + int(gyro.knot[-1]), fit.optimizer.values(), 0.0
        with contextlib.suppress(*FAILURES):
            sd = float(np.sqrt(gtsam.Marginals(fit.graph, values).marginalCovariance(key)[0, 0]))
        return Bias(float(values.atPoint2(key)[0]), sd)

    def _fitted(self) -> Fit:
        """All factors and the optimum, from the start that the options say."""
        options = self._options
        if options.start == "auto" and not self._robust:
            return self._chosen()
        fit = self._from(options.start)
        self._iterate(fit.optimizer, options.iterations)
        return fit

    def _chosen(self) -> Fit:
        """The first fit from a cheap start that is to be trusted, else the lowest one.

        Without loop closures iSAM2 gives one more start. With them it costs up to a hundred times as much as a fit.
        """
        most, loops, tried = self._options.iterations, len(self._log.loop_to) > 0, list[Fit]()
        for start in ("odometry", "headings") if loops else ("odometry",):
            with contextlib.suppress(Diverged, *FAILURES):
                fit = self._from(start)
                soon = self._iterate(fit.optimizer, min(AT_ONCE, most)) and self._iterate(fit.optimizer, most)
                tried.append(fit)
                if soon and unevenness(self._log, *self._found(fit)) <= 1:
                    return fit
        if not (loops and tried):
            tried.append(self._from("incremental"))
        lowest = min(tried, key=lambda fit: fit.optimizer.error())
        self._iterate(lowest.optimizer, most)
        return lowest

    def _from(self, start: str) -> Fit:
        """The whole graph with initial values; from a smoother with a robust loss where outliers are to be expected."""
        factors = self._factors()
        if start in ("odometry", "headings"):
            path = self._log.dead_reckoned() if start == "odometry" else by_headings(self._log)
            graph, values = whole(factors, self._log, path)
        else:
            late = self._robust or self._log.partial is not None or self._log.gyro is not None
            graph, values = self._robust_start(factors) if late else self._smoothed(factors)
        if self._options.gnc:
            graph = self._inliers(graph, values)
        return Fit(factors, graph, self._optimizer(graph, values))

    def _factors(self) -> Factors:
        options = self._options
        return Factors(self._prior, "none" if options.gnc else options.loss, options.loss_scale, at_once=True)

    @property
    def _robust(self) -> bool:
        return self._options.gnc or self._options.loss != "none"

    def _iterate(self, one: gtsam.NonlinearOptimizer, most: int) -> bool:
        """Iterates until the error rests; True if it does, or hardly falls in the last iteration."""
        before, fallen = one.error(), np.inf
        for _ in range(most):
            one.iterate()
            now = one.error()
            if not np.isfinite(now):
                raise Diverged("the error is not finite")
            fallen, before = (before - now) / before if before else 0.0, now
            if fallen <= max(self._options.relative_tolerance, ROUNDING):
                break
        return fallen <= NEARLY

    def _found(self, fit: Fit) -> tuple[Array, Map]:
        """The path and the map at which the optimizer is."""
        return path_and_map(fit.factors.keys, len(self._steps), fit.optimizer.values())

    def _optimizer(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.NonlinearOptimizer:
        """GTSAM's optimizer of the options."""
        if self._options.algorithm == "gauss-newton":
            return gtsam.GaussNewtonOptimizer(graph, values, self._set(gtsam.GaussNewtonParams()))
        if self._options.algorithm == "dogleg":
            return gtsam.DoglegOptimizer(graph, values, self._set(gtsam.DoglegParams()))
        return gtsam.LevenbergMarquardtOptimizer(graph, values, self._set(gtsam.LevenbergMarquardtParams()))

    def _smoothed(self, factors: Factors) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The whole graph, and iSAM2's estimate of it, which LM needs on long logs: from dead reckoning it diverges."""
        params = gtsam.ISAM2Params()
        params.relinearizeSkip = 1
        params.setFactorization("QR")
        isam = gtsam.ISAM2(params)
        pose = pose2(self._prior.pose)
        graph, values = factors.prior()
        held, turned = 0, 0.0  # steps since the last iSAM2 update, and the variance of their turns
        for k, step in enumerate(self._steps):
            if step.odometry is not None:
                pose = pose.compose(pose2(step.odometry.delta))
                turned += step.odometry.cov[2, 2]
            more, more_values = factors.step(k, step, pose)
            graph.push_back(more)
            values.insert(more_values)
            held += 1
            if held == CHUNK or turned > TURNED**2 or k == len(self._steps) - 1:
                isam.update(graph, values)
                pose = isam.calculateEstimatePose2(factors.keys.pose(k))
                graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
                held, turned = 0, 0.0
        return isam.getFactorsUnsafe(), isam.calculateBestEstimate()

    def _robust_start(self, factors: Factors) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The whole graph, and the estimate of an iSAM2 with a robust loss that processes the steps one by one.

        A landmark without two agreeing sightings starts at its first one.
        """
        loss = self._options.loss
        start = isam2.Options(loss="cauchy" if loss == "none" else loss, loss_scale=self._options.loss_scale)
        online = isam2.Isam2(self._prior, start, np.random.default_rng(0))
        for step in self._steps:
            online.step(step)
        path, landmarks, *_ = online.finish()
        graph, values = whole(factors, self._log, path)
        for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
            values.update(factors.keys.landmark(landmark), xy)
        return graph, values

    def _inliers(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.NonlinearFactorGraph:
        """The graph without what graduated non-convexity rejects; a landmark keeps its best sighting."""
        sightings = [i for i in range(graph.size()) if isinstance(graph.at(i), SIGHTINGS)]
        params = gtsam.GncLMParams(self._set(gtsam.LevenbergMarquardtParams()))
        params.setLossType(gtsam.GncLossType.TLS)
        params.setKnownInliers(sorted(set(range(graph.size())).difference(sightings, _loops(graph))))
        params.setAllowNonNoiseModelFactors(True)
        gnc = gtsam.GncLMOptimizer(graph, values, params)
        gnc.setInlierCostThresholdsAtProbability(INLIERS)
        values.update(gnc.optimize())
        weights = np.array(gnc.getWeights())
        best: dict[int, int] = {}
        for i in sightings:
            landmark = graph.at(i).keys()[1]
            if landmark not in best or weights[i] > weights[best[landmark]]:
                best[landmark] = i
        weights[list(best.values())] = 1.0
        kept = gtsam.NonlinearFactorGraph()
        for i in np.flatnonzero(weights > 0.5).tolist():
            kept.add(graph.at(i))
        return kept

    def _set(self, params: Params) -> Params:
        """Tolerances and the solver of linear systems from the options."""
        params.setRelativeErrorTol(self._options.relative_tolerance)
        params.setAbsoluteErrorTol(0.0)
        params.setMaxIterations(self._options.iterations)
        params.setLinearSolverType(self._options.linear.upper().replace("-", "_"))
        return params


def _loops(graph: gtsam.NonlinearFactorGraph) -> list[int]:
    """The loop closures: motions that are not the first one between consecutive poses, which is the odometry."""
    odometry, loops = set[int](), list[int]()
    for i in range(graph.size()):
        factor = graph.at(i)
        if not isinstance(factor, gtsam.BetweenFactorPose2):
            continue
        before, after = factor.keys()
        if after - before == 1 and after not in odometry:
            odometry.add(after)
        else:
            loops.append(i)
    return loops

"""g2o (Kuemmerle et al., ICRA 2011): a batch over the whole log, or one every so many steps, from the last estimate.

Motions and loop closures are its EdgeSE2, whose residual is ours in the frame after the motion: J is the same. A sighting
is its EdgeSE2PointXY, as it has none of range and bearing: a place in the robot's frame, with the covariance carried
over to first order. J then differs by what a bearing's noise curves, and the minimum with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import g2opy
import numpy as np

from ...core.factors import Map, Prior, Step
from ...core.options import option
from ...core.se2 import Array, act, compose, rotation
from .. import common_options
from ..api import Belief, Builder, Diverged, Pose, Solution, Unsuited
from ..common_options import LOSSES
from ..models import place

KERNELS: Mapping[str, str] = {"huber": "Huber", "cauchy": "Cauchy", "geman-mcclure": "GemanMcClure"}
FIRST_LANDMARK = 1 << 30
"""Its vertices have 32-bit numbers: landmarks follow this one, in order of first sighting."""


@dataclass(frozen=True)
class Options:
    """Settings."""

    every: int = option(
        0, "optimise every so many steps as well, for an online estimate; 0: at the end alone", minimum=0
    )
    algorithm: str = option("gauss-newton", "its algorithm", choices=("gauss-newton", "levenberg-marquardt", "dogleg"))
    linear: str = option("eigen", "its solver of linear systems", choices=("eigen", "pcg", "dense"))
    iterations: int = option(100, "most iterations", minimum=1)
    relative_tolerance: float = option(1e-10, "stop where J falls by a smaller share in one iteration", minimum=0)
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()


class G2o:
    """g2o: batch optimisation of the whole graph, from dead reckoning and first sightings."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options, self._given = options, prior.map
        self._graph: Any = g2opy.SparseOptimizer()
        self._graph.set_algorithm(_algorithm(options))
        self._graph.set_verbose(False)
        self._end: Any = g2opy.SparseOptimizerTerminateAction()
        self._end.set_gain_threshold(options.relative_tolerance)
        self._graph.add_post_iteration_action(self._end)
        self._poses: list[Any] = []
        self._landmarks: dict[int, Any] = {}
        self._pose: Pose = prior.pose
        self._start(prior)

    def step(self, step: Step) -> Pose | None:
        """Adds the step's vertex and edges; returns the pose if it optimises before the end."""
        k = len(self._poses)
        if step.odometry is not None:
            self._pose = compose(self._pose, step.odometry.delta)
            self._add_pose()
            self._add_motion(k - 1, k, step.odometry.delta, step.odometry.cov, weighed=False)
        last = len(self._poses) - 1
        for to, delta, cov in zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True):
            self._add_motion(to, last, delta, cov, weighed=True)
        if len(step.sightings.ids):
            at, _, by_z = place(np.zeros((len(step.sightings.ids), 3)), step.sightings.z)
            information = np.linalg.inv(by_z @ step.sightings.cov @ by_z.swapaxes(1, 2))
            for landmark, xy, one in zip(step.sightings.ids.tolist(), at, information, strict=True):
                self._add_sighting(last, landmark, xy, one)
        if not self._options.every:
            return None
        if len(self._poses) % self._options.every == 0:
            self._optimise(1)
            self._pose = _vector(self._poses[-1])
        return self._pose

    def belief(self) -> Belief | None:
        """The latest pose, without covariance; None where it optimises at the end alone."""
        return Belief(self._pose) if self._options.every else None

    def map(self) -> Map:
        """The landmarks at the current estimate, without covariance."""
        ids = np.fromiter(self._landmarks, np.int64, len(self._landmarks))
        return Map(ids, np.array([vertex.estimate() for vertex in self._landmarks.values()]).reshape(-1, 2), None)

    def finish(self) -> Solution:
        """Optimises until J hardly falls."""
        done = self._optimise(self._options.iterations)
        path = np.array([_vector(vertex) for vertex in self._poses])
        return Solution(path, self.map(), None, done < self._options.iterations)

    def _optimise(self, iterations: int) -> int:
        """Returns the number of iterations that it took."""
        self._graph.initialize_optimization()
        done = self._graph.optimize(iterations)
        if done < 0 or not np.isfinite(self._graph.chi2()):
            raise Diverged("g2o: the system of equations cannot be solved")
        return done

    def _start(self, prior: Prior) -> None:
        self._add_pose()
        edge = g2opy.EdgeSE2Prior()
        edge.set_vertex(0, self._poses[0])
        edge.set_measurement(_se2(prior.pose))
        R = rotation(prior.pose[2])
        edge.set_information(np.linalg.inv(R.T @ prior.cov @ R))
        self._graph.add_edge(edge)
        if prior.map is not None:
            if prior.map.cov is not None:
                raise Unsuited("g2o has no edge for a map with a joint covariance")
            for landmark, xy in zip(prior.map.ids.tolist(), prior.map.xy, strict=True):
                self._add_landmark(landmark, xy).set_fixed(True)

    def _add_pose(self) -> None:
        vertex = g2opy.VertexSE2()
        vertex.set_id(len(self._poses))
        vertex.set_estimate(_se2(self._pose))
        self._graph.add_vertex(vertex)
        self._poses.append(vertex)

    def _add_landmark(self, landmark: int, xy: Array) -> Any:
        vertex = g2opy.VertexPointXY()
        vertex.set_id(FIRST_LANDMARK + len(self._landmarks))
        vertex.set_estimate(xy)
        self._graph.add_vertex(vertex)
        self._landmarks[landmark] = vertex
        return vertex

    def _add_motion(self, before: int, after: int, delta: Array, cov: Array, *, weighed: bool) -> None:
        edge = g2opy.EdgeSE2()
        edge.set_vertex(0, self._poses[before])
        edge.set_vertex(1, self._poses[after])
        edge.set_measurement(_se2(delta))
        R = rotation(delta[2])
        edge.set_information(np.linalg.inv(R.T @ cov @ R))
        self._add_edge(edge, weighed=weighed)

    def _add_sighting(self, pose: int, landmark: int, xy: Array, information: Array) -> None:
        vertex = self._landmarks.get(landmark)
        if vertex is None:
            vertex = self._add_landmark(landmark, act(self._pose, xy))
        edge = g2opy.EdgeSE2PointXY()
        edge.set_vertex(0, self._poses[pose])
        edge.set_vertex(1, vertex)
        edge.set_measurement(xy)
        edge.set_information(information)
        self._add_edge(edge, weighed=True)

    def _add_edge(self, edge: Any, *, weighed: bool) -> None:
        loss = self._options.loss
        if weighed and loss != "none":
            kernel = getattr(g2opy, f"RobustKernel{KERNELS[loss]}")()
            kernel.set_delta(self._options.loss_scale or LOSSES[loss])
            edge.set_robust_kernel(kernel)
        self._graph.add_edge(edge)


def _se2(pose: Array) -> Any:
    return g2opy.SE2(*pose.tolist())


def _vector(vertex: Any) -> Pose:
    x, y, heading = vertex.estimate().to_vector()
    return np.array((x, y, heading if heading > -np.pi else np.pi))


def _algorithm(options: Options) -> Any:
    linear = {"eigen": g2opy.LinearSolverEigenX, "pcg": g2opy.LinearSolverPCGX, "dense": g2opy.LinearSolverDenseX}
    blocks = g2opy.BlockSolverX(linear[options.linear]())
    algorithms = {
        "gauss-newton": g2opy.OptimizationAlgorithmGaussNewton,
        "levenberg-marquardt": g2opy.OptimizationAlgorithmLevenberg,
        "dogleg": g2opy.OptimizationAlgorithmDogleg,
    }
    return algorithms[options.algorithm](blocks)


build = Builder(
    G2o, options=Options, loops=True, online=lambda options: options.every > 0, implementation="g2o's wheel"
)

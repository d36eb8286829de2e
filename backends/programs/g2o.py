"""g2o (Kuemmerle et al., ICRA 2011): a batch over the whole log, or one every so many steps, from the last estimate.

Motions and loop closures are its EdgeSE2, whose residual is ours in the frame after the motion: J is the same. A
sighting is its EdgeSE2PointXY, as it has none of range and bearing: a place in the robot's frame, with the covariance
carried over to first order. J then differs by what a bearing's noise curves, and the minimum with it.

The graph is handed over as its file format, which it reads forty times faster than edges are made one by one in Python.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
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
"""Vertices have 32-bit numbers: landmarks' follow this one, in order of first sighting."""


UPPER_2, UPPER_3 = np.triu_indices(2), np.triu_indices(3)
"""Entries of a symmetric matrix, in the order of its files."""


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
        self._options, self._prior = options, prior
        self._graph: Any = g2opy.SparseOptimizer()
        self._graph.set_algorithm(_algorithm(options))
        self._graph.set_verbose(False)
        end: Any = g2opy.SparseOptimizerTerminateAction()
        end.set_gain_threshold(options.relative_tolerance)
        self._graph.add_post_iteration_action(end)
        self._pose: Pose = prior.pose
        self._poses = 0  # vertices
        self._landmarks: dict[int, int] = {}  # vertex by id
        self._waiting = list[Step]()
        if prior.map is not None and prior.map.cov is not None:
            raise Unsuited("g2o has no edge for a map with a joint covariance")

    def step(self, step: Step) -> Pose | None:
        """Keeps the step; returns the pose if it optimises before the end."""
        self._waiting.append(step)
        if not self._options.every:
            return None
        if step.odometry is not None:
            self._pose = compose(self._pose, step.odometry.delta)
        if (self._poses + len(self._waiting)) % self._options.every == 0:
            self._optimise(1)
        return self._pose

    def belief(self) -> Belief | None:
        """The latest pose, without covariance; None where it optimises at the end alone."""
        return Belief(self._pose) if self._options.every else None

    def map(self) -> Map:
        """The landmarks at the last estimate, without covariance; none before the first."""
        ids = np.fromiter(self._landmarks, np.int64, len(self._landmarks))
        found = [self._graph.vertex(vertex).estimate() for vertex in self._landmarks.values()]
        return Map(ids, np.array(found).reshape(-1, 2), None)

    def finish(self) -> Solution:
        """Optimises until J hardly falls."""
        done = self._optimise(self._options.iterations)
        path = np.array([_pose(self._graph.vertex(k)) for k in range(self._poses)])
        return Solution(path, self.map(), None, done < self._options.iterations)

    def _optimise(self, iterations: int) -> int:
        """Adds the steps that wait, and returns the number of iterations that it took."""
        self._add()
        self._graph.initialize_optimization()
        done = self._graph.optimize(iterations)
        if done < 0 or not np.isfinite(self._graph.chi2()):
            raise Diverged("g2o: the system of equations cannot be solved")
        self._pose = _pose(self._graph.vertex(self._poses - 1))
        return done

    def _add(self) -> None:
        """Adds vertices and edges of the steps that wait."""
        steps, first = self._waiting, self._poses
        if not steps:
            return
        lines = list[str]() if first else self._first()
        path = [self._prior.pose if not first else _pose(self._graph.vertex(first - 1))]
        for step in steps[0 if first else 1 :]:
            assert step.odometry is not None  # of each but the first
            path.append(compose(path[-1], step.odometry.delta))
        here = path[1:] if first else path
        lines += [_line("VERTEX_SE2", first + k, *pose.tolist()) for k, pose in enumerate(here) if first + k > 0]
        lines += self._motions(steps, first) + self._sightings(steps, np.array(here), first)
        with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
            file = Path(folder) / "graph.g2o"
            file.write_text("\n".join([*lines, ""]), encoding="ascii")
            if not self._graph.load(str(file)):
                raise Diverged("g2o cannot read the graph")
        self._poses, self._waiting = first + len(steps), []
        if self._options.loss != "none":
            self._weigh()

    def _first(self) -> list[str]:
        """The first pose with its prior, and the given map."""
        R = rotation(self._prior.pose[2])
        information = np.linalg.inv(R.T @ self._prior.cov @ R)
        pose = self._prior.pose.tolist()
        lines = [_line("VERTEX_SE2", 0, *pose), _line("EDGE_PRIOR_SE2", 0, *pose, *information[UPPER_3].tolist())]
        if self._prior.map is not None:
            for landmark, xy in zip(self._prior.map.ids.tolist(), self._prior.map.xy.tolist(), strict=True):
                vertex = self._landmarks[landmark] = FIRST_LANDMARK + len(self._landmarks)
                lines += [_line("VERTEX_XY", vertex, *xy), f"FIX {vertex}"]
        return lines

    def _motions(self, steps: Sequence[Step], first: int) -> list[str]:
        """The edges of motions and loop closures, each covariance turned to the frame after the motion."""
        ends = list[tuple[int, int]]()
        delta, cov = list[Array](), list[Array]()
        for k, step in enumerate(steps, first):
            if step.odometry is not None:
                ends.append((k - 1, k))
                delta.append(step.odometry.delta)
                cov.append(step.odometry.cov)
            ends += [(to, k) for to in step.loops.to.tolist()]
            delta += list(step.loops.delta)
            cov += list(step.loops.cov)
        if not ends:
            return []
        moved, c, s = np.array(delta), *(f(np.array(delta)[:, 2]) for f in (np.cos, np.sin))
        R = np.zeros((len(ends), 3, 3))
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
        information = np.linalg.inv(R.swapaxes(1, 2) @ np.array(cov) @ R)[:, *UPPER_3]
        rows = zip(ends, moved.tolist(), information.tolist(), strict=True)
        return [_line("EDGE_SE2", *end, *motion, *upper) for end, motion, upper in rows]

    def _sightings(self, steps: Sequence[Step], path: Array, first: int) -> list[str]:
        """The vertices of new landmarks and the edges of sightings."""
        z = np.concatenate([step.sightings.z for step in steps])
        if not len(z):
            return []
        cov = np.concatenate([step.sightings.cov for step in steps])
        of = np.repeat(np.arange(len(steps)), [len(step.sightings.ids) for step in steps])
        at, _, by_z = place(np.zeros((len(z), 3)), z)
        information = np.linalg.inv(by_z @ cov @ by_z.swapaxes(1, 2))[:, *UPPER_2]
        lines, ids = list[str](), np.concatenate([step.sightings.ids for step in steps])
        new = [k for k in np.sort(np.unique(ids, return_index=True)[1]).tolist() if int(ids[k]) not in self._landmarks]
        for k, xy in zip(new, act(path[of[new]], at[new]).tolist(), strict=True):
            vertex = self._landmarks[int(ids[k])] = FIRST_LANDMARK + len(self._landmarks)
            lines.append(_line("VERTEX_XY", vertex, *xy))
        rows = zip((first + of).tolist(), ids.tolist(), at.tolist(), information.tolist(), strict=True)
        return lines + [_line("EDGE_SE2_XY", k, self._landmarks[one], *xy, *upper) for k, one, xy, upper in rows]

    def _weigh(self) -> None:
        """Gives sightings and loop closures their loss."""
        kernel = getattr(g2opy, f"RobustKernel{KERNELS[self._options.loss]}")
        for edge in self._graph.edges():
            ends = [vertex.id() for vertex in edge.vertices()]
            if len(ends) == 2 and ends[1] - ends[0] != 1 and edge.robust_kernel() is None:
                one = kernel()
                one.set_delta(self._options.loss_scale or LOSSES[self._options.loss])
                edge.set_robust_kernel(one)


def _line(tag: str, *values: float) -> str:
    return f"{tag} {' '.join(map(repr, values))}"


def _pose(vertex: Any) -> Pose:
    x, y, heading = vertex.estimate().to_vector()
    return np.array((x, y, heading if heading > -np.pi else np.pi))


def _algorithm(options: Options) -> Any:
    linear = {"eigen": g2opy.LinearSolverEigenX, "pcg": g2opy.LinearSolverPCGX, "dense": g2opy.LinearSolverDenseX}
    algorithms = {
        "gauss-newton": g2opy.OptimizationAlgorithmGaussNewton,
        "levenberg-marquardt": g2opy.OptimizationAlgorithmLevenberg,
        "dogleg": g2opy.OptimizationAlgorithmDogleg,
    }
    return algorithms[options.algorithm](g2opy.BlockSolverX(linear[options.linear]()))


build = Builder(
    G2o, options=Options, loops=True, online=lambda options: options.every > 0, implementation="g2o's wheel"
)

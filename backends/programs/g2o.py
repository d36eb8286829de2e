"""g2o (Kuemmerle et al., ICRA 2011): a batch over the whole log, or one every so many steps, from the last estimate.

Motions and loop closures are its EdgeSE2, whose residual is ours in the frame after the motion: J is the same. Its
wheel has no edge of range and bearing. A sighting is an EdgeSE2PointXY instead: with h(p) the range and bearing of a
place p in the robot's frame and H its Jacobian at p0, that place is measured as p0 + H^-1 (z - h(p0)), with information
H' C^-1 H. At first p0 is where z has it. The optimum is then linearised there again, until J no longer falls: the
residual at p0 is that of range and bearing, so that the end is the minimum of J.

The graph is handed over as its file format, which it reads forty times faster than edges are made one by one in Python.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Map, Prior, Step
from ...core.options import option
from ...core.se2 import Array, act, between, compose, rotation, summed
from ...core.truth.errors import rows_of
from .. import common_options
from ..api import Belief, Builder, Diverged, Pose, Solution, Unsuited
from ..common_options import LOSSES
from ..models import innovation, sight
from .columns import motions, sightings
from .extras import lacking, wheel

g2opy: Any = wheel("g2opy")

KERNELS: Mapping[str, str] = {
    "huber": "RobustKernelHuber",
    "cauchy": "RobustKernelCauchy",
    "geman-mcclure": "RobustKernelGemanMcClure",
}
"""Its class by the loss."""

FIRST_LANDMARK = 1 << 30
"""Vertices have 32-bit numbers: landmarks' follow this one, in order of first sighting."""

ROUNDS = 10
"""Linearisations of sightings, at most; four are the rule."""

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
        self._options, self._prior, self._graph = options, prior, _graph(options)
        self._pose: Pose = prior.pose
        self._steps = list[Step]()
        self._poses = 0  # vertices
        self._landmarks: dict[int, int] = {}  # vertex by id
        if prior.map is not None and prior.map.cov is not None:
            raise Unsuited("g2o has no edge for a map with a joint covariance")

    def step(self, step: Step) -> Pose | None:
        """Keeps the step; returns the pose if it optimises before the end."""
        self._steps.append(step)
        if not self._options.every:
            return None
        if step.odometry is not None:
            self._pose = compose(self._pose, step.odometry.delta)
        if len(self._steps) % self._options.every == 0:
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
        converged = self._optimise(self._options.iterations) < self._options.iterations
        if any(len(step.sightings.ids) for step in self._steps):
            converged = self._exact() and converged
        return Solution(self._path(), self.map(), None, converged)

    def _exact(self) -> bool:
        """Linearises sightings at the optimum until J hardly falls; False where it still does."""
        ids, z, cov, of = sightings(self._steps)
        edges = [edge for edge in self._edges() if isinstance(edge, g2opy.EdgeSE2PointXY)]
        before = np.inf
        for _ in range(ROUNDS):
            path, landmarks = self._path(), self.map()
            places = landmarks.xy[rows_of(landmarks.ids, ids)]
            at = between(path[of], np.column_stack((places, path[of, 2])))[:, :2]
            for edge, xy, information in zip(edges, *_measured(z, cov, at), strict=True):
                edge.set_measurement(xy)
                edge.set_information(information)
            self._graph.compute_active_errors()
            here = self._graph.active_robust_chi2()
            if before - here <= self._options.relative_tolerance * here:
                return True
            before = here
            self._optimise(self._options.iterations)
        return False

    def _path(self) -> Array:
        return np.array([_pose(self._graph.vertex(k)) for k in range(self._poses)])

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
        first = self._poses
        steps = self._steps[first:]
        if not steps:
            return
        path = self._reckoned(first)
        lines = list[str]() if first else self._first()
        new = slice(0 if first else 1, None)  # the first pose comes with its prior
        lines += _lines("VERTEX_SE2", first + np.arange(len(path))[new], path[new])
        lines += self._motions(steps, first) + self._sightings(steps, path, first)
        with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
            file = Path(folder) / "graph.g2o"
            file.write_text("\n".join([*lines, ""]), encoding="ascii")
            if not self._graph.load(str(file)):
                raise Diverged("g2o cannot read the graph")
        self._poses = first + len(steps)
        if self._options.loss != "none":
            self._weigh(lines, steps)

    def _reckoned(self, first: int) -> Array:
        """The poses of the steps from `first` on, by dead reckoning from the last estimate."""
        start = _pose(self._graph.vertex(first - 1)) if first else self._prior.pose
        motions = [step.odometry.delta for step in self._steps[max(first, 1) :] if step.odometry is not None]
        path = summed(start, np.array(motions).reshape(-1, 3))
        return path[1:] if first else path

    def _first(self) -> list[str]:
        """The first pose with its prior, and the given map."""
        R = rotation(self._prior.pose[2])
        information = np.linalg.inv(R.T @ self._prior.cov @ R)[UPPER_3]
        zero, pose = np.zeros(1, np.int64), self._prior.pose[None]
        lines = _lines("VERTEX_SE2", zero, pose) + _lines("EDGE_PRIOR_SE2", zero, pose, information[None])
        if self._prior.map is not None:
            vertices = FIRST_LANDMARK + np.arange(len(self._prior.map.ids))
            self._landmarks = dict(zip(self._prior.map.ids.tolist(), vertices.tolist(), strict=True))
            lines += _lines("VERTEX_XY", vertices, self._prior.map.xy) + _lines("FIX", vertices)
        return lines

    def _motions(self, steps: Sequence[Step], first: int) -> list[str]:
        """The edges of motions and loop closures, each covariance turned to the frame after the motion."""
        ends, delta, cov, _ = motions(steps, first)
        c, s = np.cos(delta[:, 2]), np.sin(delta[:, 2])
        R = np.zeros((len(ends), 3, 3))
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
        information = np.linalg.inv(R.swapaxes(1, 2) @ cov @ R)[:, *UPPER_3]
        return _lines("EDGE_SE2", ends, delta, information)

    def _sightings(self, steps: Sequence[Step], path: Array, first: int) -> list[str]:
        """The vertices of new landmarks and the edges of sightings, where these have them."""
        ids, z, cov, of = sightings(steps)
        at = z[:, :1] * np.column_stack((np.cos(z[:, 1]), np.sin(z[:, 1])))
        lines, places = list[str](), act(path[of], at)
        for k in np.sort(np.unique(ids, return_index=True)[1]).tolist():
            if int(ids[k]) not in self._landmarks:
                vertex = self._landmarks[int(ids[k])] = FIRST_LANDMARK + len(self._landmarks)
                lines += _lines("VERTEX_XY", np.array([vertex]), places[k : k + 1])
        xy, information = _measured(z, cov, at)
        vertices = np.array([self._landmarks[one] for one in ids.tolist()], np.int64)
        return lines + _lines("EDGE_SE2_XY", first + of, vertices, xy, information[:, *UPPER_2])

    def _weigh(self, lines: Sequence[str], steps: Sequence[Step]) -> None:
        """Gives the sightings and loop closures among the edges of those lines, the newest, their loss."""
        edges = [line.partition(" ")[0] for line in lines if line.startswith("EDGE")]
        prior, seen = edges.count("EDGE_PRIOR_SE2"), edges.count("EDGE_SE2_XY")
        weighed = [False] * prior + motions(steps)[3].tolist() + [True] * seen
        scale = self._options.loss_scale or LOSSES[self._options.loss]
        kernel: Any = getattr(g2opy, KERNELS[self._options.loss])
        for edge, robust in zip(self._edges()[-len(edges) :], weighed, strict=True):
            if robust:
                # Geman and McClure's delta is a squared error there, the others' an error.
                edge.set_robust_kernel(kernel(scale**2 if self._options.loss == "geman-mcclure" else scale))

    def _edges(self) -> list[Any]:
        """All edges, in the order in which they were added."""
        return sorted(self._graph.edges(), key=lambda edge: edge.internal_id())


def _measured(z: Array, cov: Array, at: Array) -> tuple[Array, Array]:
    """Places (s, 2) in the robot's frame, and their information (s, 2, 2), as sightings linearised at (s, 2) say."""
    expected, _, H = sight(np.zeros((len(at), 3)), at)
    off = np.linalg.solve(H, innovation(z.copy(), expected)[..., None])[..., 0]
    return at + off, H.swapaxes(1, 2) @ np.linalg.solve(cov, H)


def _lines(tag: str, *columns: NDArray[Any]) -> list[str]:
    """One line for each row of the columns, (n,) or (n, k), in so many digits that they are read as they are."""
    parts = [(part, "%d" if c.dtype.kind == "i" else "%.17g") for c in columns for part in np.atleast_2d(c.T).tolist()]
    form = " ".join((tag, *(form for _, form in parts)))
    return [form % row for row in zip(*(part for part, _ in parts), strict=True)]


def _pose(vertex: Any) -> Pose:
    x, y, heading = vertex.estimate().to_vector()
    return np.array((x, y, heading if heading > -np.pi else np.pi))


def _graph(options: Options) -> Any:
    """An empty graph with its solver, which ends where J hardly falls."""
    graph: Any = g2opy.SparseOptimizer()
    graph.set_algorithm(_algorithm(options))
    graph.set_verbose(False)
    end: Any = g2opy.SparseOptimizerTerminateAction()
    end.set_gain_threshold(options.relative_tolerance)
    graph.add_post_iteration_action(end)
    return graph


def _algorithm(options: Options) -> Any:
    linear = {"eigen": g2opy.LinearSolverEigenX, "pcg": g2opy.LinearSolverPCGX, "dense": g2opy.LinearSolverDenseX}
    algorithms = {
        "gauss-newton": g2opy.OptimizationAlgorithmGaussNewton,
        "levenberg-marquardt": g2opy.OptimizationAlgorithmLevenberg,
        "dogleg": g2opy.OptimizationAlgorithmDogleg,
    }
    return algorithms[options.algorithm](g2opy.BlockSolverX(linear[options.linear]()))


build = Builder(
    G2o,
    options=Options,
    loops=True,
    minimises=common_options.without_loss,
    online=lambda options: options.every > 0,
    implementation="g2o's wheel",
    lacks=lambda: lacking(g2opy, "g2opy"),
)

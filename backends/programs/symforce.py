"""SymForce (Martiros et al., RSS 2022): its Levenberg-Marquardt optimizer over the whole log, in C++.

SymForce generates code for residuals in C++, which its wheel cannot be given at run time; from Python it calls back for
each factor. Here the whole log is one factor with a sparse Jacobian, which NumPy computes for all edges at once: the
optimizer, its ordering and its factorization are SymForce's, the linearisation is not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from ...core.factors import Map, Prior, Step
from ...core.options import option
from ...core.se2 import Array, Ints, act, between, summed, wrap
from ...core.truth.errors import rows_of
from ..api import Belief, Builder, Diverged, Pose, Solution
from ..models import innovation, sight
from .columns import motions, sightings
from .extras import lacking, wheel

cc_sym: Any = wheel("cc_sym")
if cc_sym is not None:
    cc_sym.set_log_level("warning")  # else each process prints timings of its own when it ends


@dataclass(frozen=True)
class Options:
    """Settings."""

    iterations: int = option(100, "most iterations", minimum=1)
    relative_tolerance: float = option(1e-10, "stop where J falls by a smaller share in one iteration", minimum=0)
    damping: float = option(
        1e-8, "first damping; with SymForce's own 1 it ends above the minimum of long pose graphs", minimum=0
    )


class SymForce:
    """SymForce: batch optimisation of the whole graph, from dead reckoning and first sightings."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options, self._prior, self._steps = options, prior, list[Step]()
        known = prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)
        self._map = known

    def step(self, step: Step) -> Pose | None:
        """Keeps the step."""
        self._steps.append(step)
        return None

    def belief(self) -> Belief | None:
        """None: it has no online estimate."""
        return None

    def map(self) -> Map:
        """The landmarks without covariance; before the end those that were given."""
        return self._map

    def finish(self) -> Solution:
        """Optimises until J hardly falls."""
        graph = Graph(self._prior, self._steps)
        params = cc_sym.default_optimizer_params()
        params.iterations = self._options.iterations
        params.early_exit_min_reduction = self._options.relative_tolerance
        params.initial_lambda = self._options.damping
        values, keys = cc_sym.Values(), list[Any]()
        for letter, variables in (("x", graph.path), ("l", graph.xy[graph.free])):
            for k, variable in enumerate(variables):
                keys.append(cc_sym.Key(letter, k))
                values.set(keys[-1], variable)
        factor = cc_sym.Factor.jacobian(lambda now, _: graph.linearised(np.array(now.data())), keys, True)
        try:
            stats = cc_sym.Optimizer(params, [factor], "slamduel", keys).optimize(values)
        except (RuntimeError, ValueError) as error:
            raise Diverged(f"SymForce: {str(error).splitlines()[0]}") from None
        path, xy = graph.split(np.array(values.data()))
        if not np.isfinite(path).all():
            raise Diverged("SymForce: the path is not finite")
        path[:, 2] = wrap(path[:, 2])
        self._map = Map(graph.ids, xy, None)
        return Solution(path, self._map, None, "SUCCESS" in str(stats.status))


class Graph:
    """The factors of a log, each divided by its standard deviation, as functions of one vector of variables.

    Variables are the poses (n, 3), then the landmarks (m, 2), but those of a given map without covariance.
    """

    def __init__(self, prior: Prior, steps: Sequence[Step]) -> None:
        self._prior = prior
        moved = [step.odometry.delta for step in steps if step.odometry is not None]
        self.path = summed(prior.pose, np.array(moved).reshape(-1, 3))
        self._ends, self._delta, cov, _ = motions(steps)
        self._root = _whitening(cov)
        ids, self._z, cov, self._of = sightings(steps)
        self._sighted = _whitening(cov)
        known = prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)
        at = act(self.path[self._of], self._z[:, :1] * np.column_stack((np.cos(self._z[:, 1]), np.sin(self._z[:, 1]))))
        first = np.sort(np.unique(ids, return_index=True)[1])
        first = first[~np.isin(ids[first], known.ids)]
        self.ids: Ints = np.concatenate((known.ids, ids[first]))
        self.xy = np.vstack((known.xy, at[first]))
        self._landmark = rows_of(self.ids, ids)
        fixed = len(known.ids) if known.cov is None else 0
        self.free = np.arange(fixed, len(self.ids))
        self._given = None if known.cov is None else _whitening(known.cov[None])[0]
        self._places, self._order = self._pattern(), np.zeros(0, np.int64)

    def split(self, variables: Array) -> tuple[Array, Array]:
        """The path (n, 3), and the landmarks (m, 2), fixed ones included."""
        n = 3 * len(self.path)
        xy = self.xy.copy()
        xy[self.free] = variables[n:].reshape(-1, 2)
        return variables[:n].reshape(-1, 3).copy(), xy

    def linearised(self, variables: Array) -> tuple[Array, csc_matrix]:
        """The residuals (r,) and their Jacobian (r, variables)."""
        path, xy = self.split(variables)
        a, b = path[self._ends[:, 0]], path[self._ends[:, 1]]
        moved = between(a, b)
        off = moved - self._delta
        off[:, 2] = wrap(off[:, 2])
        c, s, one = np.cos(a[:, 2]), np.sin(a[:, 2]), np.zeros(len(a)) + 1.0
        by_b = _matrices(c, s, 0 * c, -s, c, 0 * c, 0 * c, 0 * c, one)
        by_a = -by_b
        by_a[:, 0, 2], by_a[:, 1, 2] = moved[:, 1], -moved[:, 0]
        expected, by_pose, by_landmark = sight(path[self._of], xy[self._landmark])
        start = path[0] - self._prior.pose
        start[2] = wrap(start[2])
        root = _whitening(self._prior.cov[None])[0]
        residuals = [root @ start, (self._root @ off[..., None]).ravel()]
        seen = -innovation(self._z.copy(), expected)
        residuals.append((self._sighted @ seen[..., None]).ravel())
        free = self._landmark >= self.free[0] if len(self.free) else np.zeros(len(self._landmark), bool)
        blocks = [
            root,
            self._root @ by_a,
            self._root @ by_b,
            self._sighted @ by_pose,
            (self._sighted @ by_landmark)[free],
        ]
        if self._given is not None:
            residuals.append(self._given @ (xy[: len(self._given) // 2] - self._prior_xy()).ravel())
            blocks.append(self._given)
        return np.concatenate(residuals), self._sparse(np.concatenate([block.ravel() for block in blocks]))

    def _prior_xy(self) -> Array:
        assert self._prior.map is not None  # it has a covariance
        return self._prior.map.xy

    def _pattern(self) -> tuple[Ints, Ints, tuple[int, int]]:
        """Rows and columns of the Jacobian's entries, in the order in which `linearised` lists them, and its shape."""
        n, motions_at, m, s = 3 * len(self.path), 3, len(self._ends), len(self._of)
        rows, columns = [np.repeat(np.arange(3), 3)], [np.tile(np.arange(3), 3)]
        for end in (0, 1):
            rows.append(np.repeat(motions_at + np.arange(3 * m), 3))
            columns.append((3 * self._ends[:, None, end : end + 1] + np.zeros((1, 3, 1), int) + np.arange(3)).ravel())
        sighted_at = motions_at + 3 * m
        rows.append(np.repeat(sighted_at + np.arange(2 * s), 3))
        columns.append((3 * self._of[:, None, None] + np.zeros((1, 2, 1), int) + np.arange(3)).ravel())
        fixed = len(self.ids) - len(self.free)
        free = self._landmark >= fixed
        rows.append(np.repeat((sighted_at + np.arange(2 * s)).reshape(-1, 2)[free].ravel(), 2))
        landmark = n + 2 * (self._landmark[free] - fixed)
        columns.append((landmark[:, None, None] + np.zeros((1, 2, 1), int) + np.arange(2)).ravel())
        end = sighted_at + 2 * s
        if self._given is not None:
            size = len(self._given)
            rows.append(np.repeat(end + np.arange(size), size))
            columns.append(np.tile(n + np.arange(size), size))
            end += size
        return np.concatenate(rows), np.concatenate(columns), (end, n + 2 * len(self.free))

    def _sparse(self, entries: Array) -> csc_matrix:
        """The matrix of these entries; its pattern is computed once, as no two are at one place."""
        rows, columns, shape = self._places
        if not len(self._order):
            numbered = csc_matrix((np.arange(1, len(entries) + 1), (rows, columns)), shape)
            self._order = np.asarray(numbered.data, np.int64) - 1
            self._inner, self._outer = numbered.indices, numbered.indptr
        return csc_matrix((entries[self._order], self._inner, self._outer), shape)


def _matrices(*entries: Array) -> Array:
    """(m, 3, 3) of their nine entries (m,), by rows."""
    return np.stack(entries, axis=-1).reshape(-1, 3, 3)


def _whitening(cov: Array) -> Array:
    """W (m, n, n) of covariances C (m, n, n), W' W = C^-1."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(cov)), np.float64) if len(cov) else cov


build = Builder(
    SymForce,
    options=Options,
    loops=True,
    online=False,
    minimises=True,
    implementation="SymForce's wheel, NumPy",
    lacks=lambda: lacking(cc_sym, "symforce"),
)

"""The forest of cliques and its root: updates by a step, and queries."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from ...core.kernels._cholesky import row_of
from ...core.kernels.compile_ahead import compile_ahead
from ...core.se2 import Array, Ints
from ..api import Diverged
from ..sighting_tables import Seen
from . import _cost, _covariances, _front, _graph, _log, _offsets, _opening, _ordering, _relinearise, _tree
from ._graph import (
    CLIQUES,
    DAMPING,
    FAILED,
    FULL,
    INTS,
    LAST,
    LINKS,
    LOSS,
    REALS,
    RESUM,
    ROOT,
    SIGHTINGS,
    STEPS,
    TODO,
    VARIABLES,
    WIDEST,
    WORK,
    Graph,
)  # fmt: skip
from ._step import SPARE_INTS, SPARE_REALS
from .arrays import made, with_front, with_root, with_rows

NOBODY = np.zeros(0, np.int64)

INDEFINITE_J = "the information matrix is not positive definite: J is flat, or numerical precision is exhausted"

NO_COVARIANCE = "the covariance of a motion is not positive definite: numerical precision is exhausted"

AS_MUCH = 2.0
"""Growth of work per variable since the last full ordering at which relinearising makes another."""

WIDE = 250
"""Scalars of the widest front of an order by minimum degree; where it has more, nested dissection is tried, too."""

SURE, SURE_TURN = 100.0, 0.1
"""Offsets below that many thresholds, and headings below that many rad, need no check of J without a loss."""

HALVINGS = 8  # number of halvings of a move that raises J before it is rejected
TOLERANCE = 1e-8  # m, rad; largest remaining offset of a variable at the end of the log

FALL = 1e-13
"""Relative decrease of J at the end of the log for another iteration; J is known no better."""

STILL, SMOOTH = 5e-6, 1e-9
"""m, rad; where a damped move that goes no further raises J, no place nearby is better.

If by more than that share of J, this is no minimum: J is not smooth there, as with a landmark at the robot itself.
"""

FIRST_DAMPING, MOST_DAMPING, TENFOLD = 1e-5, 1e15, 10.0
"""1/m^2, 1/rad^2; first and largest damping added to the information's diagonal where there is no step, and the factors
by which it is raised while there is none, and lowered after one."""


class Estimate(NamedTuple):
    """All estimates by the last solution, each variable moved all the way."""

    path: Array  # (n, 3)
    values: Array  # (v, 3) of variables
    furthest: float  # m, rad; of a variable from its linearisation point
    turn: float  # rad; the same of a heading


class Moved(NamedTuple):
    """A relinearisation."""

    furthest: float  # m, rad; the largest offset before
    share: float  # of all offsets that points were moved by; 0 where none lowers J
    rise: float = 0.0  # of J by the least share tried, where none lowers it


class Forest:
    """A factor graph, its forest of cliques and their root, which determines the last pose and its covariance."""

    def __init__(self, loss: int, scale: float, enough: float = 0.0) -> None:
        compile_ahead(f"{__package__}.kernels")
        self.g = made(loss, scale, enough)
        self.pose, self.cov = np.zeros(3), np.zeros((3, 3))
        self.cost = np.inf  # J at the last linearisation
        self._whole_variables = 0  # at the last full ordering

    def room(self, steps: int, variables: int, sightings: int, links: int, fresh: int) -> None:
        """Reserves room for that many more of each, `fresh` landmarks more in the root, and a clique of it."""
        g, state = self.g, self.g.state
        landmarks = int(state[ROOT]) + fresh
        size = 2 * landmarks + 6
        g = with_front(with_root(g, landmarks), size)
        g = with_rows(g, "steps", int(state[STEPS]) + steps)
        g = with_rows(g, "variables", int(state[VARIABLES]) + variables)
        g = with_rows(g, "sightings", int(state[SIGHTINGS]) + sightings)
        g = with_rows(g, "links", int(state[LINKS]) + links)
        g = with_rows(g, "cliques", int(state[CLIQUES]) + 1)
        self.g = _with_arenas(g, 2 * size + SPARE_INTS, size * size + SPARE_REALS)

    @property
    def stored(self) -> int:
        """The number of rows of sightings so far: this and what follows is as in `tables`."""
        return int(self.g.state[_graph.SIGHTINGS])

    def row(self, row: int) -> tuple[int, Seen]:
        """Part and sighting of a row."""
        return int(self.g.sightings[row, _graph.PART]), tuple(self.g.seen[row].tolist())

    def name(self, row: int, landmark: int, part: int) -> None:
        """Gives a row the variable of its landmark, and its part."""
        self.g.sightings[row, _graph.LANDMARK], self.g.sightings[row, _graph.PART] = landmark, part

    def add_pair(self, *, free: bool) -> int:
        """Adds a pair of constant errors at zero, held there unless `free`; returns its variable."""
        self.room(0, 1, 0, 0, 0)
        return _log.add_variable(self.g, 2 if free else 0, 0.0, 0.0, 0.0)

    def add_fix(self, fix: Array) -> int:
        """Adds a row (11,) of the table of fixes; returns its part in the sightings."""
        row = int(self.g.state[_graph.FIXED])
        self.g = with_rows(self.g, "fixed", row + 1)
        self.g.state[_graph.FIXED], self.g.fixed[row] = row + 1, fix
        return _graph.FIX - row

    def advance(self, x: int) -> None:
        """A plain step: the root becomes pose `x`, which sees its landmarks and new ones; there must be room."""
        _tree.advance(self.g, x)
        self.solve()

    def start(self) -> None:
        """The first step: the root is pose 0 and the landmarks it sees."""
        _tree.enter(self.g, 0)
        self.solve()

    def reorganise(self, x: int, wanted: Ints, touched: Ints = NOBODY, *, everything: bool = False) -> None:
        """Makes pose `x` and the landmarks `wanted` the root; `touched` variables are new or have new factors."""
        state = self.g.state
        if x != state[LAST] and not everything and not _relinearise.recentre(self.g):
            raise Diverged(INDEFINITE_J)
        opened, plan, count, left, room = _ordering.plan(self.g, x, wanted, touched, everything, False)
        if everything and room[2] > WIDE:
            other = _ordering.plan(self.g, x, wanted, touched, True, True)
            if other[-1][3] < room[3]:
                opened, plan, count, left, room = other
        ints, reals, widest, work = room.tolist()
        g = with_root(self.g, len(wanted))
        g = with_front(g, max(widest, 2 * len(wanted) + 3))
        if everything:  # the present cliques make room
            state[INTS], state[REALS], state[CLIQUES] = state[_graph.GIVEN_INTS], state[_graph.GIVEN_REALS], 1
            state[CLIQUES] += state[_graph.GIVEN]
        g = with_rows(g, "cliques", int(state[CLIQUES]) + count)
        self.g = _with_arenas(g, ints, reals)
        _tree.rebuild(self.g, x, wanted, opened, plan, count, left, everything)
        state[WIDEST] = widest if everything else max(state[WIDEST], widest)
        if everything:
            state[WORK], state[FULL] = -work, work
            self._whole_variables = int(state[VARIABLES])
        self.solve()

    def solve(self) -> None:
        """Eliminates pending cliques, and the root."""
        if not _front.solve(self.g, self.pose, self.cov):
            raise Diverged(INDEFINITE_J)

    def eliminate(self, order: Ints, damping: float) -> bool:
        """Eliminates everything again, the cliques `order` from last to first; False where J is flat."""
        g = self.g
        g.settings[DAMPING] = damping
        g.todo[: len(order)] = order[::-1]
        g.state[TODO], g.state[RESUM], g.state[FAILED] = len(order), 1, 0
        return _front.solve(g, self.pose, self.cov)

    def estimate(self, threshold: float = -1.0) -> Estimate:
        """Estimates everything, by substitution through all cliques, without side effects.

        What is not off by more than `threshold` (m, rad) stays at its linearisation point.
        """
        return self._solution(threshold)[1]

    def settled(self, iterations: int) -> tuple[Estimate, bool | None]:
        """Relinearises until nothing moves; the estimate, and whether this was reached, None without an iteration.

        Where no share of a move lowers J, moves are damped (Levenberg's way) until one does, or hardly moves anything.
        If J is flat where they end, there are no covariances: then the end is where damping began.
        """
        last, damping, converged = np.inf, 0.0, None
        undamped: tuple[Graph, Array, Array] | None = None
        for _ in range(iterations):
            moved = self.relinearise(0.0)
            if moved.share > 0.0:
                before, last = last, self.cost
                converged = damping == 0.0 and (moved.furthest <= TOLERANCE or before - last <= FALL * last)
                lower = damping / TENFOLD if damping > FIRST_DAMPING else 0.0
            else:
                still = undamped is not None and moved.furthest <= STILL
                converged = moved.rise <= (SMOOTH if still else FALL) * self.cost
                lower = np.inf if still else max(damping * TENFOLD, FIRST_DAMPING)
            if converged or lower > MOST_DAMPING:
                break
            if lower != damping:
                undamped = undamped or (self.g.copied(), self.pose.copy(), self.cov.copy())
                damping = self._eliminated(lower)
                if damping > MOST_DAMPING:
                    break
        if undamped is not None and damping > 0.0 and not self.eliminate(_offsets.top_down(self.g), 0.0):
            (self.g, self.pose, self.cov), converged = undamped, False
        return self.estimate(-1.0 if undamped is None else np.inf), converged

    def relinearise(self, threshold: float) -> Moved:
        """Moves linearisation points that are off by more than `threshold` (m, rad).

        If moving everything all the way raises J, half of the way is tried, then half of that, and so on, and finally
        none. J is only evaluated for large offsets.
        """
        g, state = self.g, self.g.state
        order, estimate, off, steps_off = self._solution(threshold)
        if estimate.furthest <= threshold:
            return Moved(estimate.furthest, 1.0)
        share = 1.0
        sure = estimate.furthest <= SURE * threshold and estimate.turn <= SURE_TURN and g.settings[LOSS] == 0
        if threshold == 0 or not sure:
            share, rise = self._share_that_falls(off, steps_off)
            if share == 0.0:
                return Moved(estimate.furthest, share, rise)
            if share < 1.0:
                _offsets.candidate(g, off, steps_off, share, threshold, estimate.path, estimate.values)
        again, total = _relinearise.settle(g, order, estimate.path, estimate.values)
        if again > total / 2 and total * self._whole_variables >= AS_MUCH * state[FULL] * state[VARIABLES]:
            self.reorganise(int(state[LAST]), g.root[: state[ROOT]].copy(), everything=True)
        else:
            self.solve()
        return Moved(estimate.furthest, share)

    def joint(self, landmarks: Ints) -> Array:
        """The joint covariance (2n + 3, 2n + 3) of landmark variables and the last pose, which is a variable."""
        other = Forest.__new__(Forest)
        other.pose, other.cov = np.zeros(3), np.zeros((3, 3))
        other.g = self.g.copied()
        last = int(self.g.state[LAST])
        seen = np.setdiff1d(_opening.sighted(self.g, last), landmarks)
        other.reorganise(last, np.concatenate((landmarks, seen)), everything=True)
        m = 2 * (len(landmarks) + len(seen)) + 3
        inverse: Array = solve_triangular(other.g.work[: m * row_of(m)].reshape(m, row_of(m))[:, :m], np.eye(m))
        rows = np.r_[: 2 * len(landmarks), m - 3 : m]
        return inverse[rows] @ inverse[rows].T

    def pose_covariances(self) -> Array:
        """(n, 3, 3) covariances of all steps' poses."""
        g = self.g.copied()
        out = np.zeros((g.state[STEPS], 3, 3))
        if not _covariances.pose_covariances(g, _offsets.top_down(g), int(g.state[WIDEST]), out):
            raise Diverged(NO_COVARIANCE)
        return out

    def _eliminated(self, damping: float) -> float:
        """Eliminates everything again, with at least this damping; the one that was enough, infinite where none is."""
        while not self.eliminate(_offsets.top_down(self.g), damping):
            damping = max(damping * TENFOLD, FIRST_DAMPING)
            if damping > MOST_DAMPING:
                return np.inf
        return damping

    def _share_that_falls(self, off: Array, steps_off: Array) -> tuple[float, float]:
        """The share of all offsets that lowers J; 0 if not even a small one does, and by how much that raises it."""
        g = self.g
        path, values = np.empty_like(steps_off), np.zeros_like(off)
        here = np.ascontiguousarray(g.steps[: len(path), _graph.POINT :])
        J, share = _cost.cost(g, here, g.values), 1.0
        for _ in range(HALVINGS):
            _offsets.candidate(g, off, steps_off, share, -1.0, path, values)
            self.cost = _cost.cost(g, path, values)
            if self.cost <= J:
                return share, 0.0
            share /= 2
        rise, self.cost = self.cost - J, J
        return 0.0, rise

    def _solution(self, threshold: float) -> tuple[Ints, Estimate, Array, Array]:
        """The cliques top down, the estimate moving what is off by more than `threshold`, and all offsets."""
        g, state = self.g, self.g.state
        order = _offsets.top_down(g)
        off, steps_off = np.zeros((state[VARIABLES], 3)), np.zeros((state[STEPS], 3))
        _offsets.offsets(g, order, off)
        if not _offsets.inner_offsets(g, off, threshold, steps_off):
            raise Diverged(NO_COVARIANCE)
        path, values = np.empty_like(steps_off), np.zeros_like(off)
        furthest, turn = _offsets.candidate(g, off, steps_off, 1.0, threshold, path, values)
        return order, Estimate(path, values, furthest, turn), off, steps_off


def _with_arenas(g: Graph, ints: int, reals: int) -> Graph:
    """`g` with room for that many more entries in its arenas."""
    g = with_rows(g, "ints", int(g.state[INTS]) + ints)
    return with_rows(g, "reals", int(g.state[REALS]) + reals)

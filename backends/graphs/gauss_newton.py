"""Gauss-Newton with a line search on a forest of fixed structure.

The full step is tried first, then half of it, then a quarter, until J falls. Evaluating J costs a small part of an
elimination, while a rejected step costs Levenberg-Marquardt a whole one. Damping is used only where J is flat in some
direction, so that there is no step, or where no share of one lowers J. From dead reckoning, where most steps are too
long, this takes fewer eliminations than Levenberg-Marquardt or Powell's dogleg, and ends lower: on a city of 1,000
landmarks 9, where they take 22 and 12, and on Victoria Park at a J of 1.5e5, where they end at 5.2e5 and 1.7e5.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Ints
from ..api import Diverged
from ..smoothing import _cost, _offsets
from ..smoothing._graph import CLIQUES, FAILED, POINT, STEPS, VARIABLES
from ..smoothing.forest import FIRST_DAMPING, INDEFINITE_J, MOST_DAMPING, NO_COVARIANCE, SMOOTH, STILL, TENFOLD, Forest
from . import _whole_log

LEAST_SHARE = 1e-6  # smallest share of a step tried before it is rejected
MARGIN = 5.0  # safety factor in extrapolating the size of the next step from the last two
ROUNDING = 1e-13  # relative rounding error of J


class Fit(NamedTuple):
    """The result of a fit."""

    cost: float  # J
    iterations: int
    converged: bool


class Move(NamedTuple):
    """The result of a step."""

    furthest: float  # m, rad; the largest change
    fall: float  # decrease of J; -inf where the step was rejected
    rise: float = 0.0  # of J by the least share of a step that was rejected


def eliminate(forest: Forest, damping: float = 0.0) -> bool:
    """Eliminates everything again, in the initial order; False where it is not positive definite."""
    return forest.eliminate(_top_down(forest), damping)


class Descent:
    """Gauss-Newton on an ordered forest."""

    def __init__(self, forest: Forest) -> None:
        g = self._g = forest.g
        self._order = _top_down(forest)
        self._off, self._steps_off = np.zeros((g.state[VARIABLES], 3)), np.zeros((g.state[STEPS], 3))
        self._path, self._values = np.empty_like(self._steps_off), np.zeros_like(self._off)
        here = np.ascontiguousarray(g.steps[: g.state[STEPS], POINT:])
        self.cost = _cost.cost(g, here, g.values)
        if not np.isfinite(self.cost):
            raise Diverged(f"J is {self.cost} at the start")

    def step(self) -> Move:
        """Moves to the solution, or by the share of the way that lowers J."""
        g, off, steps_off, share = self._g, self._off, self._steps_off, 1.0
        _offsets.offsets(g, self._order, off)
        if not _offsets.inner_offsets(g, off, -1.0, steps_off):
            raise Diverged(NO_COVARIANCE)
        while True:
            furthest, _ = _offsets.candidate(g, off, steps_off, share, -1.0, self._path, self._values)
            cost = _cost.cost(g, self._path, self._values)
            if cost <= self.cost * (1 + ROUNDING):
                fall, self.cost = self.cost - cost, cost
                _whole_log.linearise_at(g, self._path, self._values)
                return Move(share * furthest, fall)
            if share < LEAST_SHARE:
                return Move(share * furthest, -np.inf, cost - self.cost)
            share /= 2


def minimise(forest: Forest, tolerance: float, iterations: int) -> Fit:
    """Minimises J from the linearisation points; the forest is ordered and solved there.

    Stops where J falls by no more than the share `tolerance` of itself, or is predicted to, from the last two steps.
    The elimination is then out of date.
    """
    descent, last = Descent(forest), Move(np.inf, np.inf)
    damping = least = 0.0
    solved = not forest.g.state[FAILED]
    for iteration in range(1, iterations + 1):
        if iteration > 1:
            solved = eliminate(forest, damping)
        move = descent.step() if solved else Move(np.inf, -np.inf)
        if move.fall > -np.inf:
            if damping <= least and _ends(last, move, tolerance * descent.cost):
                return Fit(descent.cost, iteration, True)
            last = move
            damping = max(damping / TENFOLD if damping > FIRST_DAMPING else 0.0, least)
        elif move.furthest <= STILL:
            return Fit(descent.cost, iteration, move.rise <= SMOOTH * descent.cost)
        else:
            damping = max(damping * TENFOLD, FIRST_DAMPING)
            if not solved:
                least = damping
            if damping > MOST_DAMPING:
                raise Diverged(INDEFINITE_J)
    return Fit(descent.cost, iterations, False)


def _ends(before: Move, now: Move, fall: float) -> bool:
    """Tells if another step would move nothing and lower J by no more than `fall`, or this one has not."""
    if now.furthest <= STILL or now.fall <= fall:
        return True
    if not 0 < now.furthest < before.furthest < np.inf:
        return False
    next_fall = now.fall**2 / before.fall
    return MARGIN * now.furthest**2 / before.furthest <= STILL and next_fall <= fall


def _top_down(forest: Forest) -> Ints:
    """All cliques, the last one created first: parents precede children, with neighbours adjacent in memory."""
    return np.arange(forest.g.state[CLIQUES] - 1, 0, -1)

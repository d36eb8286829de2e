"""Gauss-Newton with a line search on a forest whose structure stays: only its values change.

A step goes the whole way, or half of it, or a quarter, until J falls. A look at J costs a small part of an elimination,
and an elimination is what a rejected step costs Levenberg and Marquardt. Damping comes in where J is flat in some
direction, so that there is no step, or where no share of one lets J fall. From dead reckoning, where most steps are too
long, this takes fewer eliminations than Levenberg-Marquardt or Powell's dogleg, and ends lower: on a city of 1,000
landmarks 9, where they take 22 and 12, and on Victoria Park at a J of 1.5e5, where they end at 5.2e5 and 1.7e5.
"""

from typing import NamedTuple

import numpy as np

from ...frontend.se2 import Ints
from ..api import Diverged
from ..smoothing import _cost, _front, _offsets
from ..smoothing._graph import CLIQUES, DAMPING, FAILED, POINT, RESUM, STEPS, TODO, VARIABLES
from ..smoothing.forest import INDEFINITE_J, Forest
from . import _whole_log

LEAST_SHARE = 1e-6
"""Of a step; where J does not fall by so little of it, it is given up."""

FIRST_DAMPING, MOST_DAMPING = 1e-5, 1e15
"""1/m^2, 1/rad^2; what is added to the diagonal of the information where there is no step, at first and at most."""

TENFOLD = 10.0
"""What the damping is raised by where there still is no step, and lowered by after one."""

STILL = 5e-6
"""m, rad; a step that would move nothing further is not made."""

MARGIN = 5.0
"""By how much less a step may shrink against the last one than that against the one before."""

ROUNDING = 1e-13
"""The share of J within which its rounding lies."""


class Fit(NamedTuple):
    """How a fit ended."""

    cost: float  # J
    iterations: int


class Move(NamedTuple):
    """What a step did."""

    furthest: float  # m, rad; how far it moved what it moved furthest
    fall: float  # by how much J fell; -inf where the step was given up


def eliminate(forest: Forest, damping: float = 0.0) -> bool:
    """Eliminate everything anew, in the order that all was put into; False where it is not positive definite."""
    g, order = forest.g, _top_down(forest)
    g.settings[DAMPING] = damping
    g.todo[: len(order)] = order[::-1]
    g.state[TODO], g.state[RESUM], g.state[FAILED] = len(order), 1, 0
    return _front.solve(g, forest.pose, forest.cov)


class Descent:
    """A forest that is ordered, on its way to where J is least."""

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
        """Go where the solution leads, or a share of the way by which J falls."""
        g, off, steps_off, share = self._g, self._off, self._steps_off, 1.0
        _offsets.offsets(g, self._order, off)
        _offsets.inner_offsets(g, off, -1.0, steps_off)
        while True:
            furthest, _ = _offsets.candidate(g, off, steps_off, share, -1.0, self._path, self._values)
            cost = _cost.cost(g, self._path, self._values)
            if cost <= self.cost * (1 + ROUNDING):
                fall, self.cost = self.cost - cost, cost
                _whole_log.linearise_at(g, self._path, self._values)
                return Move(share * furthest, fall)
            if share < LEAST_SHARE:
                return Move(share * furthest, -np.inf)
            share /= 2


def minimise(forest: Forest, tolerance: float, iterations: int) -> Fit:
    """Move everything to where J is least, from where it is linearised; the forest is ordered and solved there.

    It ends where J falls by no more than the share `tolerance` of itself, or would at the next step by how the last two
    went. What was eliminated is then out of date.
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
                return Fit(descent.cost, iteration)
            last = move
            damping = max(damping / TENFOLD if damping > FIRST_DAMPING else 0.0, least)
        elif move.furthest <= STILL:
            return Fit(descent.cost, iteration)
        else:
            damping = max(damping * TENFOLD, FIRST_DAMPING)
            if not solved:
                least = damping
            if damping > MOST_DAMPING:
                raise Diverged(INDEFINITE_J)
    return Fit(descent.cost, iterations)


def _ends(before: Move, now: Move, fall: float) -> bool:
    """Whether another step would move nothing and lower J by no more than `fall`, or this one has not."""
    if now.furthest <= STILL or now.fall <= fall:
        return True
    if not 0 < now.furthest < before.furthest < np.inf:
        return False
    next_fall = now.fall**2 / before.fall
    return MARGIN * now.furthest**2 / before.furthest <= STILL and next_fall <= fall


def _top_down(forest: Forest) -> Ints:
    """All cliques, the last one made first: so their parents come before them, and their neighbours in memory next."""
    return np.arange(forest.g.state[CLIQUES] - 1, 0, -1)

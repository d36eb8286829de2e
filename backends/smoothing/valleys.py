"""The end of a descent where J is a narrow, curved valley, or has a wrong one beside the right one.

Where some factors are known far better than others, a Gauss-Newton step along the valley leaves it, as its floor is
curved, and a line search lets steps go on by next to nothing. The step after one that was taken whole leads back onto
the floor: so several are taken before J is compared (Chamberlain, Powell, Lemarechal and Pedersen, "The watchdog
technique", Mathematical Programming Study 16, 1982). Damping shortens them, if need be.

A robot that passes over a landmark sees it in a bearing that turns by half a circle. Stated far better than the
place across it is known, that bearing keeps the path on the wrong side: J has a minimum on either. There, `freed` fits
once with bearings no better across than the ranges are along, then as stated.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ..api import Diverged
from . import _cost, _offsets, _relinearise
from ._graph import LANDMARK, NEAR_SDS, PART, POINT, POSE, PRIOR, SIGHTINGS, STEPS, WHOLE, Graph
from .forest import FIRST_DAMPING, STILL, TENFOLD, Estimate, Forest

CLOSE, NOTHING = 1e-6, 1e-12
"""At a minimum, a step is predicted to lower J by no more than that share of it, or by no more than that."""

WATCH = 5  # steps before J has to be lower
ENOUGH = 1e-3  # share of the predicted decrease of J that they have to reach
SOFTENED = (1.0, 0.3, 3.0)
"""Standard deviations across to which bearings are softened in turn, in those of the range."""

STIFFEST = 1e3  # 1/m^2, 1/rad^2; most damping


def settled(forest: Forest, iterations: int) -> tuple[Estimate, bool | None]:
    """Ends a smoother as `Forest.settled`, and goes on from there, by at most that many iterations, if need be."""
    estimate, converged = forest.settled(iterations)
    if iterations == 0:
        return estimate, converged
    if at_rest(forest, here(forest)):
        converged = True
    else:
        converged = descend(forest, iterations)
        if converged or here(forest) <= _cost.cost(forest.g, estimate.path, estimate.values):
            estimate = forest.estimate(np.inf)
    if near(forest.g) and freed(forest, partial(forest.settled, iterations)):
        converged = descend(forest, iterations)
        estimate = forest.estimate(np.inf)
    return estimate, converged


def here(forest: Forest) -> float:
    """J at the linearisation points."""
    g = forest.g
    return _cost.cost(g, np.ascontiguousarray(g.steps[: g.state[STEPS], POINT:]), g.values)


def at_rest(forest: Forest, cost: float) -> bool:
    """Tells if no step would lower J, which is `cost`, by much; all is eliminated, undamped.

    The whole step is tried, too: what is predicted has the steps between two variables at their best places.
    """
    least = CLOSE * cost + NOTHING
    if _predicted(forest) > least:
        return False
    estimate = forest.estimate()
    return not cost - _cost.cost(forest.g, estimate.path, estimate.values) > least


def descend(forest: Forest, iterations: int) -> bool:
    """Goes down the valley from the linearisation points; True if it ends at rest. All is eliminated there.

    Nothing moves where it does not get lower, or where J is flat. That is the end, too, where the robot is at the very
    place of a landmark: J has a corner there, and no derivative.
    """
    cost, damping = here(forest), 0.0
    for _ in range(iterations):
        if at_rest(forest, cost):
            return True
        found = None
        while found is None:
            if damping > STIFFEST:
                return at_corner(forest.g)
            found = _lower(forest, cost, damping)
            if found is None:
                damping = max(damping * TENFOLD, FIRST_DAMPING)
        cost, damping = found, damping / TENFOLD if damping > FIRST_DAMPING else 0.0
    return at_rest(forest, cost)


def at_corner(g: Graph) -> bool:
    """Tells if a sighting is of a landmark at the robot's own place."""
    seen = g.sightings[: g.state[SIGHTINGS]]
    seen = seen[(seen[:, LANDMARK] >= 0) & (seen[:, PART] > PRIOR)]
    off = g.values[seen[:, LANDMARK], :2] - g.values[seen[:, POSE], :2]
    return bool((np.abs(off).max(axis=1, initial=0.0) < STILL).any())


def near(g: Graph) -> bool:
    """Tells if a whole sighting is from no further than NEAR_SDS standard deviations of its range."""
    s = g.state[SIGHTINGS]
    seen = g.seen[:s][g.sightings[:s, PART] == WHOLE]
    return bool((seen[:, 0] ** 2 * seen[:, 2] < NEAR_SDS**2).any())


def freed(forest: Forest, fit: Callable[[], object]) -> bool:
    """Fits again, by `fit`, from softened bearings; back where that is no lower. True if it is.

    `fit` moves the forest's linearisation points, from an elimination at them.
    """
    s = forest.g.state[SIGHTINGS]
    stated, whole = forest.g.seen[:s].copy(), forest.g.sightings[:s, PART] == WHOLE
    return max([_fitted_again(forest, fit, (softened(stated, whole, times), stated)) for times in SOFTENED])


def _fitted_again(forest: Forest, fit: Callable[[], object], seen: Sequence[Array]) -> bool:
    """Fits with each of the rows of `seen`, the last as stated; back where that is no lower. True if it is."""
    before, cost = kept(forest), here(forest)
    try:
        for rows in seen:
            forest.g.seen[: len(rows)] = rows
            if not forest.eliminate(_offsets.top_down(forest.g), 0.0):
                break
            fit()
        else:
            if here(forest) < cost:
                return True
    except Diverged:
        pass
    restore(forest, before)
    return False


def softened(seen: Array, whole: NDArray[np.bool], times: float) -> Array:
    """Rows of `seen` (n, 5) whose bearings, of `whole` sightings, are no better across than so many ranges along."""
    out = seen.copy()
    r, rr, rb, bb = seen[whole][:, (0, 2, 3, 4)].T
    determinant = rr * bb - rb * rb
    along, both, across = bb / determinant, -rb / determinant, rr / determinant
    across += times**2 * along / np.maximum(r, 1e-3 * np.sqrt(along)) ** 2
    determinant = along * across - both * both
    out[whole, 2], out[whole, 3], out[whole, 4] = across / determinant, -both / determinant, along / determinant
    return out


def kept(forest: Forest) -> tuple[Graph, Array, Array]:
    """A copy of a forest's state."""
    return forest.g.copied(), forest.pose.copy(), forest.cov.copy()


def restore(forest: Forest, state: tuple[Graph, Array, Array]) -> None:
    """Sets a forest's state."""
    forest.g, forest.pose, forest.cov = state


def _predicted(forest: Forest) -> float:
    return _offsets.predicted_fall(forest.g, _offsets.top_down(forest.g))


def _lower(forest: Forest, cost: float, damping: float) -> float | None:
    """A lower J after at most WATCH steps, undamped again there; None, and nothing has moved, where there is none."""
    before, wanted = kept(forest), cost - ENOUGH * min(_predicted(forest), cost)
    order = _offsets.top_down(forest.g)
    try:
        solved = damping == 0.0 or forest.eliminate(order, damping)
        for _ in range(WATCH if solved else 0):
            estimate = forest.estimate()
            _relinearise.settle(forest.g, order, estimate.path, estimate.values)
            found = here(forest)
            if found < min(cost, wanted):
                if not forest.eliminate(order, 0.0):
                    break
                return found
            if not np.isfinite(found) or not forest.eliminate(order, damping):
                break
    except Diverged:
        pass
    restore(forest, before)
    return None

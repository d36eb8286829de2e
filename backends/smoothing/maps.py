"""Maps: a given one, as variables with a joint prior or held fixed, and a forest's own."""

import numpy as np
from scipy.sparse.csgraph import connected_components

from ...core.factors import Map
from ...core.se2 import Array, Ints
from ..api import Diverged
from . import _graph, _log, _tree
from ._graph import FACTOR, FAR, GIVEN, GIVEN_INTS, GIVEN_REALS, INTS, LISTED, NEXT, REALS, TODO, UPDATE, WIDTH
from .arrays import with_front, with_rows
from .forest import Forest


def add_map(forest: Forest, known: Map) -> dict[int, int]:
    """Adds a given map to a graph of its first pose alone; returns the variables of its landmarks, by id.

    Correlated landmarks are one clique that eliminates nothing: its update matrix is the given information. It is
    created once and never opened, and stays at the front of the arenas.
    """
    forest.room(0, len(known.ids), 0, 0, 0)
    width = 0 if known.cov is None else 2
    variables = [_log.add_variable(forest.g, width, x, y, 0.0) for x, y in known.xy.tolist()]
    if known.cov is not None:
        together = np.abs(known.cov).reshape(len(variables), 2, len(variables), 2).max(axis=(1, 3)) > 0
        count, which = connected_components(together, directed=False)
        for k in range(count):
            members = np.flatnonzero(which == k)
            rows = (2 * members[:, None] + (0, 1)).ravel()
            _add(forest, np.array(variables)[members], known.xy[members].ravel(), known.cov[np.ix_(rows, rows)])
    state = forest.g.state
    state[GIVEN_INTS], state[GIVEN_REALS] = state[INTS], state[REALS]
    return dict(zip(known.ids.tolist(), variables, strict=True))


def joint_map(forest: Forest, ids: Ints, variables: Ints, values: Array, up_to: int) -> Map:
    """Landmarks with these ids and variables (n,), at `values` (v, 3); zero covariance for those held fixed.

    There is none for more than `up_to` landmarks, nor where precision does not suffice with all of them last.
    """
    n, places = len(ids), values[variables, :2]
    if n > up_to:
        return Map(ids, places, None)
    cov = np.zeros((2 * n, 2 * n))
    moving = np.flatnonzero(forest.g.variables[variables, WIDTH])
    if len(moving):
        rows = (2 * moving[:, None] + (0, 1)).ravel()
        try:
            cov[np.ix_(rows, rows)] = forest.joint(variables[moving])[:-3, :-3]
        except Diverged:
            return Map(ids, places, None)
    return Map(ids, places, cov)


def joint_of(forest: Forest, variables: Ints, values: Array) -> Array | None:
    """The joint covariance (2n, 2n) of variables (n,) of two entries, at `values` (v, 3); None where it fails."""
    return joint_map(forest, variables, variables, values, len(variables)).cov


def _add(forest: Forest, variables: Ints, mean: Array, cov: Array) -> None:
    """Adds a clique of landmarks (n,) with the given mean (2n,) and covariance (2n, 2n)."""
    n = 2 * len(variables)
    g, state = forest.g, forest.g.state
    g = with_rows(with_front(g, n), "cliques", int(state[_graph.CLIQUES]) + 1)
    g = with_rows(with_rows(g, "ints", int(state[INTS]) + 2 * n + 16), "reals", int(state[REALS]) + n * (n + 6) + 32)
    forest.g = g
    c = _tree.new_clique(g, 0, len(variables), 0, 0, n, 0)
    q = g.cliques[c]
    g.ints[q[LISTED] : q[LISTED] + len(variables)] = variables
    q[FACTOR] = _graph.reserve_reals(g, n)
    g.reals[q[FACTOR] : q[FACTOR] + n] = mean
    rows = np.concatenate((np.linalg.inv(cov), np.zeros((n, 1))), axis=1)
    upper = rows[np.arange(n)[:, None] <= np.arange(n + 1)]
    g.reals[q[UPDATE] : q[UPDATE] + len(upper)] = upper
    q[NEXT], state[FAR] = state[FAR], c
    state[GIVEN] += 1
    g.todo[state[TODO]] = c
    state[TODO] += 1

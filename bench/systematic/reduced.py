"""A log's equations with everything eliminated but the systematic errors, as a whole and without each of its stretches.

Stretches are eliminated one by one: first the poses within, then those between stretches and the landmarks. Without a
stretch, what it measured is left out, and its poses with it.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import splu

from ...core.se2 import Array, Ints
from ...datasets.noise.systematic import NAMES, Systematic
from .system import System

STRETCHES = 24
"""Of a log, each with as many sightings."""

HELD = 1e-11
"""Share of its information that each variable is held by, too."""


class Reduced(NamedTuple):
    """Normal equations H x = -g of the errors alone: of the whole log, and without each stretch."""

    H: Array  # (p, p)
    g: Array  # (p,)
    H_without: Array  # (b, p, p)
    g_without: Array  # (b, p)


class Stretch(NamedTuple):
    """A stretch of a log without its inner poses."""

    kept: Ints  # (k,) places of its variables among those that are kept
    H: Array  # (k, k)
    g: Array  # (k,)
    inner: Ints  # variables that are eliminated
    solver: Any  # of their system
    mixed: Array  # (inner, k)
    pull: Array  # (inner,)


class Linear:
    """A system's equations, at its state and those errors."""

    def __init__(self, system: System, errors: Systematic, *, evenly: bool = False) -> None:
        r, J, step = system.linearised(errors, evenly=evenly)
        edges = edges_of(system)
        between = 3 * edges[:, None] + np.arange(3) if not system.fixed else np.zeros((0, 3), np.int64)
        self._variables = system.poses + system.xy.size + len(NAMES)
        self._kept = np.concatenate((between.ravel(), np.arange(system.poses, self._variables)))
        place = np.full(self._variables, -1)
        place[self._kept] = np.arange(len(self._kept))
        self._stretches = [_eliminated(J[rows], r[rows], place) for rows in rows_of_stretches(edges, step)]

    def reduced(self) -> Reduced:
        """The equations of the errors."""
        size = len(self._kept)
        H, g = np.zeros((size, size)), np.zeros(size)
        for one in self._stretches:
            H[np.ix_(one.kept, one.kept)] += one.H
            g[one.kept] += one.g
        self._whole = H, g
        without = list[tuple[Array, Array]]()
        for one in self._stretches:
            less, pull = H.copy(), g.copy()
            less[np.ix_(one.kept, one.kept)] -= one.H
            pull[one.kept] -= one.g
            without.append(_errors_alone(less, pull, np.diag(H)))
        H_without, g_without = (np.array(one) for one in zip(*without, strict=True))
        return Reduced(*_errors_alone(H, g, np.diag(H)), H_without, g_without)

    def change(self, errors: Array) -> Array:
        """Changes (variables,) of poses and landmarks that go with those (p,) of the errors, and the latter."""
        H, g = self._whole
        p = len(NAMES)
        kept = np.zeros(len(g))
        kept[-p:] = errors
        kept[:-p] = -_solved(H[:-p, :-p], (g[:-p] + H[:-p, -p:] @ errors)[:, None], np.diag(H)[:-p])[:, 0]
        every = np.zeros(self._variables)
        every[self._kept] = kept
        for one in self._stretches:
            if len(one.inner):
                every[one.inner] = -one.solver.solve(one.pull + one.mixed @ kept[one.kept])
        return every


def edges_of(system: System) -> Ints:
    """(b + 1,) steps at which stretches begin and end, each stretch with as many sightings."""
    n = len(system.path)
    after = np.searchsorted(system.step, np.arange(n), side="right")
    wanted = len(system.step) * np.arange(1, STRETCHES) / STRETCHES
    return np.unique(np.concatenate(([0], np.searchsorted(after, wanted), [n - 1])))


def rows_of_stretches(edges: Ints, step: Ints) -> list[Ints]:
    """The rows of each stretch, of rows that belong to the steps (r,)."""
    count = len(edges) - 1
    stretch = np.clip(np.searchsorted(edges, step, side="right") - 1, 0, count - 1)
    order = np.argsort(stretch, kind="stable")
    return np.split(order, np.searchsorted(stretch[order], np.arange(1, count)))


def _eliminated(J: Any, r: Array, place: Ints) -> Stretch:
    """The stretch of those rows; `place` (variables,) tells where a variable is kept, -1 where it is not."""
    by_column = J.tocsc()
    used = np.flatnonzero(np.diff(by_column.indptr))
    inner, outer = used[place[used] < 0], used[place[used] >= 0]
    g, outside = by_column.T @ r, by_column[:, outer]
    H = (outside.T @ outside).toarray()
    if not len(inner):
        return Stretch(place[outer], H, g[outer], inner, None, np.zeros((0, len(outer))), np.zeros(0))
    inside = by_column[:, inner]
    mixed = (inside.T @ outside).toarray()
    solver = splu(
        (inside.T @ inside).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    solved = solver.solve(np.column_stack((mixed, g[inner])))
    return Stretch(
        place[outer], H - mixed.T @ solved[:, :-1], g[outer] - mixed.T @ solved[:, -1], inner, solver, mixed, g[inner]
    )


def _errors_alone(H: Array, g: Array, size: Array) -> tuple[Array, Array]:
    """The Schur complement of the errors, which come last."""
    p = len(NAMES)
    solved = _solved(H[:-p, :-p], np.column_stack((H[:-p, -p:], g[:-p])), size[:-p])
    return H[-p:, -p:] - H[-p:, :-p] @ solved[:, :-1], g[-p:] - H[-p:, :-p] @ solved[:, -1]


def _solved(H: Array, b: Array, size: Array) -> Array:
    """H^-1 b, with 0 for variables of which nothing is left of the diagonal `size` of the whole.

    Without the stretch of the start, path and map may lie anywhere, which HELD keeps from being singular.
    """
    left = np.diag(H) > 1e-9 * size
    found = np.zeros_like(b)
    found[left] = np.linalg.solve(H[np.ix_(left, left)] + HELD * np.diag(size[left]), b[left])
    return found

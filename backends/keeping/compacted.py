"""A smoother's tables without the steps that are marginalised, and with their submaps."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Ints
from ..smoothing._graph import (
    CLIQUE,
    CUT,
    END,
    FIRST,
    FIX,
    FIXED,
    LANDMARK,
    LAST,
    LINKS,
    LOOP,
    MARK,
    MEMBER,
    NO_VARIABLE,
    NOISE,
    PART,
    PENDING,
    PLACE,
    POSE,
    RESUM,
    SIGHTINGS,
    SLOT,
    STEP,
    STEPS,
    SUBMAP,
    VARIABLES,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ..smoothing.arrays import made, with_rows
from ._rehung import rehang
from .submaps import Submap

Which = NDArray[np.bool]


class Compacted(NamedTuple):
    """The tables, not eliminated yet, and new numbers by the old ones: -1 of what is left out."""

    g: Graph
    variables: Ints
    sightings: Ints


def compacted(g: Graph, keeps: Which, frames: Which, submaps: Sequence[Submap]) -> Compacted:
    """Makes the tables with the steps that it `keeps` (T,), those in `frames` (T,) with nothing but a submap.

    A loop closure stays where both of its poses do and neither is in `frames`. `submaps` are all there are, by old
    numbers, and get new ones.
    """
    state = g.state
    T, V, S, K = int(state[STEPS]), int(state[VARIABLES]), int(state[SIGHTINGS]), int(state[LINKS])
    old, looks, links = g.variables[:V], g.sightings[:S], g.links[:K]
    poses = old[:, WIDTH] == 3
    stays, framed = ~poses, np.zeros(V, np.bool_)
    stays[poses], framed[poses] = keeps[old[poses, STEP]], frames[old[poses, STEP]]
    own = stays & ~framed
    variable, step = _numbers(stays), _numbers(keeps)
    looked = stays[looks[:, POSE]] & ~framed[looks[:, POSE]]
    sighting = _numbers(looked)
    apart = np.concatenate(([0], np.cumsum(~keeps | frames)))
    linked = np.where(
        links[:, LOOP] != 0,
        own[links[:, A]] & own[links[:, B]],
        apart[old[links[:, B], STEP] + 1] == apart[old[links[:, A], STEP]],
    )
    link = _numbers(linked)

    members = sum(len(submap.landmarks) for submap in submaps)
    counts = {VARIABLES: stays.sum(), STEPS: keeps.sum(), LINKS: linked.sum(), SIGHTINGS: looked.sum() + members}
    new = made(0, 0.0)
    for name, rows in (
        ("variables", counts[VARIABLES]), ("steps", counts[STEPS]), ("links", counts[LINKS]),
        ("sightings", counts[SIGHTINGS]),
        ("submaps", 1 + sum(1 + 4 * len(of.landmarks) + 4 * len(of.landmarks) ** 2 for of in submaps)),
    ):  # fmt: skip
        new = with_rows(new, name, int(rows))
    for row, count in counts.items():
        new.state[row] = count
    new.settings[:] = g.settings
    new.state[RESUM], new.state[LAST] = 1, variable[state[LAST]]

    rows = new.variables[: counts[VARIABLES]]
    rows[:] = old[stays]
    new.values[: len(rows)] = g.values[:V][stays]
    rows[:, CLIQUE], rows[:, SLOT], rows[:, MARK], rows[:, PLACE], rows[:, SUBMAP] = 0, -1, 0, 0, 0
    before = np.concatenate(([0], np.cumsum(looked)))
    are = rows[:, WIDTH] == 3
    rows[are, STEP] = step[rows[are, STEP]]
    rows[are, FIRST], rows[are, END] = before[rows[are, FIRST]], before[rows[are, END]]

    seen = new.sightings[: looked.sum()]
    seen[:] = looks[looked]
    new.seen[: len(seen)] = g.seen[:S][looked]
    named = seen[:, LANDMARK] >= 0
    seen[named, LANDMARK], seen[:, POSE] = variable[seen[named, LANDMARK]], variable[seen[:, POSE]]

    fixes = seen[:, PART] <= FIX
    new = with_rows(new, "fixed", int(fixes.sum()))
    new.state[FIXED] = fixes.sum()
    new.fixed[: fixes.sum()] = g.fixed[FIX - seen[fixes, PART]]
    new.sightings[: len(seen)][fixes, PART] = FIX - np.arange(fixes.sum())

    new.links[: counts[LINKS]], new.linked[: counts[LINKS]] = links[linked], g.linked[:K][linked]
    new.links[: counts[LINKS], A], new.links[: counts[LINKS], B] = (
        variable[links[linked, A]],
        variable[links[linked, B]],
    )
    rehang(new)

    ways, at = new.steps[: counts[STEPS]], g.at[:T][keeps]
    ways[:] = g.steps[:T][keeps]
    ways[1:, NOISE][np.diff(np.flatnonzero(keeps)) > 1] = CUT
    alone = np.flatnonzero(frames[keeps])
    ways[alone, NOISE] = CUT
    ways[alone[alone + 1 < len(ways)] + 1, NOISE] = CUT
    inside, are = (at < NO_VARIABLE) & (at != PENDING), at >= 0
    new.at[: len(at)] = at
    new.at[: len(at)][are] = variable[at[are]]
    new.at[: len(at)][inside] = NO_VARIABLE - 1 - link[NO_VARIABLE - 1 - at[inside]]

    row, o = len(seen), 1
    for submap in submaps:
        submap.renumbered(variable)
        m, frame = len(submap.landmarks), new.variables[submap.frame]
        frame[FIRST], frame[END], frame[SUBMAP] = row, row + m, o
        new.sightings[row : row + m, LANDMARK], new.sightings[row : row + m, PART] = submap.landmarks, MEMBER
        new.sightings[row : row + m, POSE] = submap.frame
        block = np.concatenate(
            ([submap.constant], submap.stated.reshape(-1), submap.side, submap.information.reshape(-1))
        )
        new.submaps[o : o + len(block)] = block
        row, o = row + m, o + len(block)
    return Compacted(new, variable, sighting)


def _numbers(which: Which) -> Ints:
    """The new numbers of what stays, -1 of the others."""
    return np.where(which, np.cumsum(which) - 1, -1)

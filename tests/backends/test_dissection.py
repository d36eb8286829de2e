"""Nested dissection: its separators part the factors' graph, and the smoother on it ends at the dense optimum."""

from typing import Any

import numpy as np
import pytest

from against_dense import agrees, of_kind
from driven import final
from hard_logs import with_loops
from random_logs import random_log
from slamduel.backends.graphs.batch import Batch
from slamduel.backends.smoothing import _ordering, forest
from slamduel.backends.smoothing._factors import NONE
from slamduel.backends.smoothing._graph import (
    LANDMARK,
    LAST,
    LINKS,
    PLACE,
    POSE,
    SIGHTINGS,
    VARIABLES,
    WIDTH,
    WORK,
    A,
    B,
    Graph,
)
from slamduel.backends.smoothing._ordering import SMALLEST, ranks
from slamduel.core.factors import Log
from slamduel.core.se2 import Ints
from tiers import first_quick

FIRST = 1  # variables that are kept: here the last pose alone


def forest_of(log: Log) -> forest.Forest:
    """The forest of a whole log, along dead reckoning."""
    batch = Batch(log, NONE, 0.0)
    batch.start_by_odometry()
    return batch.forest


def large(seed: int, loops: int = 20) -> Log:
    """Some 700 variables, on a square that is large for the sensor, and loop closures."""
    rng = np.random.default_rng(seed)
    return with_loops(random_log(rng, 600, 150, width=40.0, radius=3.0, blind=0.3), loops, rng).log


def ordered(g: Graph) -> tuple[Ints, Ints]:
    """All variables, the last pose first, and their ranks."""
    rows = g.variables[: g.state[VARIABLES]]
    names = np.flatnonzero(rows[:, WIDTH])
    names = np.concatenate(([g.state[LAST]], names[names != g.state[LAST]]))
    g.variables[names, PLACE] = np.arange(len(names))
    return names, ranks(g, names, FIRST)


def factors(g: Graph) -> Ints:
    """(n, 2) the two variables of each sighting and link."""
    seen = g.sightings[: g.state[SIGHTINGS]]
    seen = seen[seen[:, LANDMARK] >= 0]
    return np.concatenate((seen[:, [LANDMARK, POSE]], g.links[: g.state[LINKS], [A, B]]))


def parts(count: int, pairs: Ints, inside: Ints) -> Ints:
    """The part (count,) that each variable in `inside` is in: those that factors join."""
    part = np.arange(count)
    pairs = pairs[np.isin(pairs, inside).all(axis=1)]
    while (part[pairs[:, 0]] != part[pairs[:, 1]]).any():
        low = np.minimum(part[pairs[:, 0]], part[pairs[:, 1]])
        np.minimum.at(part, pairs[:, 0], low)
        np.minimum.at(part, pairs[:, 1], low)
    return part


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_separators_part_the_graph_rank_by_rank(seed: int) -> None:
    g = forest_of(large(seed)).g
    names, rank = ordered(g)
    assert len(names) > 2 * SMALLEST
    rank, names = rank[FIRST:], names[FIRST:]
    pairs, of = factors(g), np.full(names.max() + 1, -1)
    of[names] = rank
    left = names[rank == 0]
    sizes = [np.unique(parts(len(of), pairs, left)[left], return_counts=True)[1].max()]
    assert sizes[0] <= SMALLEST
    for r in np.unique(rank[rank > 0]).tolist():
        inside = names[rank <= r]
        sizes.append(np.unique(parts(len(of), pairs, inside)[inside], return_counts=True)[1].max())
        assert sizes[-1] > sizes[-2]  # without these separators the parts are smaller
    assert (rank == 0).mean() > 0.5


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_no_landmark_is_eliminated_before_a_pose_that_sees_it(seed: int) -> None:
    g = forest_of(large(seed)).g
    names, rank = ordered(g)
    of = np.full(names.max() + 1, -1)
    of[names[FIRST:]] = rank[FIRST:]
    seen = g.sightings[: g.state[SIGHTINGS]]
    seen = seen[seen[:, LANDMARK] >= 0]
    assert (of[seen[:, LANDMARK]] >= of[seen[:, POSE]]).all()


def always_dissected(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Has every full ordering be one by dissection; lists their cliques."""
    found, plan = list[int](), _ordering.plan

    def dissected(g: Any, x: int, wanted: Ints, touched: Ints, everything: bool, parted: bool) -> Any:
        made = plan(g, x, wanted, touched, everything, everything)
        found.extend([made[2]] if everything else [])
        return made

    monkeypatch.setattr(_ordering, "plan", dissected)
    return found


@pytest.mark.parametrize(
    ("seed", "kind"), first_quick([(k, ("plain", "loops", "blocks", "joint", "fixed")[k % 5]) for k in range(10)], 2)
)
def test_it_ends_at_the_dense_optimum_however_wide_fronts_are(
    seed: int, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    log = of_kind(kind, random_log(rng, 280, 60, width=25.0, radius=3.0, noise=0.5), rng)
    orders = always_dissected(monkeypatch)
    agrees(log, final("smoother", log, relinearize_skip=7))
    assert len(orders) > 1


@pytest.mark.parametrize("name", ["smoother", "graph"])
def test_both_orders_have_one_optimum(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    log = large(3)
    plain = final(name, log)
    monkeypatch.setattr(forest, "WIDE", 0)
    other = final(name, log)
    assert other.path == pytest.approx(plain.path, abs=1e-7)
    assert other.map.xy == pytest.approx(plain.map.xy, abs=1e-7)


def test_a_full_ordering_is_predicted_to_cost_what_its_elimination_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forest, "WIDE", 0)
    one = forest_of(large(4))
    one.reorganise(int(one.g.state[LAST]), one.g.root[:0].copy(), everything=True)
    assert one.g.state[WORK] == 0

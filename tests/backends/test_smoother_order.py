"""What a smoother passes one after the other is adjacent: the cliques of a plan in memory, and all of them top down."""

import numpy as np
import pytest

from random_logs import random_log
from slamduel.backends.graphs.batch import Batch
from slamduel.backends.smoothing import _ordering, _tree
from slamduel.backends.smoothing._amalgamation import HEAD, amalgamated
from slamduel.backends.smoothing._factors import NONE
from slamduel.backends.smoothing._graph import (
    EFFORT,
    FACTOR,
    FRONT,
    FRONTALS,
    LAST,
    LISTED,
    MEMBERS,
    PARENT,
    PLACE,
    ROOT,
    SIZE,
    VARIABLES,
    WIDTH,
    Graph,
)  # fmt: skip
from slamduel.backends.smoothing._offsets import top_down
from slamduel.backends.smoothing._tree import neighbourly
from slamduel.backends.smoothing.arrays import with_front, with_rows
from slamduel.backends.smoothing.forest import NOBODY, Forest
from slamduel.core.se2 import Ints


def batch_of(seed: int) -> Graph:
    """The graph of a random log, all of it ordered at once."""
    batch = Batch(random_log(np.random.default_rng(seed), 200, 40, width=15.0, radius=3.0, blind=0.3).log, NONE, 0.0)
    batch.start_by_odometry()
    return batch.forest.g


def below(order: list[int], parent: dict[int, int]) -> dict[int, set[int]]:
    """Each of `order` with all that descend from it, itself included."""
    out = {c: {c} for c in order}
    for c in order:
        at = parent[c]
        while at in out:
            out[at].add(c)
            at = parent[at]
    return out


@pytest.mark.parametrize("seed", range(4))
def test_top_down_each_clique_is_followed_by_all_below_it(seed: int) -> None:
    g = batch_of(seed)
    order = [int(c) for c in top_down(g)]
    parent = {c: int(g.cliques[c, PARENT]) for c in order}
    assert len(order) == len(set(order)) > 50
    eliminated = [int(v) for c in order for v in g.ints[g.cliques[c, LISTED] :][: g.cliques[c, FRONTALS]]]
    assert len(eliminated) == len(set(eliminated))
    for c, mine in below(order, parent).items():
        at = order.index(c)
        assert set(order[at : at + len(mine)]) == mine


@pytest.mark.parametrize("seed", range(4))
def test_in_memory_a_clique_comes_after_all_below_it(seed: int) -> None:
    """Where everything was ordered at once; then arenas have no free blocks inside."""
    g = batch_of(seed)
    order = sorted((int(c) for c in top_down(g)), key=lambda c: int(g.cliques[c, FACTOR]))
    parent = {c: int(g.cliques[c, PARENT]) for c in order}
    for c, mine in below(order, parent).items():
        at = order.index(c)
        assert set(order[at + 1 - len(mine) : at + 1]) == mine


def test_a_plan_is_taken_apart_into_its_cliques() -> None:
    """Six cliques, 5 above 2 and 4, 4 above 0 and 3, and 1 alone; 2 has a child that stays, number 7."""
    counts = ((1, 2, 0), (1, 1, 1), (1, 2, 1), (1, 3, 0), (2, 3, 0), (1, 1, 0))
    lists = list(zip(counts, ([], [], [7], [], [-1, -4], [-3, -5]), strict=True))
    plan: list[int] = []
    starts: list[int] = []
    for (frontals, members, bound), children in lists:
        starts.append(len(plan))
        plan += [frontals, members, bound, len(children), 3, 6, 108, *range(100, 100 + members + bound), *children]
    begins, order = neighbourly(np.array(plan, np.int64), len(lists))
    assert begins.tolist() == starts
    found: Ints = order
    at = {int(i): n for n, i in enumerate(found)}
    assert sorted(at) == list(range(6))
    assert max(at[0], at[3]) < at[4] < at[5]
    assert at[2] < at[5]
    assert {int(i) for i in found[at[4] - 2 : at[4]]} == {0, 3}
    assert at[1] in (0, 5)


def forest_of(seed: int) -> Forest:
    """The forest of a random log."""
    batch = Batch(random_log(np.random.default_rng(seed), 200, 40, width=15.0, radius=3.0, blind=0.3).log, NONE, 0.0)
    batch.start_by_odometry()
    return batch.forest


@pytest.mark.parametrize("zeros", [0, 36, 400])
@pytest.mark.parametrize("seed", range(4))
def test_joined_cliques_have_the_same_solution(seed: int, zeros: int) -> None:
    """Each variable is eliminated once, in an order in which its clique's others come later; work is that of before."""
    forest = forest_of(seed)
    g, state = forest.g, forest.g.state
    x, root = int(state[LAST]), forest.g.root[: forest.g.state[ROOT]].copy()
    before, pose, cov = forest.estimate(), forest.pose.copy(), forest.cov.copy()
    work = sum(int(g.cliques[c, EFFORT]) for c in top_down(g))
    opened, plan, count, left, _ = _ordering.plan(g, x, root, NOBODY, True, False)
    turn, at, n = np.arange(state[VARIABLES]) + 10 * state[VARIABLES], 0, 0
    for _ in range(count):
        for v in plan[at + HEAD : at + HEAD + plan[at]]:
            turn[g.variables[v, PLACE]] = n
            n += 1
        at += HEAD + int(plan[at + 1 : at + 4].sum())
    when = turn[g.variables[: state[VARIABLES], PLACE]]
    joined, fewer = amalgamated(g, plan, count, left, x, turn, zeros)
    assert fewer < count or zeros == 0
    forest.g = g = with_rows(with_front(g, 400), "reals", 4 * len(g.reals))
    _tree.rebuild(g, x, root, opened, joined, fewer, left, True)
    forest.solve()
    order = top_down(g)
    assert len(order) == fewer
    assert sum(int(g.cliques[c, EFFORT]) for c in order) == work
    lists = [g.ints[q[LISTED] : q[LISTED] + q[MEMBERS]].tolist() for q in g.cliques[order]]
    eliminated = [v for q, members in zip(g.cliques[order], lists, strict=True) for v in members[: q[FRONTALS]]]
    free = np.flatnonzero(g.variables[: state[VARIABLES], WIDTH])
    assert sorted([*eliminated, x, *root.tolist()]) == free.tolist()
    for q, members in zip(g.cliques[order], lists, strict=True):
        assert np.all(np.diff(when[members]) > 0)
        widths = g.variables[members, WIDTH]
        assert (q[FRONT], q[SIZE]) == (widths[: q[FRONTALS]].sum(), widths.sum())
        if q[PARENT] > 0:
            above = g.cliques[q[PARENT]]
            assert set(members[q[FRONTALS] :]) <= set(g.ints[above[LISTED] : above[LISTED] + above[MEMBERS]].tolist())
    after = forest.estimate()
    np.testing.assert_allclose(after.path, before.path, rtol=0, atol=1e-9)
    np.testing.assert_allclose(after.values, before.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(forest.pose, pose, rtol=0, atol=1e-9)
    np.testing.assert_allclose(forest.cov, cov, rtol=1e-7, atol=1e-12)

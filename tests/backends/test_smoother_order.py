"""What a smoother passes one after the other is adjacent: the cliques of a plan in memory, and all of them top down."""

import numpy as np
import pytest

from random_logs import random_log
from slamduel.backends.graphs.batch import Batch
from slamduel.backends.smoothing._factors import NONE
from slamduel.backends.smoothing._graph import FACTOR, FRONTALS, LISTED, PARENT, Graph
from slamduel.backends.smoothing._offsets import top_down
from slamduel.backends.smoothing._tree import neighbourly
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
        plan += [frontals, members, bound, len(children), 3, 6, *range(100, 100 + members + bound), *children]
    begins, order = neighbourly(np.array(plan, np.int64), len(lists))
    assert begins.tolist() == starts
    found: Ints = order
    at = {int(i): n for n, i in enumerate(found)}
    assert sorted(at) == list(range(6))
    assert max(at[0], at[3]) < at[4] < at[5]
    assert at[2] < at[5]
    assert {int(i) for i in found[at[4] - 2 : at[4]]} == {0, 3}
    assert at[1] in (0, 5)

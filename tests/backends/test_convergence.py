"""The end of a smoother: damped where it must be, and whether it converged is said."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from driven import final, run
from near_logs import uneven_graph
from random_logs import random_log
from slamduel.backends.api import Builder, Diverged, Solution
from slamduel.backends.registry import find
from slamduel.backends.smoothing import _graph, forest, valleys
from slamduel.bench.measure.cell import Job, run_on
from slamduel.bench.measure.drive import drive
from slamduel.bench.measure.misfit import misfit
from slamduel.bench.measure.score import NOT_CONVERGED, score
from slamduel.core.factors import Log, Map, Step
from slamduel.core.se2 import Array


def with_wrong_ids(seed: int) -> Log:
    """Forty steps in which one sighting in twenty is of another landmark than its id says."""
    rng = np.random.default_rng(seed)
    log, _ = random_log(rng, 40, 8, noise=0.5, blind=0.0, radius=6.0)
    ids, wrong = log.ids.copy(), rng.random(len(log.ids)) < 0.05
    ids[wrong] = rng.choice(np.unique(ids), wrong.sum())
    return replace(log, ids=ids)


def cost(log: Log, path: Array, landmarks: Map) -> float:
    found = misfit(log, path, landmarks)
    return found.total


def test_where_no_share_of_a_step_lowers_j_it_is_damped(monkeypatch: pytest.MonkeyPatch) -> None:
    """If only whole steps are tried, one that raises J is the end, and J six times its minimum, unless it is damped."""
    log = with_wrong_ids(5)
    usual = final("smoother", log)
    monkeypatch.setattr(forest, "HALVINGS", 1)
    damped = final("smoother", log)
    assert damped.converged is True
    assert damped.path == pytest.approx(usual.path, abs=1e-5)
    assert damped.cov == pytest.approx(usual.cov, rel=1e-3, abs=1e-9)
    monkeypatch.setattr(forest, "FIRST_DAMPING", 2 * forest.MOST_DAMPING)
    monkeypatch.setattr(valleys, "descend", lambda *_: False)
    stuck = final("smoother", log)
    assert stuck.converged is False
    assert cost(log, stuck.path, stuck.map) > 2 * cost(log, usual.path, usual.map)


@pytest.mark.parametrize("flat", [lambda damping: damping == 0.0, lambda damping: True], ids=["undamped", "all"])
def test_where_j_is_flat_at_the_end_it_is_where_damping_began(
    flat: Callable[[float], bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Damped eliminations go well and the last one does not, or none goes well: the path and covariances of before."""
    log = with_wrong_ids(5)
    monkeypatch.setattr(forest, "HALVINGS", 1)
    monkeypatch.setattr(valleys, "descend", lambda *_: False)
    with monkeypatch.context() as patch:
        patch.setattr(forest, "FIRST_DAMPING", 2 * forest.MOST_DAMPING)
        before = final("smoother", log)
    eliminate = forest.Forest.eliminate
    monkeypatch.setattr(
        forest.Forest, "eliminate", lambda own, order, damping: eliminate(own, order, damping) and not flat(damping)
    )
    found = final("smoother", log)
    assert found.converged is False
    assert np.array_equal(found.cov, before.cov)
    assert cost(log, found.path, found.map) <= cost(log, before.path, before.map)  # neither takes a step that raises it


def test_a_log_on_which_the_iterations_run_out_says_so() -> None:
    log = with_wrong_ids(5)
    assert final("smoother", log, final_iterations=1).converged is False
    assert final("smoother", log, final_iterations=0).converged is None
    assert final("graph", log, iterations=1).converged is False
    right, _ = random_log(np.random.default_rng(4), 50, 10, noise=0.3, blind=0.0, radius=20.0)
    for name in ("smoother", "graph", "fixed-lag", "isam2"):
        assert final(name, right).converged is True


@pytest.mark.parametrize(
    ("options", "status", "reason"),
    [
        ({}, "done", ""),
        (
            {"final_iterations": 1},
            "diverged",
            r"the smoothing ended at a J of .*, where one of .* is in reach: no optim",
        ),
    ],
)
def test_a_cell_that_did_not_get_to_the_optimum_is_not_done(options: dict[str, Any], status: str, reason: str) -> None:
    log = with_wrong_ids(5)
    done = run_on(Job("smoother", "smoother", find("smoother").options(**options), 0, 4000), lambda: log, lambda: None)
    assert done.status == status
    assert re.match(reason, done.reason)
    assert ("final_ate_m" in done.row, "cost_j" in done.row) == (False, status == "done")


def test_one_that_is_at_the_optimum_though_it_says_otherwise_is_done() -> None:
    log, _ = random_log(np.random.default_rng(4), 50, 10, noise=0.3, blind=0.0, radius=20.0)
    backend, _ = run("smoother", log)
    found = backend.finish()
    doubted = Builder(lambda *_: Told(found._replace(converged=False)), online=False, minimises=True)
    for builder, failed in ((doubted, ""), (replace(doubted, minimises=False), NOT_CONVERGED)):
        outcome = drive(builder, None, log, lambda: np.random.default_rng(0))
        judged = score(log, outcome, None, minimised=log if builder.minimising(None) else None)
        assert (judged.remark, judged.failed) == (NOT_CONVERGED, failed)


@pytest.mark.parametrize("seed", range(4))
def test_one_that_is_as_likely_as_the_optimum_is_done_however_many_times_j_is_larger(seed: int) -> None:
    """Where noise is stated far too large, J at the optimum is next to nothing, and so is the difference to another."""
    log, _ = uneven_graph(seed, "weak")
    above = [cost(log, *final(name, log)[:2]) for name in ("isam2", "graph")]
    assert above[0] > 100 * above[1]
    job = Job("isam2", "isam2", find("isam2").options(), 0, 4000)
    assert run_on(job, lambda: log, lambda: None).status == "done"


class Told:
    """A batch with that solution."""

    def __init__(self, solution: Solution) -> None:
        self._solution = solution

    def step(self, step: Step) -> None:
        """No estimate."""

    def belief(self) -> None:
        """None."""

    def map(self) -> Map:
        return self._solution.map

    def finish(self) -> Solution:
        return self._solution


def test_motions_without_a_covariance_are_no_interpolation_from_one_side() -> None:
    """A covariance that is spoilt after its link was made: no estimate of the steps inside, and no covariances."""
    log, _ = random_log(np.random.default_rng(6), 40, 6, noise=0.3, blind=0.9)
    backend, _ = run("smoother", log)
    g = backend._forest.g
    inside = next(k for k in range(int(g.state[_graph.STEPS])) if g.at[k] < -1)
    g.steps[inside, _graph.NOISE : _graph.NOISE + 6] = (-1e6, 0.0, 0.0, -1e6, 0.0, -1e6)
    for ask in (backend._forest.estimate, backend._forest.pose_covariances, backend.finish):
        with pytest.raises(Diverged, match="the covariance of a motion is not positive definite"):
            ask()

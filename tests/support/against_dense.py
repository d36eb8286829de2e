"""Compares smoothed solutions with dense Gauss-Newton, on random logs of every kind."""

from typing import Any

import numpy as np
import pytest

from dense_fit import Dense, dense_fit
from hard_logs import with_given, with_loops
from slamduel.backends.api import Solution
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Dataset, Log

KINDS = ("plain", "loops", "blocks", "joint", "fixed")


def of_kind(kind: str, made: Dataset, rng: np.random.Generator) -> Log:
    if kind == "plain":
        return made.log
    made = with_loops(made, 4, rng)
    return made.log if kind == "loops" else with_given(made, kind, rng).log


def dense(log: Log, found: Solution, iterations: int = 6, **loss: Any) -> Dense:
    """The optimum near the solution."""
    return dense_fit(log, found.path, dict(zip(found.map.ids.tolist(), found.map.xy, strict=True)), iterations, **loss)


def agrees(log: Log, found: Solution) -> None:
    best, n = dense(log, found), len(log)
    fitted = misfit(log, found.path, found.map)
    assert fitted.total == pytest.approx(best.cost, rel=1e-9, abs=1e-9)
    assert found.path == pytest.approx(best.path, abs=1e-6)
    for k in range(n):
        there = best.cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert np.abs(found.cov[k] - there).max() < 1e-5 * np.abs(there).max()
    moving = [i for i, landmark in enumerate(found.map.ids.tolist()) if landmark in best.xy]
    order = list(best.xy)
    here = np.array([2 * i + a for i in moving for a in (0, 1)], int)
    there = np.array([3 * n + 2 * order.index(int(found.map.ids[i])) + a for i in moving for a in (0, 1)], int)
    if len(here):
        cov = best.cov[np.ix_(there, there)]
        assert np.abs(found.map.cov[np.ix_(here, here)] - cov).max() < 1e-5 * np.abs(cov).max()

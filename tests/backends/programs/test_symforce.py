"""SymForce behind the backend's interface: the package's own minimum of J, and its Jacobians against differences."""

import numpy as np
import pytest

from driven import final, make
from laps import laps
from random_logs import random_log
from slamduel.backends.api import Unsuited
from slamduel.backends.programs import symforce
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Log, Map, Prior
from slamduel.core.se2 import Array, between

installed = pytest.mark.skipif(symforce.cc_sym is None, reason=symforce.build.lacks() or "installed")


def with_map(known: bool, joint: bool, seed: int = 3) -> Log:
    """A log with sightings and loops, that may begin with a map, with its joint covariance or without."""
    rng = np.random.default_rng(seed)
    drive = random_log(rng, 60, 10, noise=0.5)
    if not known:
        return drive.log
    assert drive.truth is not None
    assert drive.truth.map is not None
    ids, xy, _ = drive.truth.map
    some = slice(0, 6)
    cov = None
    if joint:
        root = 0.02 * (np.eye(12) + 0.3 * rng.standard_normal((12, 12)))
        cov = root @ root.T
    given = Map(ids[some], xy[some] + 0.005 * rng.standard_normal((6, 2)), cov)
    return Log.from_steps("given", drive.log.prior._replace(map=given), list(drive.log))


KINDS = {"no map": (False, False), "fixed map": (True, False), "uncertain map": (True, True)}


@pytest.mark.parametrize("kind", KINDS)
def test_jacobians_are_those_of_differences(kind: str) -> None:
    """Central differences with h = 1e-6: errors of h^2 and of rounding / h, of numbers up to 1e3."""
    log = with_map(*KINDS[kind])
    graph = symforce.Graph(log.prior, list(log))
    at = np.concatenate((graph.path.ravel(), graph.xy[graph.free].ravel()))
    at = at + 0.01 * np.random.default_rng(0).standard_normal(len(at))
    residuals, J = graph.linearised(at)
    h = 1e-6

    def residual(variables: Array) -> Array:
        return graph.linearised(variables)[0]

    columns = [(residual(at + e) - residual(at - e)) / (2 * h) for e in h * np.eye(len(at))]
    assert J.shape == (len(residuals), len(at))
    assert np.abs(J.toarray() - np.array(columns).T).max() < 1e-6 * np.abs(J.data).max()


@pytest.mark.parametrize("kind", KINDS)
def test_the_squared_residuals_are_j(kind: str) -> None:
    log = with_map(*KINDS[kind])
    graph = symforce.Graph(log.prior, list(log))
    at = np.concatenate((graph.path.ravel(), graph.xy[graph.free].ravel()))
    path, xy = graph.split(at)
    mine = float(np.square(graph.linearised(at)[0]).sum())
    assert mine == pytest.approx(misfit(log, path, Map(graph.ids, xy, None)).total, rel=1e-9)


@installed
@pytest.mark.parametrize("kind", KINDS)
def test_it_ends_at_the_minimum_of_the_same_j(kind: str) -> None:
    log = with_map(*KINDS[kind])
    batch, solution = final("graph", log), final("symforce", log)
    least, reached = (misfit(log, one.path, one.map).total for one in (batch, solution))
    assert solution.converged
    assert reached == pytest.approx(least, rel=1e-8)
    assert np.abs(between(batch.path, solution.path)).max() < 1e-4


@installed
@pytest.mark.parametrize("seed", range(4))
def test_so_it_does_with_loop_closures(seed: int) -> None:
    log = laps(np.random.default_rng(seed)).log
    batch, solution = final("graph", log), final("symforce", log)
    assert np.abs(between(batch.path, solution.path)).max() < 1e-4
    assert not len(solution.map.ids)


@installed
def test_iterations_that_do_not_suffice_are_said() -> None:
    log = laps(np.random.default_rng(0)).log
    assert not final("symforce", log, iterations=1).converged
    assert make("symforce", log.prior).step(next(iter(log))) is None


def test_where_it_is_not_installed_it_makes_no_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(symforce, "cc_sym", None)
    with pytest.raises(Unsuited, match=r"symforce is not installed; pip install 'slamduel\[programs\]'"):
        make("symforce", Prior(np.zeros(3), np.eye(3), None))

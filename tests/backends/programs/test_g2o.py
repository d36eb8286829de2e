"""g2o behind the backend's interface: the same factors, J and losses as the package's own batch solver."""

from pathlib import Path

import numpy as np
import pytest

from driven import final, make, run
from laps import laps
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Unsuited
from slamduel.backends.common_options import LOSSES
from slamduel.backends.programs import g2o
from slamduel.bench.cli import main
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Dataset, Log, Map, Prior
from slamduel.core.se2 import between
from slamduel.datasets.false_loops import planted

installed = pytest.mark.skipif(g2o.g2opy is None, reason=g2o.build.lacks() or "installed")


@pytest.fixture(scope="module")
def drive() -> Dataset:
    return random_log(np.random.default_rng(3), 150, 15, noise=0.5)


@installed
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("algorithm", ["gauss-newton", "levenberg-marquardt", "dogleg"])
def test_it_ends_at_the_minimum_of_the_same_j(algorithm: str, seed: int) -> None:
    """With ranges and bearings, of which g2o's wheel has no edge, as on a pose graph."""
    rng = np.random.default_rng(seed)
    for log in (random_log(rng, 100, 12, noise=0.5).log, laps(rng).log):
        batch, solution = final("graph", log), final("g2o", log, algorithm=algorithm)
        least, reached = (misfit(log, one.path, one.map).total for one in (batch, solution))
        assert solution.converged
        assert reached == pytest.approx(least, rel=1e-8)
        assert np.abs(between(batch.path, solution.path)).max() < 1e-4
        assert solution.map.ids.tolist() == batch.map.ids.tolist()


@installed
@pytest.mark.parametrize("loss", sorted(g2o.KERNELS))
def test_losses_are_those_of_the_other_backends(loss: str) -> None:
    assert set(g2o.KERNELS) == set(LOSSES) - {"none"}
    log = planted(laps(np.random.default_rng(1)), 0.2, np.random.default_rng(2)).log
    batch, solution = final("graph", log, loss=loss), final("g2o", log, loss=loss)
    assert np.abs(between(batch.path, solution.path)).max() < 2e-3


@installed
def test_every_so_many_steps_it_has_an_online_estimate(drive: Dataset) -> None:
    """Near dead reckoning from the last optimum, which is iSAM2's at that step."""
    backend, path = run("g2o", drive.log, every=10)
    _, other = run("isam2", drive.log, relinearize_skip=1)
    optimised = np.arange(9, len(path), 10)
    assert np.abs(between(path, other))[optimised].max() < 0.02
    assert backend.belief().cov is None
    assert final("g2o", drive.log).path == pytest.approx(backend.finish().path, abs=1e-6)
    assert make("g2o", drive.log.prior).step(next(iter(drive.log))) is None


@installed
def test_a_given_map_is_held_where_it_is(drive: Dataset) -> None:
    assert drive.truth is not None
    assert drive.truth.map is not None
    known = drive.truth.map
    given = drive.log.prior._replace(map=Map(known.ids, known.xy + 0.01, None))
    log = Log.from_steps("given", given, list(drive.log))
    batch, solution = final("graph", log), final("g2o", log)
    assert np.abs(between(batch.path, solution.path)).max() < 1e-4
    order = np.argsort(solution.map.ids)
    assert solution.map.xy[order] == pytest.approx(known.xy[np.argsort(known.ids)] + 0.01)
    joint = given._replace(map=Map(known.ids, known.xy, 1e-4 * np.eye(2 * len(known.ids))))
    with pytest.raises(Unsuited, match="joint covariance"):
        make("g2o", joint)


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("name", ["g2o", "g2o[every=5]"])
def test_where_it_is_not_installed_its_cells_are_skipped_and_others_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(g2o, "g2opy", None)
    asked = ["--dataset", "circle[steps=20]", "--seeds", "2", "--out", str(tmp_path / "out"), "--executor", "here"]
    assert main(["run", "--backend", f"{name},dead-reckoning", *asked]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "pip install 'slamduel[programs]'" in said
    assert main(["check", name]) == 1
    assert "pip install 'slamduel[programs]'" in capsys.readouterr().out
    assert main(["list"]) == 0
    assert "g2opy is not installed" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(Unsuited, match="backend g2o: g2opy is not installed"):
        registry.find("g2o").make(Prior(np.zeros(3), np.eye(3), None), g2o.Options(), np.random.default_rng(0))

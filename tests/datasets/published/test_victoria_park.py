from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

from slamduel.core.check import problems
from slamduel.core.factors import Log
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published import victoria_park

FILE = Path(gtsam.findExampleDataFile("victoria_park.txt"))


@pytest.fixture(scope="module")
def log() -> Log:
    return victoria_park.source.make(victoria_park.Options(), np.random.default_rng(0)).log


def test_nothing_of_the_file_is_lost(log: Log):
    assert len(log) == 6969
    assert len(log.ids) == 3640
    assert len(np.unique(log.ids)) == 151
    assert list(problems(log)) == []


def test_there_is_no_truth():
    assert victoria_park.source.make(victoria_park.Options(), np.random.default_rng(0)).truth is None


def test_sightings_and_motions_are_the_file_s(log: Log):
    """gtsam's own parser of the same file, against ours."""
    graph, _ = gtsam.load2D(str(FILE))
    motions, sightings = list[list[float]](), list[list[float]]()
    for k in range(graph.size()):
        factor: Any = graph.at(k)
        if isinstance(factor, gtsam.BetweenFactorPose2):
            pose = factor.measured()
            motions.append([pose.x(), pose.y(), pose.theta()])
        else:
            sightings.append([factor.keys()[1] % 2**56, factor.measured().range(), factor.measured().bearing().theta()])
    np.testing.assert_allclose(log.delta[1:], motions, atol=1e-12)
    found = np.column_stack((log.ids, log.z))
    assert len(found) == len(sightings)
    np.testing.assert_allclose(found, sightings, atol=1e-9)


def test_the_log_is_what_it_was():
    """Results that were published with it stay comparable: the factors are these, bit for bit."""
    found = victoria_park.source.make(victoria_park.Options(), np.random.default_rng(0)).log
    assert found.digest == "e93839eeeb58d76b382aad65e6cb2b3e6a42701fc287fef39089c72f245e5aff"
    assert found.name == "victoria-park"
    assert "University of Sydney" in found.notes["source"]


def test_the_log_survives_the_disk(log: Log, tmp_path: Path):
    log_folder.write(tmp_path / "log", log, None)
    found = log_folder.read(tmp_path / "log")
    assert found.log.digest == log.digest
    assert found.log.notes == log.notes
    assert found.truth is None


def test_odometry_can_be_stated_less_sure_than_the_file_does() -> None:
    log = victoria_park.source.make(victoria_park.Options(), np.random.default_rng(0)).log
    wider = victoria_park.source.make(victoria_park.Options(odometry_sd=5.0), np.random.default_rng(0)).log
    assert np.array_equal(wider.delta_cov, 25 * log.delta_cov, equal_nan=True)
    assert np.array_equal(wider.delta, log.delta, equal_nan=True)
    assert np.array_equal(wider.z_cov, log.z_cov)

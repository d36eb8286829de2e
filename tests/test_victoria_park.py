from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

from slamduel.datasets import logfile, victoria_park
from slamduel.frontend.check import problems
from slamduel.frontend.errors import InputError
from slamduel.frontend.factors import Log
from slamduel.frontend.options import NoOptions

FILE = Path(gtsam.findExampleDataFile("victoria_park.txt"))
SMALL = """ODOMETRY 0 1 1 0 0.5 0.04 0 0 0.01 0 0.02
LANDMARK 1 2 3 4 0.4 0 0.4
ODOMETRY 1 3 2 1 -0.5 0.04 0.01 0.002 0.01 0.001 0.02
LANDMARK 3 2 1 -2 0.5 0.1 0.3
LANDMARK 0 7 5 0 0.4 0 0.4
"""


@pytest.fixture(scope="module")
def log() -> Log:
    return victoria_park.source.make(NoOptions(), np.random.default_rng(0)).log


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.txt"
    path.write_text(SMALL)
    return path


def test_nothing_of_the_file_is_lost(log: Log):
    assert len(log) == 6969
    assert len(log.ids) == 3640
    assert len(np.unique(log.ids)) == 151
    assert list(problems(log)) == []


def test_there_is_no_truth():
    assert victoria_park.source.make(NoOptions(), np.random.default_rng(0)).truth is None


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


def test_a_row_is_a_factor(small: Path):
    log = victoria_park.read(small).log
    assert len(log) == 3
    np.testing.assert_array_equal(log.sighting_step, [0, 1, 2])
    np.testing.assert_array_equal(log.ids, [7, 2, 2])
    np.testing.assert_allclose(log.z, [[5, 0], [5, np.arctan2(4, 3)], [5**0.5, np.arctan2(-2, 1)]])
    np.testing.assert_array_equal(log.delta[1:], [[1, 0, 0.5], [2, 1, -0.5]])
    np.testing.assert_array_equal(log.t, [0, 1, 2])
    np.testing.assert_array_equal(log.prior.cov, 1e-9 * np.eye(3))
    np.testing.assert_allclose(log.z_cov[1], np.diag([0.4, 0.4 / 25]), atol=1e-15)


def test_a_motion_s_covariance_is_of_the_frame_before_it(small: Path):
    """A small error in GTSAM's frame, after the motion, pushed through gtsam's own retraction."""
    log = victoria_park.read(small).log
    rows = [np.array([[0.04, 0, 0], [0, 0.01, 0], [0, 0, 0.02]])]
    rows.append(np.array([[0.04, 0.01, 0.002], [0.01, 0.01, 0.001], [0.002, 0.001, 0.02]]))
    for step, cov in zip(list(log)[1:], rows, strict=True):
        assert step.odometry is not None
        pose, h = gtsam.Pose2(*step.odometry.delta), 1e-6

        def moved(error: np.ndarray, pose: gtsam.Pose2 = pose) -> np.ndarray:
            there = pose.retract(error)
            return np.array([there.x(), there.y(), there.theta()])

        jacobian = np.stack([(moved(h * e) - moved(-h * e)) / (2 * h) for e in np.eye(3)], axis=-1)
        np.testing.assert_allclose(step.odometry.cov, jacobian @ cov @ jacobian.T, atol=1e-10)


def test_range_and_bearing_covariance_is_first_order():
    rng = np.random.default_rng(1)
    xy, root = rng.normal(size=(20, 2)) * 5, rng.normal(size=(20, 2, 2))
    cov = root @ root.swapaxes(1, 2)
    z, z_cov = victoria_park.range_bearing(xy, cov)
    np.testing.assert_allclose(z, np.stack((np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0])), axis=-1))
    h = 1e-6
    shifted = [[victoria_park.range_bearing(xy + sign * h * e, cov)[0] for sign in (1, -1)] for e in np.eye(2)]
    jacobian = np.stack([(plus - minus) / (2 * h) for plus, minus in shifted], axis=-1)
    np.testing.assert_allclose(z_cov, jacobian @ cov @ jacobian.swapaxes(1, 2), rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(z_cov, z_cov.swapaxes(1, 2))


def test_the_log_survives_the_disk(log: Log, tmp_path: Path):
    logfile.write(tmp_path / "log", log, None)
    found = logfile.read(tmp_path / "log")
    assert found.log.digest == log.digest
    assert found.log.notes == log.notes
    assert found.truth is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "LANDMARK 3 2 1 -2 0.5",
            "LANDMARK 3 2 1 -2",
            "line 4: found 'LANDMARK' and 6 fields, expected",
        ),
        ("LANDMARK 3", "LAND 3", "line 4: found 'LAND' and 7 fields"),
        ("ODOMETRY 1 3", "ODOMETRY 2 3", "line 3: the motion starts at pose 2, expected 1"),
        ("LANDMARK 3", "LANDMARK 9", "line 4: a sighting from pose 9, expected one that is moved to"),
        ("0.04 0.01", "0.04 much", "line 3: could not convert string to float: 'much', expected"),
        (SMALL, "\n", "the file is empty"),
        (SMALL, "LANDMARK 1 2 3 4 0.4 0 0.4\n", "there is no ODOMETRY row"),
    ],
)
def test_a_bad_row_is_named(small: Path, old: str, new: str, words: str):
    small.write_text(SMALL.replace(old, new))
    with pytest.raises(InputError) as caught:
        victoria_park.read(small)
    assert str(small) in str(caught.value)
    assert words in str(caught.value)

"""The text graphs that GTSAM reads: every planar one it comes with, against GTSAM's own reader, and damaged ones."""

import re
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

from differences import central
from fuzzing import survivors
from refusals import refusal, refused, refused_at
from slamduel.core.coordinates import after_motion
from slamduel.core.factors import Dataset, Log
from slamduel.core.factors.check import problems
from slamduel.datasets.formats import gtsam_text, toro
from slamduel.datasets.registry import find

PLANAR = {
    # name: poses, odometry, loops, sightings, points, what the numbers of an edge are taken for
    "example.graph": (95, 94, 0, 422, 24, "graph"),
    "w100.graph": (100, 99, 201, 0, 0, "graph"),
    "w100_30.g2o": (30, 29, 30, 0, 0, "cov"),
    "w10000.graph": (10000, 9999, 54312, 0, 0, "graph"),
    "w20000.txt": (20061, 20060, 6771, 0, 0, "cov"),
    "victoria_park.txt": (6969, 6968, 0, 3640, 151, "cov"),
    "victoriaPark_reduced_1k.g2o": (1000, 999, 0, 606, 48, "root"),
    "cityTrees_reduced_1k.g2o": (1000, 999, 0, 406, 66, "root"),
    "noisyToyGraph.txt": (4, 3, 2, 0, 0, "g2o"),
    "optimizedNoisyToyGraph.txt": (4, 3, 2, 0, 0, "g2o"),
    "orientationsNoisyToyGraph.txt": (4, 3, 2, 0, 0, "g2o"),
    "pose2example.txt": (11, 10, 2, 0, 0, "g2o"),
}
OTHERS = {
    "T1_city10000_04.txt": "line 1: found 8 numbers after the tag, expected 11",  # several hypotheses an edge
    "goats_15.pyfg": "line 949: found the tag 'EDGE_RANGE', expected one of",
    "sphere2500.txt": "line 1: rows EDGE3 are of a graph in space, 3D",
    "sphere_smallnoise.graph": "line 1: rows VERTEX3 are of a graph in space, 3D",
    "pose3example.txt": "line 1: rows VERTEX_SE3:QUAT are of a graph in space, 3D",
}
SMALL = """VERTEX2 0 1 2 0.5
VERTEX2 1 9 9 0.9
VERTEX_XY 1 4 4
EDGE2 0 1 1 0.1 0.2 0.4 0 0.5 0.6 0 0
EDGE2 2 1 -1 0.2 -0.3 0.4 0.1 0.5 0.6 0.02 0.03
ODOMETRY 0 2 2 0.3 0.5 0.4 0 0.5 0.6 0 0
BR 2 1 7.5e-1 4 0.1 0.2
LANDMARK 0 1 3 4 0.5 0.1 0.7
EQUIV 0 2
BR 2 0 -2 3 0.1 0.2
"""
"""Covariances in TORO's order, to judge by the zeros of the first edge; points and poses with the same ids."""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.graph"
    path.write_text(SMALL)
    return path


def read(name: str) -> Log:
    source = find("gtsam")
    return source.make(source.options(path=name), np.random.default_rng(0)).log


@pytest.mark.parametrize("name", PLANAR)
def test_every_planar_graph_of_the_wheel_is_read_whole(name: str) -> None:
    poses, odometry, loops, sightings, points, noise = PLANAR[name]
    log = read(name)
    assert list(problems(log)) == []
    assert (len(log), len(log.delta) - 1, len(log.loop_to)) == (poses, odometry, loops)
    assert (len(log.ids), len(np.unique(log.ids))) == (sightings, points)
    assert log.notes["edge_noise"] == noise
    lines = [line.split() for line in Path(gtsam.findExampleDataFile(name)).read_text().split("\n") if line.strip()]
    counted = log.notes["first_guesses_not_used"] + log.notes["equivalences_not_used"]
    assert len(lines) == odometry + loops + sightings + counted


@pytest.mark.parametrize("name", OTHERS)
def test_graphs_of_another_kind_are_turned_down(name: str) -> None:
    assert OTHERS[name] in refusal(read, name)


@pytest.mark.parametrize("name", ["example.graph", "w20000.txt", "victoria_park.txt"])
def test_factors_are_those_of_gtsam_s_own_reader(name: str) -> None:
    """Motions with their covariances, which it too has after the motion, and ranges and bearings."""
    log = read(name)
    graph, _ = gtsam.load2D(gtsam.findExampleDataFile(name))
    motions, sightings = list[list[float]](), list[list[float]]()
    covs = list[Any]()
    for k in range(graph.size()):
        factor: Any = graph.at(k)
        if isinstance(factor, gtsam.BetweenFactorPose2):
            pose = factor.measured()
            motions.append([pose.x(), pose.y(), pose.theta()])
            covs.append(factor.noiseModel().sigmas() ** 2)
        else:
            sightings.append([factor.keys()[1] % 2**56, factor.measured().range(), factor.measured().bearing().theta()])
    found = np.concatenate((log.delta[1:], log.loop_delta)), np.concatenate((log.delta_cov[1:], log.loop_cov))
    order = np.lexsort(np.array(motions).T), np.lexsort(found[0].T)
    np.testing.assert_allclose(found[0][order[1]], np.array(motions)[order[0]], atol=1e-12)
    diagonals = np.einsum("mii->mi", after_motion(*found))
    np.testing.assert_allclose(diagonals[order[1]], np.array(covs)[order[0]], rtol=1e-9)
    np.testing.assert_allclose(np.column_stack((log.ids, log.z)), np.array(sightings).reshape(-1, 3), atol=1e-9)


def test_the_deviations_of_a_bearing_and_a_range_are_squared() -> None:
    log = read("example.graph")
    np.testing.assert_allclose(log.z_cov, np.broadcast_to(np.diag([0.1, 0.0349]) ** 2, (422, 2, 2)))


def test_isam_s_roots_are_those_of_the_same_log_s_covariances() -> None:
    """Victoria Park once more, its first 1,000 poses: what the roots mean is found there, not said."""
    whole, reduced = read("victoria_park.txt").head(1000), read("victoriaPark_reduced_1k.g2o")
    pairs = [list(zip(log.sighting_step.tolist(), log.ids.tolist(), strict=True)) for log in (whole, reduced)]
    same = [row for row, pair in enumerate(pairs[0]) if pair in set(pairs[1])]
    assert [pairs[0][row] for row in same] == pairs[1]  # 606 of the 613: a few trees have been left out
    np.testing.assert_allclose(reduced.delta[1:], whole.delta[1:], atol=1e-6)
    np.testing.assert_allclose(reduced.delta_cov[1:], whole.delta_cov[1:], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(reduced.z, whole.z[same], rtol=1e-5)
    np.testing.assert_allclose(reduced.z_cov, whole.z_cov[same], rtol=1e-4, atol=1e-9)


def test_rows_become_factors(small: Path) -> None:
    log = gtsam_text.read(small).log
    assert len(log) == 3
    np.testing.assert_array_equal(log.prior.pose, [1, 2, 0.5])
    np.testing.assert_array_equal(log.sighting_step, [0, 2, 2])
    np.testing.assert_array_equal(log.ids, [1, 1, 0])
    np.testing.assert_allclose(log.z, [[5, np.arctan2(4, 3)], [4, 0.75], [3, -2]])
    np.testing.assert_allclose(log.z_cov[1], np.diag([0.04, 0.01]))
    np.testing.assert_array_equal(log.loop_to, [0])
    after = after_motion(log.loop_delta, log.loop_cov)
    np.testing.assert_allclose(after[0], np.diag([0.4, 0.5, 0.6]), atol=1e-15)
    assert log.notes["equivalences_not_used"] == 1


ISAM = """ODOMETRY 0 1 1 0 0.5 0.04 0 0 0.01 0 0.02
LANDMARK 1 2 3 4 0.4 0 0.4
ODOMETRY 1 3 2 1 -0.5 0.04 0.01 0.002 0.01 0.001 0.02
LANDMARK 3 2 1 -2 0.5 0.1 0.3
LANDMARK 0 7 5 0 0.4 0 0.4
"""
"""As Victoria Park is written: poses and trees share one run of numbers, and covariances are by rows."""


def test_victoria_park_s_rows_become_factors(tmp_path: Path) -> None:
    path = tmp_path / "small.txt"
    path.write_text(ISAM)
    log = gtsam_text.read(path).log
    assert len(log) == 3
    np.testing.assert_array_equal(log.sighting_step, [0, 1, 2])
    np.testing.assert_array_equal(log.ids, [7, 2, 2])
    np.testing.assert_allclose(log.z, [[5, 0], [5, np.arctan2(4, 3)], [5**0.5, np.arctan2(-2, 1)]])
    np.testing.assert_array_equal(log.delta[1:], [[1, 0, 0.5], [2, 1, -0.5]])
    np.testing.assert_array_equal(log.t, [0, 1, 2])
    np.testing.assert_array_equal(log.prior.cov, 1e-9 * np.eye(3))
    np.testing.assert_allclose(log.z_cov[1], np.diag([0.4, 0.4 / 25]), atol=1e-15)


def test_a_motion_s_covariance_is_of_the_frame_before_it(tmp_path: Path) -> None:
    """A small error in GTSAM's frame, after the motion, pushed through gtsam's own retraction."""
    path = tmp_path / "small.txt"
    path.write_text(ISAM)
    rows = [np.array([[0.04, 0, 0], [0, 0.01, 0], [0, 0, 0.02]])]
    rows.append(np.array([[0.04, 0.01, 0.002], [0.01, 0.01, 0.001], [0.002, 0.001, 0.02]]))
    for step, cov in zip(list(gtsam_text.read(path).log)[1:], rows, strict=True):
        pose = gtsam.Pose2(*step.odometry.delta)

        def moved(error: np.ndarray, pose: gtsam.Pose2 = pose) -> np.ndarray:
            there = pose.retract(error)
            return np.array([there.x(), there.y(), there.theta()])

        jacobian = central(moved, np.zeros(3))
        np.testing.assert_allclose(step.odometry.cov, jacobian @ cov @ jacobian.T, atol=1e-10)


def test_an_edge_s_numbers_are_what_one_says_they_are(small: Path) -> None:
    """The edge that goes forward, by all six names, against its matrix written out."""
    numbers = "0.4 0.01 0.02 0.6 0.03 0.7"
    small.write_text(f"EDGE2 0 1 1 0.1 0 {numbers}\n")
    rows = np.array([[0.4, 0.01, 0.02], [0.01, 0.6, 0.03], [0.02, 0.03, 0.7]])
    toros = np.array([[0.4, 0.01, 0.03], [0.01, 0.02, 0.7], [0.03, 0.7, 0.6]])
    root = np.triu(rows)
    expected = {"cov": rows, "g2o": np.linalg.inv(rows), "root": np.linalg.inv(root.T @ root)}
    for noise, cov in expected.items():
        np.testing.assert_allclose(gtsam_text.read(small, noise).log.delta_cov[1], cov, rtol=1e-12)
    refused("line 1: the information is not positive definite", gtsam_text.read, small, "toro")
    assert np.linalg.eigvalsh(toros)[0] < 0
    refused("line 1: the covariance is not positive definite", gtsam_text.read, small, "graph")
    refused("line 1: the six numbers of an edge have no zeros from which to guess their order", gtsam_text.read, small)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("BR 2 1 7.5e-1 4 0.1", "BR 2 1 7.5e-1 4", "line 7: found 5 numbers after the tag, expected 6 (pose id"),
        ("BR 2 1 7.5e-1 4", "BR 2 1 7.5e-1 -4", "line 7: range is -4.0, expected more than 0"),
        ("BR 2 1 7.5e-1 4", "BR 2 1 7.5e-1 4e9", "line 7: range is 4000000000.0, expected -1e+09 to 1e+09"),
        ("BR 2 1 7.5e-1 4", "BR 2 1 75 4", "line 7: bearing is 75.0, expected radians"),
        ("BR 2 1 7.5e-1 4 0.1", "BR 2 1 7.5e-1 4 0", "line 7: the covariance is not positive definite"),
        ("BR 2 1", "BR 5 1", "line 7: a sighting from pose 5, expected a pose of an edge or a vertex"),
        ("LANDMARK 0 1 3 4 0.5", "LANDMARK 0 1 3 4 -0.5", "line 8: the covariance is not positive definite"),
        ("BR 2 0 -2", "BR 2 1 -2", "line 10: id 1 occurs twice in step 2"),
        ("EQUIV", "EQUAL", "line 9: found the tag 'EQUAL', expected one of VERTEX2"),
    ],
)
def test_a_row_that_cannot_be_used_is_named(small: Path, old: str, new: str, words: str) -> None:
    assert old in SMALL
    small.write_text(SMALL.replace(old, new))
    refused_at(small, words, gtsam_text.read, small)


def test_a_file_that_is_nowhere_is_a_sentence() -> None:
    refused("no_such_graph: there is no such file", read, "no_such_graph")


def fit(dataset: Dataset) -> None:
    assert list(problems(dataset.log)) == []


def test_damaged_files_load_or_are_turned_down(small: Path) -> None:
    found, sentences = survivors(gtsam_text.read, small, 400, 3, fit)
    assert len(found) > 30
    assert len(sentences) > 100


def test_a_damaged_toro_file_loads_or_is_turned_down(tmp_path: Path) -> None:
    path = tmp_path / "small.toro"
    path.write_text("".join(f"{line}\n" for line in SMALL.split("\n") if re.match("VERTEX2|EDGE2|EQUIV", line)))
    found, sentences = survivors(toro.read, path, 400, 4, fit)
    assert len(found) > 30
    assert len(sentences) > 100

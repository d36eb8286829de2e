from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from batch_fit import aligned, fitted, rmse
from differences import central
from driven import run
from fuzzing import survivors
from recorded import at_hand
from refusals import refused, refused_at
from slamduel.core.factors import Dataset, Log, Map
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, compose
from slamduel.datasets.published import freiburg
from slamduel.datasets.published.freiburg import Options

SENSOR = """ODOMETRY 0.1 0.5 0.05
SENSOR 1 1.9 0.37
SENSOR 2 3.8 3.21
ODOMETRY -0.3 0.2 -0.1
SENSOR 2 -0.03 -0.5
ODOMETRY 0 0 0
ODOMETRY 0.01 0.1 0
SENSOR 2 3.7 1.2
"""
WORLD = "1 2 1\n2 0 4\n3 7 7\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sensor_data.dat").write_text(SENSOR)
    (tmp_path / "world.dat").write_text(WORLD)
    return tmp_path


def moved(turns: Array) -> Array:
    """The same motion, made of the algebra of poses: a turn, a way, a turn."""
    first, way, second = turns
    pose = compose(np.array([0.0, 0.0, first]), np.array([way, 0.0, 0.0]))
    return compose(pose, np.array([0.0, 0.0, second]))


TURNS = [[0.1, 0.5, 0.05], [-0.3, 0.2, -0.1], [0.0, 0.0, 0.0], [2.0, 3.0, 2.5], [-1.0, -0.4, 0.2]]


def test_a_motion_is_turn_way_turn():
    found, _ = freiburg.relative(np.array(TURNS))
    np.testing.assert_allclose(found, [moved(np.array(row)) for row in TURNS], atol=1e-15)
    assert found[0, 0] > 0  # forward
    assert found[0, 1] > 0  # and to the left, where it turned first


def test_its_jacobian_is_the_numerical_one():
    _, jacobian = freiburg.relative(np.array(TURNS))
    for row, found in zip(np.array(TURNS), jacobian, strict=True):
        if abs(row[0] + row[2]) < np.pi - 1e-3 or abs(row[0] + row[2]) > np.pi + 1e-3:
            np.testing.assert_allclose(found, central(moved, row), atol=1e-9)


def test_the_noise_is_that_of_the_turns():
    """Drawn turn by turn, way by way, as table 5.6 has it, against the covariance; 6 sigma of a sample's."""
    rng = np.random.default_rng(7)
    options = Options(alpha1=0.02, alpha2=0.003, alpha3=0.01, alpha4=0.004)
    turns, draws = np.array([0.02, 0.5, -0.05]), 200_000
    first, way, second = turns**2
    by_turn = [options.alpha1 * turn + options.alpha2 * way for turn in (first, second)]
    sd = np.sqrt([by_turn[0], options.alpha3 * way + options.alpha4 * (first + second), by_turn[1]])
    sample, _ = freiburg.relative(turns + sd * rng.normal(size=(draws, 3)))
    _, jacobian = freiburg.relative(turns[None])
    cov = jacobian[0] @ freiburg.turns_cov(turns[None], options)[0] @ jacobian[0].T
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    np.testing.assert_array_less(np.abs(np.cov(sample.T) - cov) / scale, 6 * np.sqrt(2 / draws) + 2e-3)  # curvature


def test_the_first_motion_is_the_prior(folder: Path):
    log = freiburg.read(folder, Options()).log
    assert len(log) == 4
    np.testing.assert_allclose(log.prior.pose, moved(np.array(TURNS[0])))
    np.testing.assert_array_equal(log.sighting_step, [0, 0, 1, 3])
    _, jacobian = freiburg.relative(np.array(TURNS[:1]))
    cov = jacobian @ freiburg.turns_cov(np.array(TURNS[:1]), Options()) @ jacobian.swapaxes(1, 2)
    np.testing.assert_allclose(log.prior.cov, cov[0] + 1e-9 * np.eye(3))
    np.testing.assert_allclose(log.delta[1], moved(np.array(TURNS[1])))
    assert list(problems(log)) == []


def test_a_robot_at_rest_is_given_a_floor(folder: Path):
    log = freiburg.read(folder, Options()).log
    np.testing.assert_array_equal(log.delta_cov[2], 1e-8 * np.eye(3))
    assert log.notes["floored"] == {"motions": 1}


def test_the_course_s_noise_is_a_choice(folder: Path):
    log = freiburg.read(folder, Options(motion="course", range_sd=0.2, bearing_sd=0.3)).log
    np.testing.assert_array_equal(log.delta_cov[1:], np.broadcast_to(np.diag([0.1, 0.1, 0.01]), (3, 3, 3)))
    np.testing.assert_allclose(log.z_cov, np.broadcast_to(np.diag([0.04, 0.09]), (4, 2, 2)))
    assert log.notes["floored"] == {"motions": 0}


def test_what_noise_did_to_a_sighting_is_mended_and_counted(folder: Path):
    log = freiburg.read(folder, Options()).log
    np.testing.assert_array_equal(log.ids, [1, 2, 2, 2])
    np.testing.assert_allclose(log.z, [[1.9, 0.37], [3.8, 3.21 - 2 * np.pi], [0.001, -0.5], [3.7, 1.2]])
    assert list(log.notes["lifted"].values()) == [1]


def test_the_landmarks_alone_are_the_truth(folder: Path):
    truth = freiburg.read(folder, Options()).truth
    assert (truth.t.shape, truth.poses.shape, truth.kind) == ((0,), (0, 3), "truth")
    np.testing.assert_array_equal(truth.map.ids, [1, 2, 3])
    np.testing.assert_array_equal(truth.map.xy, [[2, 1], [0, 4], [7, 7]])


def test_without_a_path_the_fetched_copy_is_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    refused(r"bench fetch freiburg .*\[path=FOLDER\]", freiburg.source.make, Options(), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("sensor_data.dat", "0.2 -0.1", "0.2", "line 4: found 2 numbers after ODOMETRY, expected 3 (rot1 trans rot2)"),
        ("sensor_data.dat", "-0.3 0.2", "-30 0.2", "line 4: it turns by -30.0 and -0.1, expected radians"),
        ("sensor_data.dat", "SENSOR 2 3.8", "LASER 2 3.8", "line 3: found 'LASER', expected ODOMETRY"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 1 3.8", "line 3: landmark 1 occurs twice after one motion"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 4 3.8", "line 3: landmark 4 is not in world.dat"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 2.5 3.8", "line 3: id is '2.5', expected a whole number from 0"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 5000000000 3.8", "line 3: landmark 5000000000 is not in world.dat"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 2", "line 3: found 2 numbers after SENSOR, expected 3 (id range"),
        ("sensor_data.dat", "SENSOR 2 3.8", "SENSOR 2 3e9", "line 3: range is '3e9', expected a number no larger than"),
        ("sensor_data.dat", "-0.03", "-0.6", "line 5: range is -0.6, expected more than 0, or at least -0.5"),
        ("sensor_data.dat", "3.21", "32.1", "line 3: bearing is 32.1, expected radians"),
        ("sensor_data.dat", "ODOMETRY 0.1 0.5 0.05\n", "", "line 1: a sighting before the first ODOMETRY"),
        ("sensor_data.dat", SENSOR, "# nothing\n", "found no ODOMETRY rows"),
        ("world.dat", "2 0 4", "1 0 4", "line 2: landmark 1 occurs twice"),
        ("world.dat", "2 0 4", "-2 0 4", "line 2: id is -2, expected 0 or more"),
        ("world.dat", "2 0 4", "2 0 4e10", "line 2: y is 40000000000.0, expected -1e+09 to 1e+09"),
    ],
)  # fmt: skip
def test_a_bad_row_is_named(folder: Path, name: str, old: str, new: str, words: str):
    path = folder / name
    content = path.read_text()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    refused_at(path, words, freiburg.read, folder, Options())


@pytest.mark.parametrize("name", ["sensor_data.dat", "world.dat"])
def test_a_damaged_file_is_read_or_turned_down(folder: Path, name: str):
    def fit(dataset: Dataset) -> None:
        assert list(problems(dataset.log)) == []
        assert len(dataset.log.ids) <= SENSOR.count("SENSOR") + 1  # a line may be doubled
        assert np.isfinite(dataset.truth.map.xy).all()

    def read(path: Path) -> Dataset:
        return freiburg.read(folder, Options())

    found, sentences = survivors(read, folder / name, cases=500, seed=6, fit=fit)
    assert len(found) > 50
    assert len(sentences) > 100


@pytest.fixture(scope="module")
def whole() -> Dataset:
    return freiburg.read(at_hand("freiburg"), Options())


def test_nothing_of_the_log_is_lost(whole: Dataset):
    log = whole.log
    assert (len(log), len(log.ids), len(np.unique(log.ids))) == (331, 1212, 9)
    assert list(problems(log)) == []
    assert list(log.notes["lifted"].values()) == [1]
    assert log.notes["floored"] == {"motions": 0}


def estimated(name: str, log: Log) -> Array:
    """(l, 2) the landmarks of a backend at its end."""
    backend, _ = run(name, log)
    solution = backend.finish()
    return places(solution.map if solution else backend.map())


def places(landmarks: Map) -> Array:
    return landmarks.xy[np.argsort(landmarks.ids)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ekf", "isam2", "graph", "fastslam"])
def test_the_landmarks_are_where_the_world_has_them(whole: Dataset, name: str):
    """From the origin, which leaves the heading of the first metres in the map, and aligned."""
    assert whole.truth.map is not None
    found, truth = estimated(name, whole.log), places(whole.truth.map)
    assert rmse(found, truth) < (0.3 if name == "fastslam" else 0.09)  # a particle's heading at the start is a draw
    assert rmse(aligned(found, truth), truth) < 0.03


def test_the_backends_agree_with_an_independent_optimum(whole: Dataset):
    fit = fitted(whole.log, whole.log.dead_reckoned(), iterations=8)
    np.testing.assert_allclose(estimated("graph", whole.log), fit.xy, atol=1e-6)
    np.testing.assert_allclose(estimated("ekf", whole.log), fit.xy, atol=0.01)


def test_the_default_noise_is_nearer_to_the_log_s_own_than_the_course_s(whole: Dataset):
    """chi2 at the batch optimum, of its degrees of freedom: sightings less the map and what the path takes up."""
    settings = replace(Options(), motion="course", bearing_sd=0.1)
    for options, low, high in ((Options(), 0.9, 1.05), (settings, 0.3, 0.45)):
        log = freiburg.read(at_hand("freiburg"), options).log
        fit = fitted(log, log.dead_reckoned(), iterations=15)
        assert low < fit.cost / (2 * len(log.ids) - 2 * len(fit.ids)) < high

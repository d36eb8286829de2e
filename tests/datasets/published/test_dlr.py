from pathlib import Path

import numpy as np
import pytest

from batch_fit import aligned, fitted, points, rmse
from differences import central
from driven import run
from fuzzing import survivors
from recorded import at_hand
from refusals import refused, refused_at
from slamduel.core.factors import Dataset, Log
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, act
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published import dlr
from slamduel.datasets.published.dlr import Options

HEADER = "# what the columns are\n#  STEP <image.ppm> <dX> ...\n \n"
MOTION = "0.00002 0.000001 0.00001 0.00003 -0.000002 0.0003"
CIRCLE = "0.0017 0.0002 0.0038"
SMALL = f"""{HEADER}STEP hall.0007.ppm 0.1 -0.2 0.3 {MOTION}
LANDMARK_C 1 -2 0.9 {CIRCLE} 3
STEP hall.0008.ppm -0.05 -0.5 -0.2 {MOTION}
LANDMARK_C -1 -1 0.7 {CIRCLE} 3
LANDMARK_C -1 -3 0.8 {CIRCLE} -1
LANDMARK -1.1 -1 0.9 {CIRCLE} 3
LANDMARK_C 2 -3 0.8 {CIRCLE} 4 5
LANDMARK_C 2.5 -3 0.8 {CIRCLE} -1
STEP hall.0009.ppm 0 0 0 0 0 0 0 0 0
LANDMARK_C 0.5 1 1 0 0 0 23001
"""
FORWARD, RIGHT = np.array([0.0, -1.0]), np.array([1.0, 0.0])
"""The robot's directions in the coordinates of its file."""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "map.circles"
    path.write_text(SMALL)
    return path


def motion(theirs: Array) -> Array:
    """Where the file's (dX, dY, dPhi) leads: what is gone forward, to the left, and how the nose turns to the left."""
    phi = theirs[2]
    nose = np.cos(phi) * FORWARD + np.sin(phi) * np.array([1.0, 0.0])  # turned from X towards Y
    moved = theirs[:2]
    return np.array([moved @ FORWARD, -moved @ RIGHT, np.arctan2(-nose @ RIGHT, nose @ FORWARD)])


def sighting(theirs: Array) -> Array:
    ahead, left = theirs @ FORWARD, -theirs @ RIGHT
    return np.array([np.hypot(ahead, left), np.arctan2(left, ahead)])


def test_a_motion_is_turned_into_our_frame_and_so_is_its_covariance(small: Path):
    log = dlr.read(small).log
    theirs = np.array([-0.05, -0.5, -0.2])
    assert log.delta[1, 0] > 0  # forward
    assert log.delta[1, 1] > 0  # and a little to the left, the file's X being to the right
    assert log.delta[1, 2] > 0  # where it turns to, the file's Phi being clockwise
    np.testing.assert_allclose(log.delta[1], motion(theirs), atol=1e-15)
    xx, xy, yy, xphi, yphi, phiphi = map(float, MOTION.split())
    cov = np.array([[xx, xy, xphi], [xy, yy, yphi], [xphi, yphi, phiphi]])
    jacobian = central(motion, theirs)
    np.testing.assert_allclose(log.delta_cov[1], jacobian @ cov @ jacobian.T, rtol=1e-8)


def test_a_sighting_is_turned_into_our_frame_and_so_is_its_covariance(small: Path):
    log = dlr.read(small).log
    assert log.z[0, 1] < 0  # to the right
    assert log.z[1, 1] > 0  # to the left
    xx, xy, yy = map(float, CIRCLE.split())
    for k, theirs in ((0, [1.0, -2.0]), (1, [-1.0, -3.0])):
        np.testing.assert_allclose(log.z[k], sighting(np.array(theirs)), atol=1e-15)
        jacobian = central(sighting, np.array(theirs))
        np.testing.assert_allclose(log.z_cov[k], jacobian @ [[xx, xy], [xy, yy]] @ jacobian.T, rtol=1e-7)


def test_a_circle_stays_where_it_is_while_the_robot_passes(tmp_path: Path):
    """A drive made up in the file's own left-handed coordinates: in ours the world stands still too."""
    rng = np.random.default_rng(4)
    circle, place, phi, rows = np.array([0.5, -9.0]), np.zeros(2), 0.0, list[str]()
    for k in range(30):
        gone, turn = np.array([0.05, -0.3]) + rng.normal(0, 0.02, 2), rng.normal(0, 0.2)
        c, s = np.cos(phi), np.sin(phi)
        place, phi = place + np.array([[c, -s], [s, c]]) @ gone, phi + turn
        c, s = np.cos(phi), np.sin(phi)
        seen = np.array([[c, s], [-s, c]]) @ (circle - place)
        rows.append(f"STEP a.{k:04} {gone[0]!s} {gone[1]!s} {turn!s} {MOTION}\n")
        rows.append(f"LANDMARK_C {seen[0]!s} {seen[1]!s} 1 {CIRCLE} 0\n")
    (tmp_path / "map.circles").write_text("".join(rows))
    log = dlr.read(tmp_path).log
    found = act(log.dead_reckoned(), np.stack((np.cos(log.z[:, 1]), np.sin(log.z[:, 1])), axis=-1) * log.z[:, :1])
    np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), atol=1e-12)


def test_who_has_no_name_or_two_is_unknown_and_who_is_there_twice_is_kept_once(small: Path):
    log = dlr.read(small).log
    np.testing.assert_array_equal(log.ids, [3, -1, 3, -1, -1, 23001])
    np.testing.assert_array_equal(log.sighting_step, [0, 1, 1, 1, 1, 2])
    np.testing.assert_allclose(log.z[2], sighting(np.array([-1.1, -1.0])))  # of the better quality
    assert log.notes["unknown"] == {"sightings": 3, "of these, with several ids": 1}
    assert list(log.notes["dropped"].values()) == [1]


def test_a_covariance_without_noise_is_given_a_floor(small: Path):
    log = dlr.read(small).log
    assert list(problems(log)) == []
    assert log.notes["floored"] == {"motions": 1, "sightings": 1}
    np.testing.assert_array_equal(log.delta_cov[2], 1e-8 * np.eye(3))
    np.testing.assert_allclose(np.diag(log.z_cov[5]), [1e-8, 1e-8 / 1.25])


def test_the_world_begins_at_the_first_image(small: Path):
    dataset = dlr.read(small)
    assert dataset.truth is None
    np.testing.assert_array_equal(dataset.log.prior.pose, np.zeros(3))
    np.testing.assert_array_equal(dataset.log.t, [0, 1, 2])


def test_the_folder_will_do_and_the_log_survives_the_disk(small: Path):
    rng = np.random.default_rng(0)
    log = dlr.source.make(Options(path=str(small.parent)), rng).log
    assert log.digest == dlr.source.make(Options(path=str(small)), rng).log.digest
    log_folder.write(small.parent / "log", log, None)
    found = log_folder.read(small.parent / "log")
    assert found.log.digest == log.digest
    assert found.log.notes == log.notes


def test_without_a_path_the_fetched_copy_is_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    refused(r"bench fetch dlr .*dlr\[path=map.circles\]", dlr.source.make, Options(), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("STEP hall.0008.ppm -0.05", "STEP hall.0008.ppm", "line 6: found 8 numbers after STEP, expected 9 (dX"),
        ("hall.0008", "hall.0007", "line 6: the image has number 7, expected 8, the next"),
        ("hall.0008.ppm", "hall", "line 6: the image is 'hall', expected a name that ends with its number"),
        ("-0.5 -0.2", "-0.5 -12", "line 6: dPhi is -12.0, expected radians"),
        ("-0.5 -0.2", "-0.5 nan", "line 6: dPhi is 'nan', expected a number"),
        (f"-0.2 {MOTION}", "-0.2 1 2 1 0 0 1", "line 6: the covariance's smallest eigenvalue is -1, its largest 3"),
        ("LANDMARK_C -1 -3", "LANDMARK_D -1 -3", "line 8: found 'LANDMARK_D' and 7 fields, expected STEP"),
        (f"{CIRCLE} 3", CIRCLE, "line 5: found 'LANDMARK_C' and 6 fields"),
        ("LANDMARK_C -1 -3", "LANDMARK_C 0 0.0001", "line 8: the circle is at 0.0, 0.0001, expected at least"),
        ("-1 -3 0.8", "-1 -3 1.8", "line 8: quality is 1.8, expected 0 to 1"),
        ("4 5", "4 5.5", "line 10: id is '5.5', expected a whole number from -1 to"),
        ("4 5", "4 -2", "line 10: id is '-2', expected"),
        ("23001", "9" * 30, "line 13: id is '999"),
        ("23001", "\u0663", "line 13: id is '\u0663', expected"),
        (SMALL, SMALL[SMALL.index("LANDMARK") :], "line 1: a sighting before the first STEP"),
        (SMALL, HEADER, "found no STEP rows"),
        (SMALL, "\n", "the file is empty"),
    ],
)  # fmt: skip
def test_a_bad_row_is_named(small: Path, old: str, new: str, words: str):
    assert old in SMALL
    small.write_text(SMALL.replace(old, new, 1))
    refused_at(small, words, dlr.read, small)


def test_a_damaged_file_is_read_or_turned_down(small: Path):
    def fit(dataset: Dataset) -> None:
        assert list(problems(dataset.log)) == []
        dropped = sum(dataset.log.notes["dropped"].values())
        assert len(dataset.log.ids) + dropped <= SMALL.count("LANDMARK") + 1  # a line may be doubled

    found, sentences = survivors(dlr.read, small, cases=600, seed=5, fit=fit)
    assert len(found) > 50
    assert len(sentences) > 200


@pytest.fixture(scope="module")
def whole() -> Log:
    return dlr.read(at_hand("dlr")).log


def test_nothing_of_the_log_is_lost(whole: Log):
    assert len(whole) == 3297
    assert len(whole.ids) == 14745
    assert (whole.ids == -1).sum() == 436
    assert len(np.unique(whole.ids[whole.ids != -1])) == 576
    assert list(problems(whole)) == []
    assert whole.notes["unknown"] == {"sightings": 436, "of these, with several ids": 0}
    assert [*whole.notes["dropped"].values(), *whole.notes["floored"].values()] == [0, 0, 0]


def test_a_motion_s_covariance_is_of_the_frame_before_it(whole: Log):
    """A wrong heading on the way moves the end across the way as it is seen from before: where the file's has it."""
    dx, dy, turn = whole.delta[1:].T
    across = np.arctan2(dx, -dy) - np.arctan2(whole.delta_cov[1:, 1, 2], whole.delta_cov[1:, 0, 2])
    across, far = np.abs((across + np.pi / 2) % np.pi - np.pi / 2), np.hypot(dx, dy) > 0.05
    turning = far & (np.abs(turn) > 0.1)
    assert turning.sum() > 500
    assert np.median(across[turning]) < 0.2 * np.median(np.abs(turn[turning]))


@pytest.mark.slow
def test_the_map_closes_its_loops(whole: Log):
    """Circles that are left for 100 steps and more: where they are placed before, and where at the last visit."""
    log = whole.identified()
    backend, path = run("ekf", log)
    fit = fitted(log, path, iterations=6)
    assert np.median(gaps(log, log.dead_reckoned())) > 5
    assert np.median(gaps(log, fit.path)) < 0.05
    assert np.percentile(gaps(log, fit.path), 90) < 0.25

    places = backend.map().xy[np.argsort(backend.map().ids)]
    assert rmse(aligned(places, fit.xy), fit.xy) < 0.5  # of a building of 40 m by 60 m
    assert 9000 < (fit.motions**2).sum() < 14000  # chi2 of 9,888 numbers: the odometry's covariances are right


def gaps(log: Log, path: Array) -> Array:
    """m, of each circle that is left for 100 steps: from the mean of its sightings before that to that of its last."""
    placed, step, found = points(log, path), log.sighting_step, list[float]()
    for name in np.unique(log.ids):
        mine = log.ids == name
        where, left = placed[mine], np.flatnonzero(np.diff(step[mine]) >= 100) + 1
        if len(left):
            found.append(float(np.linalg.norm(where[: left[0]].mean(axis=0) - where[left[-1] :].mean(axis=0))))
    assert len(found) > 150
    return np.array(found)

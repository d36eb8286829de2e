import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fuzzing import survivors
from recorded import at_hand
from refusals import refused
from slamduel.bench.measure.accuracy import align, aligned
from slamduel.core.factors import UNKNOWN, Dataset, Log, Truth
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, Ints, between, compose, wrap
from slamduel.core.truth.check import check_truth
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published.victoria_park_raw import AHEAD, HALF_AXLE, LEFT, LENGTH, Options, read

SPEED, STEERING = 2.0, 0.2
"""m/s of the middle of the rear axle, rad."""

RATE = SPEED / LENGTH * np.tan(STEERING)
"""rad/s."""

WHEEL = SPEED * (1 - np.tan(STEERING) * HALF_AXLE / LENGTH)
"""m/s of the left wheel, which is on the inside of a curve to the left."""


def rows(path: Path, table: NDArray[np.floating[Any]]) -> None:
    path.write_text("".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in table))


def laser(t: Array) -> Array:
    """(n, 3) where the laser of a car is that drives round a circle from the origin, along x at first."""
    heading = RATE * t
    radius = SPEED / RATE
    axle = np.column_stack((radius * np.sin(heading), radius * (1 - np.cos(heading)), heading))
    return compose(axle, np.broadcast_to((AHEAD, LEFT, 0.0), axle.shape))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A car that goes round for 20 s and sees two trees in every scan, the first of them before all readings."""
    t = 0.2 + 0.025 * np.arange(800.0)
    rows(tmp_path / "inputs.dat", np.column_stack((t, np.full_like(t, WHEEL), np.full_like(t, STEERING))))
    scans = np.repeat(0.1 + 0.2 * np.arange(100.0), 2)
    trees = np.tile([[5.0, np.pi / 2 + 0.3, 0.4], [9.0, 0.5, 0.8]], (100, 1))
    rows(tmp_path / "measurements.dat", np.column_stack((scans, trees)))
    t = np.concatenate((np.arange(0.0, 8.0, 0.2), np.arange(12.0, 20.0, 0.2)))
    rows(tmp_path / "gps.dat", np.column_stack((t, laser(t)[:, :2])))
    return tmp_path


def made(folder: Path, options: Options | None = None) -> tuple[Log, Truth]:
    log, truth = read(folder, options or Options())
    assert truth is not None
    assert list(problems(log)) == []
    check_truth(log, truth, "log")
    return log, truth


def test_the_path_is_that_of_the_laser_of_a_car(folder: Path):
    log, _ = made(folder)
    path = laser(log.t)
    np.testing.assert_allclose(log.delta[1:], between(path[:-1], path[1:]), atol=2e-6)


def test_a_bearing_is_from_straight_ahead_and_every_detection_is_unknown(folder: Path):
    log, truth = made(folder)
    assert set(log.ids.tolist()) == {UNKNOWN}
    np.testing.assert_allclose(log.z[:2], [[5.0, 0.3], [9.0, 0.5 - np.pi / 2]], atol=1e-6)
    assert (len(log), len(log.ids)) == (100, 200)
    assert (truth.map, truth.assigned, truth.kind) == (None, None, "truth")


def test_gps_is_the_truth_where_it_has_fixes_and_its_course_is_the_heading(folder: Path):
    log, truth = made(folder)
    right = laser(truth.t)
    np.testing.assert_allclose(truth.poses[:, :2], right[:, :2], atol=2e-3)  # on a chord
    course = right[:, 2] + np.arctan2(RATE * AHEAD, SPEED - RATE * LEFT)  # of the laser, which is ahead of the axle
    inside = (truth.t > 1.4) & (truth.t < 18.4) & (np.abs(truth.t - 10) > 3.4)
    np.testing.assert_allclose(wrap(truth.poses[:, 2] - course)[inside], 0, atol=1e-3)
    unknown = (log.t > 7.8) & (log.t < 12.0) | (log.t > 19.8)
    np.testing.assert_array_equal(truth.t, log.t[~unknown])


def test_a_car_that_stands_keeps_its_course_and_has_little_noise(folder: Path):
    inputs = np.loadtxt(folder / "inputs.dat")
    stands = inputs[:, 0] > 10
    inputs[stands, 1] = 0.0
    rows(folder / "inputs.dat", inputs)
    t = np.arange(0.0, 20.0, 0.2)
    rows(folder / "gps.dat", np.column_stack((t, laser(np.minimum(t, 10.0))[:, :2])))
    log, truth = made(folder)
    assert np.ptp(truth.poses[truth.t > 11, 2]) == 0
    sd = np.sqrt(np.einsum("kii->ki", log.delta_cov[1:]))
    np.testing.assert_allclose(sd[-1], 0.05 * np.sqrt(0.2) * np.array([0.2, 0.2, 0.0175]), rtol=1e-3)
    assert (sd[5] > np.sqrt(0.2) * np.array([0.2, 0.2, 0.0175])).all()


def test_a_steering_error_turns_the_car_and_moves_the_laser(folder: Path):
    """Over a second it turns by the rate's derivative, as the file's readings with that error would."""
    log, _ = made(folder, Options(steering=0.01, forward=1e-6, lateral=1e-6, turn=1e-6))
    off = np.loadtxt(folder / "inputs.dat")
    off[:, 2] += 1e-5
    rows(folder / "inputs.dat", off)
    by_steering = (made(folder)[0].delta[5] - log.delta[5]) / 1e-5
    sd = np.sqrt(np.diag(log.delta_cov[5]))
    np.testing.assert_allclose(sd, 0.01 * np.abs(by_steering) / np.sqrt(0.2), rtol=0.05)


def test_the_settings_are_the_noise(folder: Path):
    log, _ = made(folder, Options(range_sd=0.5, bearing_sd=0.1))
    np.testing.assert_array_equal(log.z_cov[7], np.diag([0.25, 0.1**2]))
    assert log.notes["settings"]["range_sd"] == 0.5


def test_gps_every_so_often_is_measured_and_the_truth_of_the_rest(folder: Path):
    plain, before = made(folder)
    log, truth = made(folder, Options(gps_every=3.0, gps_sd=0.5))
    assert np.sqrt(np.diag(log.prior.cov)).tolist() == pytest.approx([0.5, 0.5, 0.1])  # no better than GPS
    assert log.fixes is not None
    at = log.t[log.fixes.step]
    assert 4 <= len(at) <= 6
    assert ((np.diff(at) > 2.9) & (np.diff(at) < 7.5)).all()  # from 7.8 to 12 s there is none
    np.testing.assert_allclose(log.fixes.z[:, :2], laser(at)[:, :2], atol=2e-3)
    assert np.isnan(log.fixes.z[:, 2]).all()
    np.testing.assert_array_equal(log.fixes.cov[0, :2, :2], 0.25 * np.eye(2))
    np.testing.assert_array_equal(truth.t, np.setdiff1d(before.t, at))
    np.testing.assert_array_equal(log.z, plain.z)
    assert plain.fixes is None


def test_packed_files_are_the_same_log(folder: Path):
    plain, _ = made(folder)
    for file in list(folder.iterdir()):
        file.with_name(f"{file.name}.gz").write_bytes(gzip.compress(file.read_bytes()))
        file.unlink()
    assert made(folder)[0].digest == plain.digest
    (folder / "gps.dat.gz").write_bytes((folder / "gps.dat.gz").read_bytes()[:-100])
    refused(r"gps\.dat\.gz: cannot be unpacked", made, folder)


def replaced(name: str, line: int, row: str) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        lines[line - 1] = row
        (folder / name).write_text("\n".join(lines))

    return change


def test_every_tenth_detection_can_be_left_out(folder: Path) -> None:
    whole = read(folder, Options()).log
    gone = list[tuple[float, ...]]()
    every = [(k, *z) for k, z in zip(whole.sighting_step.tolist(), whole.z.tolist(), strict=True)]
    for first in range(1, 11):
        log = read(folder, Options(left_out=first)).log
        assert np.array_equal(log.t, whole.t)
        assert np.array_equal(log.delta, whole.delta, equal_nan=True)
        left = [(k, *z) for k, z in zip(log.sighting_step.tolist(), log.z.tolist(), strict=True)]
        assert left == [one for k, one in enumerate(every) if k % 10 != first - 1]
        gone += [one for k, one in enumerate(every) if k % 10 == first - 1]
    assert sorted(gone) == sorted(every)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (replaced("inputs.dat", 7, "0.35 2.0 1.5"), r"inputs\.dat, line 7: steering is 1\.5"),
        (replaced("inputs.dat", 800, "25.35 2.0 0.2"), r"inputs\.dat, line 800: t is 25\.35 after .*, expected no"),
        (replaced("measurements.dat", 3, "0.3 -1 1.5 0.4"), r"measurements\.dat, line 3: range is -1\.0, expected"),
        (replaced("measurements.dat", 3, "0.3 5 91 0.4"), r"measurements\.dat, line 3: bearing is 91"),
        (replaced("measurements.dat", 3, "0.0 5 1 0.4"), r"measurements\.dat, line 3: t is 0\.0, expected no earlier"),
        (replaced("measurements.dat", 200, "95 5 1 0.4"), r"measurements\.dat, line 200: t is 95\.0, and inputs\.dat"),
        (replaced("gps.dat", 4, "0.4 1 1"), r"gps\.dat, line 4: t is 0\.4 twice"),
        (lambda folder: (folder / "gps.dat").unlink(), r"gps\.dat: there is no such file"),
        (lambda folder: (folder / "gps.dat").write_text("# none\n"), r"gps\.dat: found no rows"),
    ],
)
def test_a_damaged_file_is_named_with_its_line(folder: Path, spoil: Callable[[Path], object], said: str):
    spoil(folder)
    refused(said, read, folder, Options())


@pytest.mark.parametrize("name", ["inputs.dat", "measurements.dat", "gps.dat"])
def test_damaged_files_are_read_or_refused_with_one_sentence(folder: Path, name: str):
    def usable(dataset: Dataset) -> None:
        assert dataset.truth is not None
        check_truth(dataset.log, dataset.truth, "log")

    found, sentences = survivors(lambda path: read(path.parent, Options()), folder / name, 90, len(name), usable)
    assert len(found) > 10
    assert len(sentences) > 10


@pytest.fixture(scope="module")
def whole() -> Dataset:
    return read(at_hand("victoria_park_raw"), Options())


def test_nothing_of_the_log_is_lost(whole: Dataset, tmp_path: Path):
    log, truth = whole
    assert (len(log), len(log.ids)) == (7230, 52974)
    assert len(truth.t) == 4109
    assert list(problems(log)) == []
    log_folder.write(tmp_path / "log", log, truth)
    assert log_folder.read(tmp_path / "log").log.digest == log.digest


def test_dead_reckoning_is_far_off_after_half_an_hour_and_near_over_a_minute(whole: Dataset):
    log, truth = whole
    path = log.dead_reckoned()[np.searchsorted(log.t, truth.t)]

    def apart(rows: Ints) -> float:
        moved = aligned(align(path[rows], truth.poses[rows]), path[rows])
        return float(np.median(np.hypot(*(moved - truth.poses[rows])[:, :2].T)))

    assert 50 < apart(np.arange(len(path))) < 90
    minutes = [np.flatnonzero(truth.t // 60 == k) for k in range(26)]
    assert np.median([apart(rows) for rows in minutes if len(rows) > 100]) < 2.5


def test_trees_stay_where_they_are_from_scan_to_scan(whole: Dataset):
    """Most detections have one in the next scan within what 0.2 s of motion and the noise allow: bearings are right."""
    log, _ = whole
    path, step = log.dead_reckoned(), log.sighting_step
    x = path[step, 0] + log.z[:, 0] * np.cos(path[step, 2] + log.z[:, 1])
    y = path[step, 1] + log.z[:, 0] * np.sin(path[step, 2] + log.z[:, 1])
    near = 0
    scans = range(1000, 3000)
    for k in scans:
        now, then = (slice(log.sighting_first[j], log.sighting_first[j + 1]) for j in (k, k - 1))
        apart = np.hypot(x[now, None] - x[None, then], y[now, None] - y[None, then])
        near += int((apart.min(axis=1, initial=np.inf) < 0.5).sum())
    assert near > 0.7 * (log.sighting_first[3000] - log.sighting_first[1000])

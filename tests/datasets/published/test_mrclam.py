from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from batch_fit import aligned, rmse
from fuzzing import survivors
from motions import chain, chained
from recorded import at_hand
from refusals import refused, refused_at
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array
from slamduel.datasets.published import mrclam
from slamduel.datasets.published.catalogue import place
from slamduel.datasets.published.mrclam_log import Options
from small_mrclam import EPOCH, FILES, HEADER, SPEED, TURN, rows
from tiers import first_quick

ODOMETRY, MEASUREMENT, GROUNDTRUTH = (f"Robot1_{name}.dat" for name in ("Odometry", "Measurement", "Groundtruth"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    return tmp_path


def read(folder: Path, **options: float | str) -> Dataset:
    return mrclam.source.make(Options(path=str(folder), **options), np.random.default_rng(0))  # pyright: ignore[reportArgumentType]


def test_keyframes_are_sightings_and_full_seconds_of_the_common_time(folder: Path):
    log = read(folder).log
    np.testing.assert_allclose(log.t, [0, 1, 1.25, 2, 3, 4, 5], atol=1e-6)  # from 1.0 to 6.0 after EPOCH
    assert log.notes["start"] == EPOCH + 1
    assert list(problems(log)) == []


def test_sightings_are_of_landmarks_by_subject_once_a_time(folder: Path):
    log = read(folder, range_sd=0.2, bearing_sd=0.1).log
    np.testing.assert_array_equal(log.sighting_step, [2, 2, 4])
    np.testing.assert_array_equal(log.ids, [6, 7, 7])
    np.testing.assert_array_equal(log.z, [[2.0, 0.1], [3.0, -0.2], [4.0, 0.3]])
    np.testing.assert_array_equal(log.z_cov, np.broadcast_to(np.diag([0.2**2, 0.1**2]), (3, 2, 2)))
    dropped = ("of another robot", "with an unknown barcode", "outside the log's time", "repeated at one time")
    assert log.notes["dropped"] == dict(zip(dropped, (1, 1, 2, 1), strict=True))


def arc(v: float, omega: float, dt: float) -> Array:
    if omega == 0:
        return np.array([v * dt, 0, 0])
    return np.array([v / omega * np.sin(omega * dt), v / omega * (1 - np.cos(omega * dt)), omega * dt])


def test_commands_are_held_and_motions_are_exact_arcs(folder: Path):
    """Each keyframe's pieces, chained with the shared algebra: the last command counts where a time is repeated."""
    options = Options(forward=0.05, lateral=0.01, turn=0.1, rest=0.05)
    full = np.diag([options.forward**2, options.lateral**2, options.turn**2])
    pieces: list[list[tuple[float, float, float]]] = [
        [(SPEED, 0, 0.5), (SPEED, TURN, 0.5)],
        [(SPEED, TURN, 0.25)],
        [(SPEED, TURN, 0.75)],
        [(0, 0, 1.0)],
        [(0, 0, 0.4), (SPEED, -TURN, 0.6)],
        [(SPEED, -TURN, 1.0)],
    ]
    log = read(folder, forward=0.05, lateral=0.01, turn=0.1, rest=0.05).log
    for k, parts in enumerate(pieces, start=1):
        delta, cov = np.zeros(3), np.zeros((3, 3))
        for v, omega, dt in parts:
            noise = full * dt * (options.rest**2 if v == omega == 0 else 1)
            delta, cov = chain(delta, cov, arc(v, omega, dt), noise)
        np.testing.assert_allclose(log.delta[k], delta, atol=1e-6)  # times near 1e9 s resolve a quarter microsecond
        np.testing.assert_allclose(log.delta_cov[k], cov, rtol=1e-5, atol=1e-9)


def test_truth_is_interpolated_on_the_circle_and_left_out_in_gaps(folder: Path):
    dataset = read(folder)
    truth = dataset.truth
    # keyframes 2.0, 3.0 and 5.0 s after EPOCH + 1 are at 3.0, 4.0 and 6.0: the one at 4.0 falls into the gap
    np.testing.assert_allclose(truth.t, [0, 1, 1.25, 2, 4, 5], atol=1e-6)
    assert set(truth.t) <= set(dataset.log.t)
    since = truth.t + 0.2
    heading = np.arctan2(np.sin(3 + since / 10), np.cos(3 + since / 10))
    assert heading.min() < 0 < heading.max()
    np.testing.assert_allclose(truth.poses, np.stack((0.1 * since, -since, heading), axis=-1), atol=1e-6)
    np.testing.assert_array_equal(truth.map.ids, [6, 7])
    np.testing.assert_array_equal(truth.map.xy, [[1.5, -2.5], [3, 4]])
    np.testing.assert_array_equal(dataset.log.prior.pose, truth.poses[0])


@pytest.mark.parametrize("content", [rows((3.5, 99, 1.0, 0.0)), HEADER], ids=["nobody", "nothing"])
def test_a_robot_that_saw_no_landmark_has_a_log(folder: Path, content: str):
    (folder / MEASUREMENT).write_text(content)
    log = read(folder).log
    assert len(log.ids) == 0
    np.testing.assert_allclose(log.t, [0, 1, 2, 3, 4, 5])
    assert list(problems(log)) == []


def replaced(name: str, old: str, new: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(FILES[name].replace(old, new, 1))


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        (lambda f: (f / ODOMETRY).unlink(), ODOMETRY, "there is no such file"),
        (lambda f: (f / ODOMETRY).write_text(HEADER), ODOMETRY, "found no rows, expected"),
        (replaced(ODOMETRY, "9.0", "fast"), ODOMETRY, "line 3: v is 'fast', expected a number"),
        (replaced(ODOMETRY, "190.000", "180.000"), ODOMETRY, "line 7: t is 1248444180.0, expected"),
        (replaced(MEASUREMENT, "1.0", "-1.0"), MEASUREMENT, "line 3: range is -1.0, expected more"),
        (replaced(MEASUREMENT, "-0.2", "-20"), MEASUREMENT, "line 5: bearing is -20.0, expected"),
        (replaced(MEASUREMENT, "63", "6.3"), MEASUREMENT, "line 3: barcode is 6.3, expected a whole"),
        (
            lambda f: (f / GROUNDTRUTH).write_text(rows((100.0, 0.0, 0.0, 0.0), (100.1, 0.0, 0.0, 0.0))),
            ODOMETRY,
            "no command lies within the time of Robot1_Groundtruth.dat",
        ),
    ],
)  # fmt: skip
def test_a_bad_file_is_named(folder: Path, change: Callable[[Path], object], name: str, words: str):
    change(folder)
    refused_at(folder / name, words, read, folder)


def test_without_a_path_it_is_the_copy_that_was_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    refused("bench fetch mrclam-7 .*path=", mrclam.source.make, Options(dataset=7), np.random.default_rng(0))
    for folder in (place("mrclam-7"), place("mrclam-8") / "MRCLAM_Dataset8"):
        folder.mkdir(parents=True)
        for name, content in FILES.items():
            (folder / name).write_text(content)
    by_set = [mrclam.source.make(Options(dataset=k), np.random.default_rng(0)).log for k in (7, 8)]
    assert [log.name for log in by_set] == ["mrclam-7-robot-1", "mrclam-8-robot-1"]
    assert by_set[0].digest == by_set[1].digest


@pytest.mark.parametrize("name", ["MRCLAM_Dataset9", "MRSLAM_Dataset9"])
def test_the_path_may_hold_the_folder_of_the_dataset(folder: Path, name: str):
    alone = read(folder).log.digest
    (inside := folder / name).mkdir()
    for name in FILES:
        (folder / name).rename(inside / name)
    assert read(folder, dataset=9).log.digest == alone
    refused(r"Robot1_Odometry.dat: there is no such file", read, folder, dataset=8)


def test_other_robots_are_kept_as_unknown_and_counted(folder: Path):
    more = rows((3.0, 14, 1.0, 0.0), (3.25, 5, 0.8, 1.0), (3.25, 14, 0.9, -1.0), (3.25, 14, 0.9, -1.1))
    old = FILES[MEASUREMENT]
    head, tail = old.split("190.000", 1)
    lines = head.rpartition("\n")[0], more.removeprefix(HEADER) + tail.partition("\n")[2]
    (folder / MEASUREMENT).write_text("\n".join(lines))
    without, log = read(folder).log, read(folder, robots="unknown").log
    np.testing.assert_allclose(log.t, [0, 1, 1.25, 2, 2.25, 3, 4, 5], atol=1e-6)
    np.testing.assert_array_equal(log.ids, [6, 7, UNKNOWN, UNKNOWN, UNKNOWN, 7])
    np.testing.assert_array_equal(log.z[2:5], [[1.0, 0.0], [0.8, 1.0], [0.9, -1.0]])
    assert list(problems(log)) == []
    assert log.notes["kept as unknown"] == {"of another robot": 3}
    assert log.notes["dropped"] == without.notes["dropped"] | {"of another robot": 0, "repeated at one time": 2}
    assert without.notes["kept as unknown"] == {"of another robot": 0}
    assert without.notes["dropped"]["of another robot"] == 4
    np.testing.assert_array_equal(log.identified().z, without.z)  # what a backend that needs ids is handed


def test_a_first_command_that_is_late_by_itself_is_left_out_with_a_remark(folder: Path):
    before = read(folder).log
    late = rows((0.1, 0.294, 0.0))
    (folder / ODOMETRY).write_text(late + FILES[ODOMETRY].removeprefix(HEADER))
    log = read(folder).log
    assert log.remarks == [
        f"{folder / ODOMETRY}, line 3: t is 1248444187.1, 0.10 s later than in the next row; the row is left out"
    ]
    assert log.digest == before.digest
    assert before.remarks == []


@pytest.mark.parametrize(
    ("times", "line", "found", "expected"),
    [
        ((1.3, 1.0, 1.5), 4, 1.0, 1.3),  # later than a fifth of a second
        ((1.1, 1.0, 0.9), 5, 0.9, 1.0),  # not the first row alone
        ((1.0, 1.2, 1.1), 5, 1.1, 1.2),
    ],
)
def test_any_other_disorder_stays_refused(
    folder: Path, times: tuple[float, ...], line: int, found: float, expected: float
):
    (folder / ODOMETRY).write_text(rows(*((t, SPEED, 0.0) for t in times), (9.0, 0.0, 0.0)))
    words = f"line {line}: t is {EPOCH + found!s}, expected no earlier than {EPOCH + expected!s}"
    refused_at(folder / ODOMETRY, words, read, folder)


def test_a_late_sighting_is_not_left_out(folder: Path):
    (folder / MEASUREMENT).write_text(rows((2.1, 63, 1.0, 0.0), (2.0, 63, 1.0, 0.0)))
    refused_at(folder / MEASUREMENT, "line 4: t is 1248444189.0, expected no earlier", read, folder)


def test_without_a_path_the_landmarks_places_alone_are_the_truth(folder: Path):
    with_path = read(folder).log
    (folder / GROUNDTRUTH).unlink()
    log, truth = read(folder)
    # the odometry's time is from 0.0 to 9.0 after EPOCH, and all sightings of landmarks are inside
    np.testing.assert_allclose(log.t, [0, 0.5, 1, 2, 2.25, 3, 4, 5, 6, 7, 7.5, 8, 9], atol=1e-6)
    assert log.notes["start"] == EPOCH
    assert log.notes["dropped"]["outside the log's time"] == 0
    np.testing.assert_array_equal(log.prior.pose, np.zeros(3))
    np.testing.assert_array_equal(log.prior.cov, with_path.prior.cov)
    assert (truth.kind, len(truth.t), truth.poses.shape) == ("truth", 0, (0, 3))
    np.testing.assert_array_equal(truth.map.xy, [[1.5, -2.5], [3, 4]])
    assert log.notes["truth"] == "the landmarks' places alone: there is no Robot1_Groundtruth.dat"
    assert log.notes["start pose"].startswith("the origin")
    assert "noise by the truth" not in log.notes
    assert {"start pose"} == log.notes.keys() - with_path.notes.keys()
    assert list(problems(log)) == []


def test_a_link_to_no_path_and_a_time_beyond_reason_are_refused(folder: Path):
    (folder / GROUNDTRUTH).unlink()
    (folder / GROUNDTRUTH).symlink_to("gone.dat")
    refused_at(folder / GROUNDTRUTH, "is a link to nothing", read, folder)
    (folder / GROUNDTRUTH).unlink()
    (folder / ODOMETRY).write_text(rows((0.0, 0.1, 0.0), (2e5, 0.1, 0.0)))
    refused_at(folder / ODOMETRY, "lasts 200000 s, expected no more than 100000", read, folder)


def test_landmarks_that_set_1_has_exchanged_are_put_right_with_a_remark(folder: Path):
    places = "  11 \t 3.15071999 \t 2.38294871 \t 0 \t 0 \n  17 \t 0.03596156 \t -2.84396626 \t 0 \t 0 \n"
    (folder / "Landmark_Groundtruth.dat").write_text(HEADER + "  6 \t 5.7 \t 5.0 \t 0 \t 0 \n" + places)
    barcodes = HEADER + "  1 \t 5 \n  11 \t 18 \n  17 \t 61 \n"
    (folder / "Barcodes.dat").write_text(barcodes)
    log, truth = read(folder)
    np.testing.assert_array_equal(truth.map.ids, [6, 11, 17])
    np.testing.assert_array_equal(truth.map.xy[1:], [[0.03596156, -2.84396626], [3.15071999, 2.38294871]])
    (remark,) = log.remarks
    assert "Landmark_Groundtruth.dat, lines 4 and 5: the places of landmarks 11 and 17 are exchanged" in remark
    (folder / "Barcodes.dat").write_text(barcodes.replace("18", "0").replace("61", "18").replace("\t 0 ", "\t 61 "))
    log, truth = read(folder)  # as a copy that was corrected
    np.testing.assert_array_equal(truth.map.xy[1], [3.15071999, 2.38294871])
    assert log.remarks == []


def fit(dataset: Dataset) -> None:
    assert list(problems(dataset.log)) == []
    assert np.isfinite(dataset.truth.poses).all()
    assert (np.abs(dataset.truth.poses[:, 2]) <= np.pi).all()
    assert set(dataset.truth.t.tolist()) <= set(dataset.log.t.tolist())
    assert len(dataset.log) < 1000
    assert dataset.log.notes["kept as unknown"]["of another robot"] == (dataset.log.ids == UNKNOWN).sum()


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_read_or_turned_down_with_a_sentence(folder: Path, name: str):
    def of_the_folder(_: Path) -> Dataset:
        return read(folder, robots="unknown")

    found, sentences = survivors(of_the_folder, folder / name, cases=180, seed=len(name), fit=fit)
    assert len(found) > 30
    assert len(sentences) > 30
    assert sum(name in sentence for sentence in sentences) >= 0.8 * len(sentences)


@pytest.fixture(scope="module")
def set_6() -> Path:
    return at_hand("mrclam/MRCLAM_Dataset6")


# measured once with an independent reader and integrator: keyframes, sightings, dead reckoning's RMSE from the start
# pose and aligned, in m
SET_6 = {
    1: (1771, 1534, 2.742, 2.102),
    2: (2870, 3239, 3.022, 2.024),
    3: (3164, 4348, 4.273, 3.120),
    4: (2100, 2023, 1.981, 1.296),
    5: (3208, 4239, 1.770, 1.200),
}


@pytest.mark.parametrize("robot", first_quick(SET_6))
def test_set_6_is_read_as_an_independent_reader_reads_it(set_6: Path, robot: int):
    keyframes, sightings, from_start, best = SET_6[robot]
    log, truth = read(set_6, robot=robot)
    assert list(problems(log)) == []
    assert (len(log), len(log.ids)) == (keyframes, sightings)
    assert set(log.ids.tolist()) <= set(range(6, 21))
    place = np.searchsorted(log.t, truth.t)
    np.testing.assert_array_equal(log.t[place], truth.t)
    path = chained(log.delta[1:], log.prior.pose)[place, :2]
    assert rmse(path, truth.poses[:, :2]) == pytest.approx(from_start, rel=0.005)
    assert rmse(aligned(path, truth.poses[:, :2]), truth.poses[:, :2]) == pytest.approx(best, rel=0.005)


def test_several_robots_are_no_single_log(folder: Path) -> None:
    for options in (Options(path=str(folder), robot="all"), Options(path=str(folder), dataset="all")):
        refused(r"found \d logs, expected one dataset and", mrclam.source.make, options, np.random.default_rng(0))

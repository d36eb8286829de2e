"""Sets of MRCLAM in one folder: their numbers, those that are not there, and verdicts over them."""

import os
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

import slamduel
from driven import final
from recorded import at_hand
from refusals import refused
from slamduel.bench.cli import main
from slamduel.bench.measure.accuracy import own_map_rmse
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.spec import dataset_variants
from slamduel.bench.run.benchmark import DEFAULTS
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.datasets.noise.noise_file import read_noise
from slamduel.datasets.noise.stated import stated
from slamduel.datasets.published.catalogue import place
from slamduel.datasets.published.mrclam_log import MEASURED
from slamduel.datasets.published.mrclam_sets import LAST_ROBOT, USUAL
from small_mrclam import HEADER, rows
from tiers import first_quick

PLACES = {6: (1.5, -2.5), 7: (3.0, 4.0), 8: (-2.0, 1.0), 9: (5.0, 0.5)}


def write_set(folder: Path, number: int, robots: int = 5) -> None:
    """Writes the files of robots that each drive another way among the same landmarks, and see all of these."""
    folder.mkdir(parents=True)
    barcodes = "".join(f" {one} \t {50 + one} \n" for one in PLACES)
    (folder / "Barcodes.dat").write_text(HEADER + barcodes)
    landmarks = "".join(f" {one} \t {x} \t {y} \t 0 \t 0 \n" for one, (x, y) in PLACES.items())
    (folder / "Landmark_Groundtruth.dat").write_text(HEADER + landmarks)
    for robot in range(1, robots + 1):
        rng = np.random.default_rng([number, robot])
        t = np.arange(0, 8, 0.1)
        path = [(s, 0.5 * s, 0.1 * robot, 0.0) for s in t.tolist()]
        seen: list[tuple[float, ...]] = []
        for s in t[::10].tolist():
            for one, (x, y) in PLACES.items():
                dx, dy = x - 0.5 * s, y - 0.1 * robot
                range_ = float(np.hypot(dx, dy) + rng.normal(0, 0.1))
                seen.append((s, 50 + one, range_, float(np.arctan2(dy, dx) + rng.normal(0, 0.01))))
        commands = [(s, 0.5, 0.01 * rng.normal()) for s in t.tolist()]
        (folder / f"Robot{robot}_Odometry.dat").write_text(rows(*commands))
        (folder / f"Robot{robot}_Groundtruth.dat").write_text(rows(*path))
        (folder / f"Robot{robot}_Measurement.dat").write_text(rows(*seen))


@pytest.fixture
def nine_sets(tmp_path: Path) -> Path:
    """A made-up publisher's: nine sets of five robots."""
    for number in range(1, 10):
        write_set(tmp_path / "sets" / f"{'MRSLAM' if number == 4 else 'MRCLAM'}_Dataset{number}", number)
    return tmp_path / "sets"


def names(text: str) -> list[tuple[str | None, str | None]]:
    (variant,) = dataset_variants(text)
    found = [variant.log(seed) for seed in range(len(variant.members))]
    return [(log.name, log.cluster) for log in found]


@pytest.mark.usefixtures("no_report")
def test_nine_sets_of_five_robots_are_one_verdict_over_nine_clusters(nine_sets: Path, tmp_path: Path) -> None:
    found = slamduel.run(f"mrclam-all[path={nine_sets}]", "dead-reckoning,ekf", out=tmp_path / "out")
    cells = [cell for cell in found.cells if cell["backend"] == "ekf"]
    assert [(cell["seed"], cell["status"]) for cell in cells] == [(seed, "done") for seed in range(45)]
    assert (cells[16]["log_name"], cells[16]["cluster"]) == ("set 4, robot 2", "set 4")
    assert len({cell["digest"] for cell in cells}) == 45
    (ruling,) = found.verdict.values()
    assert ruling.basis == "45 logs in 9 clusters; the true path is known"
    (c,) = ruling.comparisons["ate_m"]
    assert (c.n, c.units) == (45, 9)
    assert "are over the 9 clusters, and hold for clusters like these." in " ".join(ruling.sentences)


@pytest.mark.usefixtures("no_report")
def test_the_robots_of_one_set_speak_for_it_alone(nine_sets: Path, tmp_path: Path) -> None:
    found = slamduel.run(f"mrclam[dataset=4,robot=all,path={nine_sets}]", "ekf", out=tmp_path / "out")
    (ruling,) = found.verdict.values()
    assert ruling.basis == "5 logs of set 4; the true path is known"
    assert "All 5 logs are of one cluster, set 4: what is said holds for logs of set 4" in " ".join(ruling.sentences)


# The number of a set


@pytest.mark.parametrize("option", ["", "dataset=9,"])
def test_a_sets_number_is_that_of_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str) -> None:
    write_set(tmp_path / "sets/MRCLAM_Dataset9", 9, robots=2)
    monkeypatch.chdir(tmp_path / "sets/MRCLAM_Dataset9")
    for path in (".", tmp_path / "sets/MRCLAM_Dataset9", tmp_path / "sets"):
        log = slamduel.load(f"mrclam[{option}path={path}]").log
        assert log.name == "mrclam-9-robot-1"
        assert log.notes["settings"]["dataset"] == 9
        each = names(f"mrclam[{option}robot=all,path={path}]")
        assert each == [(f"set 9, robot {k}", "set 9") for k in (1, 2)]


def test_another_number_than_the_folders_is_refused(tmp_path: Path) -> None:
    write_set(folder := tmp_path / "MRCLAM_Dataset9", 9, robots=1)
    words = f"{folder}: found set 9, expected set 6, as option dataset=6 of dataset mrclam says"
    for robot in ("1", "all"):
        refused(words, slamduel.load, f"mrclam[dataset=6,robot={robot},path={folder}]")


def test_a_folder_of_another_name_is_the_set_that_is_said_or_goes_by_its_name(tmp_path: Path) -> None:
    write_set(folder := tmp_path / "hall", 9, robots=2)
    assert slamduel.load(f"mrclam[path={folder}]").log.name == "mrclam-hall-robot-1"
    assert slamduel.load(f"mrclam[dataset=3,path={folder}]").log.name == "mrclam-3-robot-1"
    each = [("set hall, robot 1", "set hall"), ("set hall, robot 2", "set hall")]
    assert names(f"mrclam[robot=all,path={folder}]") == names(f"mrclam-all[path={folder}]") == each


def test_of_several_sets_the_sixth_is_read_or_one_has_to_be_named(tmp_path: Path) -> None:
    for number in (2, 3):
        write_set(tmp_path / f"MRCLAM_Dataset{number}", number, robots=1)
    refused(r"found sets 2, 3, expected dataset=NUMBER", slamduel.load, f"mrclam[path={tmp_path}]")
    write_set(tmp_path / "MRCLAM_Dataset6", 6, robots=1)
    assert slamduel.load(f"mrclam[path={tmp_path}]").log.name == "mrclam-6-robot-1"
    assert slamduel.load(f"mrclam[dataset=3,path={tmp_path}]").log.name == "mrclam-3-robot-1"


def test_a_fetched_set_needs_no_number_in_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    write_set(place("mrclam-6"), 6, robots=1)
    write_set(place("mrclam-2"), 2, robots=1)
    assert slamduel.load("mrclam").log.digest == slamduel.load("mrclam[dataset=6]").log.digest
    assert slamduel.load("mrclam[dataset=2]").log.name == "mrclam-2-robot-1"
    assert slamduel.load(f"mrclam[path={place('mrclam-2')}]").log.name == "mrclam-2-robot-1"


# What is not there


def remarks(dataset: str) -> str:
    return Plan.from_words(DEFAULTS | {"dataset": dataset, "backend": "ekf"}).remarks()


def test_all_sets_of_a_folder_are_those_that_are_there_and_the_others_are_named(nine_sets: Path) -> None:
    assert remarks(f"mrclam-all[path={nine_sets}]") == ""
    for number in (2, 7):
        shutil.rmtree(nine_sets / f"MRCLAM_Dataset{number}")
    (nine_sets / "MRCLAM_Dataset3/Robot4_Odometry.dat").unlink()
    label = f"mrclam-all[path={nine_sets}]"
    assert remarks(label) == f"{label}: not there, and left out: set 2, set 7 and robot 4 of set 3."
    found = names(label)
    assert len(found) == 7 * 5 - 1
    assert ("set 3, robot 4", "set 3") not in found
    assert {cluster for _, cluster in found} == {f"set {k}" for k in (1, 3, 4, 5, 6, 8, 9)}
    third = f"mrclam[robot=all,path={nine_sets / 'MRCLAM_Dataset3'}]"
    assert remarks(third) == f"{third}: not there, and left out: robot 4 of set 3."
    assert len(names(third)) == 4
    one = f"mrclam-all[path={nine_sets / 'MRCLAM_Dataset1'}]"
    assert names(one) == [(f"set 1, robot {k}", "set 1") for k in range(1, 6)]
    assert "left out: set 2, set 3, set 4" in remarks(one)
    assert remarks("mrclam-all") == ""  # of the sets that bench fetch gets, each says so by itself


def test_a_folder_without_any_is_refused(tmp_path: Path) -> None:
    words = f"{tmp_path}: found no log of MRCLAM, expected a set, such as MRCLAM_Dataset6 with Barcodes.dat"
    refused(words, dataset_variants, f"mrclam-all[path={tmp_path}]")
    refused(words, dataset_variants, f"mrclam[robot=all,path={tmp_path}]")
    (tmp_path / "MRCLAM_Dataset1").mkdir()
    refused(words, dataset_variants, f"mrclam-all[path={tmp_path}]")


# Sets with a path, and without


@pytest.mark.usefixtures("no_report")
def test_sets_with_and_without_a_path_are_one_verdict_on_maps(tmp_path: Path) -> None:
    for number in (1, 6):
        write_set(tmp_path / f"MRCLAM_Dataset{number}", number, robots=2)
    for robot in (1, 2):
        (tmp_path / f"MRCLAM_Dataset1/Robot{robot}_Groundtruth.dat").unlink()
    found = slamduel.run(f"mrclam-all[path={tmp_path}]", "dead-reckoning,ekf", out=tmp_path / "out")
    cells = [cell for cell in found.cells if cell["backend"] == "ekf"]
    assert [(cell["status"], cell["truth_kind"]) for cell in cells] == 2 * [("done", "reference")] + 2 * [
        ("done", "truth")
    ]
    assert all(0 < cell["map_rmse_m"] < 0.2 for cell in cells)
    (ruling,) = found.verdict.values()
    assert ruling.basis == (
        "4 logs in 2 clusters; the landmarks' places are known, and the true path of 2 logs of set 6"
    )
    assert {use.purpose for use in ruling.uses} == {"online", "map"}
    said = " ".join(ruling.sentences)
    assert "2 logs of set 6 are too few to test, 6 at least; measured, median error of the online path: ekf 0." in said
    assert "The true path is known of 2 logs of set 6 alone: errors of paths and NEES are over these." in said


def test_places_that_are_not_known_of_all_are_no_one_verdict(nine_sets: Path, tmp_path: Path) -> None:
    """A log without any truth beside those of a set: nothing is known that all could be judged by."""
    from slamduel.datasets.formats import log_folder

    log, _ = slamduel.load(f"mrclam[path={nine_sets},dataset=5]")
    log_folder.write(tmp_path / "mine", log, None)
    refused(
        "errors are not of one kind, .* or true places of landmarks in each",
        lambda: slamduel.run(
            backend="ekf", logs=[tmp_path / "mine", f"mrclam[path={nine_sets}]"], out=tmp_path / "out"
        ),
    )


# The recorded sets

READ = {
    (1, 1): (5006, 4771), (1, 2): (5530, 5543), (1, 3): (6166, 6771), (1, 4): (4328, 3269), (1, 5): (6467, 7137),
    (2, 1): (6386, 6852), (2, 2): (6047, 6309), (2, 3): (7623, 8695), (2, 4): (5134, 4011), (2, 5): (8762, 11483),
    (3, 1): (6653, 7011), (3, 2): (6475, 6697), (3, 3): (7846, 8856), (3, 5): (8199, 10363),
    (4, 1): (6091, 6728), (4, 2): (5275, 5243), (4, 3): (6123, 6443), (4, 4): (5192, 4779), (4, 5): (6738, 9368),
    (6, 1): (1771, 1534), (6, 2): (2870, 3239), (6, 3): (3164, 4348), (6, 4): (2100, 2023), (6, 5): (3208, 4239),
    (9, 1): (9744, 8697), (9, 2): (8986, 8130), (9, 3): (8843, 7651), (9, 4): (5715, 3753), (9, 5): (9563, 8454),
}  # fmt: skip
"""Steps and sightings by set and robot."""

BOUND = 0.15
"""m. A landmark is seen hundreds of times by ranges of 0.2 m whose errors stay for as long as the robot looks at it
(0.93 to 0.97 from one to the next): some tens of independent ones leave 0.03 to 0.05 m, in a frame that itself drifts
by as much from one end of the hall to the other. Measured: 0.036 to 0.141 m, the largest of set 6, robot 3."""


@pytest.fixture(scope="module")
def six_sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    zips, sixth, folder = at_hand("mrclam_more"), at_hand("mrclam/MRCLAM_Dataset6"), tmp_path_factory.mktemp("mrclam")
    for file in zips.glob("*.zip"):
        with zipfile.ZipFile(file) as archive:
            archive.extractall(folder)
    os.symlink(sixth, folder / "MRCLAM_Dataset6")
    return folder


def map_error(dataset: Dataset) -> float:
    found = final("smoother", dataset.log, loss="cauchy").map
    assert dataset.truth is not None
    assert dataset.truth.map is not None
    error = own_map_rmse(found, dataset.truth.map)
    assert error is not None
    return error


def test_all_robots_of_the_six_sets_are_there(six_sets: Path) -> None:
    label = f"mrclam-all[path={six_sets}]"
    assert names(label) == [(f"set {number}, robot {robot}", f"set {number}") for number, robot in READ]
    assert remarks(label).endswith("not there, and left out: set 5, set 7, set 8 and robot 4 of set 3.")


@pytest.mark.parametrize(("number", "robot"), first_quick([(4, 2), *(case for case in READ if case != (4, 2))]))
def test_a_recorded_set_is_read_and_mapped(six_sets: Path, number: int, robot: int) -> None:
    log, truth = dataset = slamduel.load(f"mrclam[path={six_sets},dataset={number},robot={robot}]")
    assert (len(log), len(log.ids)) == READ[number, robot]
    assert list(problems(log)) == []
    assert (len(truth.t) > 0) == (number == 6)
    odd = {1: "landmarks 11 and 17 are exchanged", 9: "0.10 s later than in the next row"}
    expected = [odd[number]] if number in odd and (number, robot) != (9, 5) else []
    assert len(log.remarks) == len(expected)
    assert all(words in remark for words, remark in zip(expected, log.remarks, strict=True))
    assert map_error(dataset) < BOUND


def shaken(path: Path, to: Path, rng: np.random.Generator) -> None:
    """Moves every time in a file by up to a microsecond, the same where times are the same."""
    moved: dict[str, str] = {}
    lines: list[str] = []
    for line in path.read_text().splitlines():
        t, *rest = line.split()
        if not t.startswith("#"):
            at = moved.setdefault(t, f"{float(t) + rng.uniform(-1e-6, 1e-6):.7f}")
            line = " ".join((at, *rest))  # noqa: PLW2901
        lines.append(line)
    to.write_text("\n".join(lines) + "\n")


@pytest.mark.slow
def test_a_microsecond_in_the_files_times_changes_nothing_of_note(six_sets: Path, tmp_path: Path) -> None:
    (folder := tmp_path / "MRCLAM_Dataset4").mkdir()
    for name in ("Barcodes.dat", "Landmark_Groundtruth.dat"):
        shutil.copy(six_sets / folder.name / name, folder / name)
    for name in ("Robot2_Odometry.dat", "Robot2_Measurement.dat"):
        shaken(six_sets / folder.name / name, folder / name, np.random.default_rng(2))
    before, after = (slamduel.load(f"mrclam[path={path},dataset=4,robot=2]") for path in (six_sets, tmp_path))
    np.testing.assert_array_equal(after.log.ids, before.log.ids)
    assert abs(len(after.log) - len(before.log)) <= 5  # sightings on a full second are on both sides of it
    assert map_error(after) == pytest.approx(map_error(before), abs=1e-4)


# Noise


def test_noise_of_others_is_that_measured_without_the_robot_or_on_all_of_set_six(nine_sets: Path) -> None:
    """Sightings' values stay but for errors that stay; covariances are the files'."""
    for number, robot, file in ((6, 2, "mrclam-6-without-2.toml"), (3, 2, "mrclam-6.toml")):
        text = f"mrclam[dataset={number},robot={robot},path={nine_sets}"
        plain = slamduel.load(f"{text}]").log
        expected = stated(plain, read_noise(MEASURED / file))
        assert slamduel.load(f"{text},noise=others]").log.digest == expected.digest
        assert slamduel.load(f'{text},noise="{MEASURED / file}"]').log.digest == expected.digest
        assert expected.digest != plain.digest
    assert len(names(f"mrclam-all[path={nine_sets},noise=others]")) == 45


def test_the_noise_of_others_knows_nothing_of_the_robot() -> None:
    for robot in range(1, LAST_ROBOT + 1):
        fitted_on = read_noise(MEASURED / f"mrclam-{USUAL}-without-{robot}.toml").fitted_on
        assert len(fitted_on) == LAST_ROBOT - 1
        assert ("mrclam" if robot == 1 else f"mrclam[robot={robot}]") not in fitted_on


def test_a_noise_file_that_is_not_there_is_named(nine_sets: Path, tmp_path: Path) -> None:
    refused("nowhere.toml", slamduel.load, f"mrclam[path={nine_sets},noise={tmp_path / 'nowhere.toml'}]")


@pytest.mark.slow
def test_it_is_what_bench_noise_measures(tmp_path: Path) -> None:
    """On the robots of set 6 without the first, to 1 %: optimisers end where rounding has them."""
    folder = at_hand("mrclam/MRCLAM_Dataset6")
    others = [f"mrclam[robot={k},path={folder}]" for k in range(2, LAST_ROBOT + 1)]
    assert main(["noise", *others, "--quiet", "--save", str(tmp_path / "noise.toml")]) == 0
    found, kept = (read_noise(path) for path in (tmp_path / "noise.toml", MEASURED / "mrclam-6-without-1.toml"))
    assert found.systematic == pytest.approx(kept.systematic, rel=0.01, abs=1e-5)
    for one, other in ((found.range, kept.range), (found.bearing, kept.bearing)):
        assert one == pytest.approx(other, rel=0.01, abs=1e-5)
    assert found.odometry == pytest.approx(kept.odometry, rel=0.01)


def test_all_of_the_fetched_sets_are_those_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    assert len(names("mrclam-all")) == 45
    assert remarks("mrclam-all") == ""  # nothing is there, and the run says what to fetch
    write_set(place("mrclam-6"), 6, robots=2)
    write_set(place("mrclam-9"), 9, robots=5)
    assert len(names("mrclam-all")) == 7
    assert remarks("mrclam-all").startswith("mrclam-all: not there, and left out: set 1, set 2,")

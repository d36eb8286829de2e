import dataclasses
import os
import re
import shutil
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzzing import survivors
from refusals import refusal, refused
from slamduel.core import files, table
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Truth
from slamduel.core.factors.check import problems
from slamduel.core.mounting import Mounting
from slamduel.core.scan import attempted
from slamduel.datasets import truth as truth_files
from slamduel.datasets.formats import log_folder
from small_log import assert_same, small_dataset, small_log

Change = Callable[[str], str]
FILES = ("log.toml", "odometry.csv", "sightings.csv", "loops.csv", "truth.tum", "landmarks.csv")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    log_folder.write(tmp_path / "log", *small_dataset())
    return tmp_path / "log"


def test_a_log_reads_back_bit_for_bit(folder: Path):
    found = log_folder.read(folder)
    assert_same(found, small_dataset())
    known, expected = found.log.prior.map, small_log().prior.map
    np.testing.assert_array_equal(known.cov, expected.cov)
    assert sorted(os.listdir(folder)) == sorted(FILES)


@pytest.mark.parametrize(
    "truth",
    [
        None,
        Truth(np.zeros(0), np.zeros((0, 3)), None, None, "reference"),
        Truth(np.zeros(0), np.zeros((0, 3)), small_dataset().truth.map, None, "truth"),  # pyright: ignore[reportOptionalMemberAccess]
    ],
    ids=["none", "no poses", "landmarks alone"],
)
def test_parts_of_a_truth_read_back(tmp_path: Path, truth: Truth | None):
    dataset = Dataset(small_log().without_loops(), truth)
    log_folder.write(tmp_path / "log", *dataset)
    assert not (tmp_path / "log" / "loops.csv").exists()
    assert_same(log_folder.read(tmp_path / "log"), dataset)


def test_the_source_reads_the_folder_it_is_given(folder: Path):
    rng = np.random.default_rng(0)
    assert_same(log_folder.source.make(log_folder.Options(str(folder)), rng), small_dataset())
    refused(r"option path .* not given", log_folder.source.make, log_folder.Options(), rng)


def test_halves_that_differ_by_rounding_are_one_in_the_log(tmp_path: Path):
    before = small_log()
    log = small_log(change=lambda p: p["delta_cov"].__setitem__((2, 0, 1), p["delta_cov"][2, 0, 1] * (1 + 1e-14)))
    cov = log.delta_cov[2]
    assert cov[0, 1] == cov[1, 0] == (before.delta_cov[2, 0, 1] * (1 + 1e-14) + before.delta_cov[2, 1, 0]) / 2
    log_folder.write(tmp_path / "log", log, None)
    assert log_folder.read(tmp_path / "log").log.digest == log.digest


def test_nothing_is_written_over(folder: Path):
    before = {path: path.read_bytes() for path in folder.iterdir()}
    refused("not an empty folder", log_folder.write, folder, small_log(2), None)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    refused("not an empty folder", log_folder.write, folder / "log.toml", small_log(2), None)


def test_an_empty_folder_and_missing_parents_are_fine(tmp_path: Path):
    (tmp_path / "empty").mkdir()
    for place in (tmp_path / "empty", tmp_path / "a" / "b"):
        log_folder.write(place, *small_dataset())
        assert_same(log_folder.read(place), small_dataset())


def test_a_write_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(truth_files, "write_tum", full)
    refused(r"cannot be written \(No space left on device\)", log_folder.write, tmp_path / "log", *small_dataset())
    assert os.listdir(tmp_path) == []


def test_a_log_that_could_not_be_read_is_not_written(tmp_path: Path):
    log = small_log(change=lambda parts: parts["z"].__setitem__((1, 0), -1.0))
    refused(r"log small: sightings row 1: range is -1\.0", log_folder.write, tmp_path / "log", log, None)
    assert os.listdir(tmp_path) == []


def cell(line: int, column: int, value: str) -> Change:
    """Put `value` in a place, both counted from 1."""

    def change(text: str) -> str:
        lines = text.split("\n")
        cells = lines[line - 1].split(",")
        cells[column - 1] = value
        return "\n".join([*lines[: line - 1], ",".join(cells), *lines[line:]])

    return change


def without_line(line: int) -> Change:
    return lambda text: "".join(text.splitlines(keepends=True)[: line - 1] + text.splitlines(keepends=True)[line:])


def renamed(old: str, new: str) -> Change:
    return lambda text: text.replace(old, new, 1)


def truncated(line: int) -> Change:
    return lambda text: "\n".join(text.split("\n")[:line])[:-30]


PRIOR = 'name = "x"\nprior.pose = '

BAD: list[tuple[str, Change, str]] = [
    ("sightings.csv", renamed("range", "rng"), "line 1: column 'rng' in place of 'range', expected"),
    ("odometry.csv", renamed(",ctt", ""), "line 1: column 'ctt' is missing, expected the columns t,dx"),
    ("odometry.csv", renamed("ctt", "ctt,note"), "line 1: column 'note' is one too many, expected"),
    ("landmarks.csv", renamed("x,y", "y,x"), "line 1: found the columns id,y,x, expected the columns id,x,y"),
    ("loops.csv", without_line(1), "line 1: column "),
    ("sightings.csv", truncated(7), "line 7: found "),
    ("loops.csv", cell(3, 11, "1,2"), "line 3: found 12 columns, expected 11 (step,to,dx"),
    ("odometry.csv", cell(4, 3, "fast"), "line 4: dy is 'fast', expected a number"),
    ("odometry.csv", cell(4, 3, ""), "line 4: dy is blank, expected a number"),
    ("odometry.csv", cell(2, 2, "0.0"), "line 2: dx is '0.0', expected nothing in the first row"),
    ("odometry.csv", renamed(",,", ","), "line 2: found 9 columns"),
    ("odometry.csv", cell(2, 1, "now"), "line 2: t is 'now', expected a number"),
    ("odometry.csv", cell(5, 4, "nan"), "line 5: dtheta is nan, expected a finite number"),
    ("sightings.csv", cell(5, 4, "inf"), "line 5: bearing is inf, expected a finite number"),
    ("odometry.csv", cell(4, 1, "-1.0"), "line 4: t is -1.0, expected later than "),
    ("odometry.csv", cell(3, 5, "-2.0"), "line 3: the covariance is not positive definite: its smallest"),
    ("sightings.csv", cell(3, 7, "0.0"), "line 3: the covariance is not positive definite: its smallest"),
    ("sightings.csv", cell(3, 3, "-0.5"), "line 3: range is -0.5, expected more than 0"),
    ("sightings.csv", cell(6, 2, "3"), "line 6: id 3 occurs twice in step 2, expected once"),
    ("sightings.csv", cell(6, 2, "3.5"), "line 6: id is 3.5, expected a whole number"),
    ("sightings.csv", cell(6, 2, "-7"), "line 6: id is -7, expected 0 to 9007199254740992, or -1"),
    ("sightings.csv", cell(6, 8, "3.5"), "line 6: true_id is 3.5, expected a whole number"),
    ("sightings.csv", cell(7, 1, "6"), "line 7: step is 6, expected 0 to 5"),
    ("sightings.csv", cell(5, 1, "3"), "line 6: step is 2 after 3, expected rows sorted by step"),
    ("loops.csv", cell(2, 2, "4"), "line 2: to is 4, expected a step from 0 to before its own, 3"),
    ("odometry.csv", lambda text: text.split("\n")[0] + "\n", "found no steps, expected at least one row"),
    ("truth.tum", lambda text: text + "99 0 0 0 0 0 0 1\n", "t is 99.0, expected a time in"),
    ("truth.tum", renamed(" 0 0 0 ", " 0 0 zero "), "line 2: qy is 'zero', expected a number"),
    ("landmarks.csv", cell(3, 1, "3"), "line 3: id 3 occurs twice, expected once"),
    ("landmarks.csv", cell(3, 2, "nan"), "line 3: x is nan, expected a finite number"),
    ("sightings.csv", lambda _: "", "the file is empty"),
    ("log.toml", without_line(1), ": the file has no 'name', expected a text in quotes"),
    ("log.toml", renamed('"small"', "3"), "line 1: name: found 3, expected a text in quotes"),
    ("log.toml", renamed("[notes]", "[remarks]"), "line 83: remarks: there is no such key; expected one of contents, "),
    ("log.toml", renamed("pose", "pos"), "line 15: prior.pos: there is no such key; did you mean 'pose'?"),
    ("log.toml", lambda _: 'name = "x"', ": prior has no 'pose', expected 3 numbers"),
    ("log.toml", lambda _: PRIOR + '["a", 0, 0]', "line 2: prior.pose: found ['a', 0, 0], expected 3 numbers"),
    ("log.toml", lambda _: PRIOR + "[0, 0, 0]", "line 2: prior has no 'cov', expected 3 x 3 numbers"),
    ("log.toml", lambda _: PRIOR + "[0, 0, 0]\nprior.cov = [[1, 0, 0], [0, 1, 0], [0, 0, 0]]",
     "line 2: prior: the covariance is not positive definite: its smallest eigenvalue is 0"),
    ("log.toml", renamed("    3,\n", "    3.5,\n"), "prior.map.ids: found [3.5, 8], expected a list of whole numbers"),
    ("log.toml", renamed("    3,\n", "    3,\n    4,\n"), "prior.map.cov: found [["),
    ("log.toml", renamed('"truth"', '"true"'), "truth.kind: found 'true', expected one of 'truth', 'reference'"),
    ("log.toml", lambda _: 'name = "x"\nnotes = "y"', "line 2: notes: found 'y', expected a table, [notes] or notes ="),
]  # fmt: skip


@pytest.mark.parametrize(("name", "change", "words"), BAD)
def test_a_bad_file_is_named_with_its_line(folder: Path, name: str, change: Change, words: str):
    path = folder / name
    before = path.read_text(encoding="utf-8")
    path.write_text(change(before), encoding="utf-8", newline="\n")
    assert path.read_text(encoding="utf-8") != before
    sentence = refusal(log_folder.read, folder)
    assert re.match(re.escape(str(path)) + r"(, line \d+)?: ", sentence)
    assert words in sentence
    assert sentence[-1] in ".?"


def test_a_missing_folder_is_named(tmp_path: Path):
    refused("there is no such folder", log_folder.read, tmp_path / "nowhere")


@pytest.mark.parametrize("name", FILES)
def test_bytes_that_are_no_text_are_named(folder: Path, name: str):
    lines = (folder / name).read_bytes().split(b"\n")
    lines[1] += b"\xff"
    (folder / name).write_bytes(b"\n".join(lines))
    assert f"{folder / name}, line 2: byte 0xff is not UTF-8 text" in refusal(log_folder.read, folder)


def same(found: Dataset) -> None:
    """What is read from a damaged folder is what was written, or it is not read."""
    assert not list(problems(found.log))
    log, truth = small_dataset()
    assert found.log.digest == log.digest
    assert truth is not None
    assert found.truth is not None
    assert truth_files.digest(found.truth) == truth_files.digest(truth)


def of_its_folder(path: Path) -> Dataset:
    return log_folder.read(path.parent)


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_turned_down_or_has_changed_nothing(folder: Path, name: str):
    found, sentences = survivors(of_its_folder, folder / name, 180, 5, same)
    assert len(sentences) > 50
    assert len(found) + len(sentences) == 180


@pytest.mark.parametrize("name", FILES)
def test_without_its_digest_a_damaged_folder_is_a_good_log_or_an_input_error(folder: Path, name: str):
    forget_contents(folder)
    found, sentences = survivors(of_its_folder, folder / name, 60, 6, lambda one: list(problems(one.log)))
    assert found
    assert sentences


def forget_contents(folder: Path) -> None:
    """Make it a folder as somebody else would write it."""
    path = folder / "log.toml"
    before, _, rest = path.read_text(encoding="utf-8").partition("[contents]")
    path.write_text(before + rest[rest.index("[prior]") :], encoding="utf-8")


LAST = Callable[[Path], None]


def shorter(name: str) -> LAST:
    def lose(folder: Path) -> None:
        lines = (folder / name).read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / name).write_text("".join(lines[:-1]), encoding="utf-8")

    return lose


def turned(name: str, line: int, column: int, value: str) -> LAST:
    def turn(folder: Path) -> None:
        (folder / name).write_text(cell(line, column, value)((folder / name).read_text(encoding="utf-8")))

    return turn


CHANGES: dict[str, tuple[LAST, str]] = {
    "sightings lost": (shorter("sightings.csv"), "contents.rows has 6 for sightings.csv, which has 5 rows"),
    "a loop lost": (shorter("loops.csv"), "contents.rows has 2 for loops.csv, which has 1 rows"),
    "all loops lost": (lambda folder: (folder / "loops.csv").unlink(), "has 2 for loops.csv, which has 0 rows"),
    "poses lost": (shorter("truth.tum"), "contents.rows has 5 for truth.tum, which has 4 rows"),
    "a landmark lost": (shorter("landmarks.csv"), "contents.rows has 3 for landmarks.csv, which has 2 rows"),
    "a motion": (turned("odometry.csv", 3, 2, "0.125"), "prior, odometry.csv, sightings.csv or loops.csv has changed"),
    "a range": (turned("sightings.csv", 3, 3, "0.125"), "contents.factors is '"),
    "a place": (turned("landmarks.csv", 3, 2, "0.125"), "truth.tum, landmarks.csv, relations.csv, true_id or"),
    "a true id": (turned("sightings.csv", 3, 8, "12"), "contents.truth is '"),
}


@pytest.mark.parametrize(("change", "words"), CHANGES.values(), ids=CHANGES.keys())
def test_a_changed_folder_is_not_read_until_the_change_is_accepted(folder: Path, change: LAST, words: str):
    change(folder)
    said = refusal(log_folder.read, folder)
    assert re.search(re.escape(str(folder / "log.toml")) + r", line \d+: ", said)
    assert words in said
    assert said.endswith("or delete [contents] from log.toml to accept the change.")
    forget_contents(folder)
    log, truth = log_folder.read(folder)
    expected = small_dataset()
    assert truth is not None
    assert expected.truth is not None
    assert (log.digest, truth_files.digest(truth)) != (expected.log.digest, truth_files.digest(expected.truth))


def test_lost_steps_are_told_as_such(folder: Path):
    shorter("odometry.csv")(folder)
    refused(r"contents\.rows has 6 for odometry\.csv, which has 5 rows", log_folder.read, folder)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("rows = 3", "contents.rows: found 3, expected a table"),
        ('rows = {"loops.csv" = 1.5}', "contents.rows.loops.csv: found 1.5, expected a whole number, at least 0."),
        ("rows = {steps = 1}", "contents.rows.steps: there is no such key; expected one of bearings.csv, "),
        ("factors = 3", "contents.factors: found 3, expected a text in quotes."),
        ("digest = 3", "contents.digest: there is no such key; expected one of factors, rows, truth."),
    ],
)
def test_contents_that_are_none_are_named(folder: Path, value: str, words: str):
    forget_contents(folder)
    with (folder / "log.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n[contents]\n{value}\n")
    assert words in refusal(log_folder.read, folder)


def test_a_folder_without_contents_is_read(folder: Path):
    forget_contents(folder)
    assert "contents" not in (folder / "log.toml").read_text(encoding="utf-8")
    assert_same(log_folder.read(folder), small_dataset())


def test_the_digest_written_is_of_what_reads_back(tmp_path: Path):
    """Uneven covariances, numbers in the row of step 0, small integers, a heading of -pi: none of it reads back so."""
    log, truth = small_dataset()
    cov = log.delta_cov.copy()
    cov[2, 0, 1] *= 1 + 1e-14
    cov[0] = np.eye(3)
    poses = truth.poses.copy()
    poses[1, 2] = -np.pi
    log = dataclasses.replace(log, delta_cov=cov, delta=np.where(np.isnan(log.delta), 0.0, log.delta))
    truth = truth._replace(poses=poses, assigned=truth.assigned.astype(np.int32))
    log_folder.write(tmp_path / "log", log, truth)
    found = log_folder.read(tmp_path / "log")
    assert found.log.digest != log.digest
    log_folder.write(tmp_path / "again", *found)
    assert_same(log_folder.read(tmp_path / "again"), found)


def test_a_scan_names_every_fault_of_every_file(folder: Path):
    for change in (
        turned("odometry.csv", 3, 2, "fast"),
        turned("odometry.csv", 3, 5, ""),
        turned("odometry.csv", 5, 4, "nan"),
        turned("odometry.csv", 6, 5, "-1.0"),
        turned("sightings.csv", 2, 2, "0.5"),
        turned("sightings.csv", 3, 3, "-2.0"),
        turned("sightings.csv", 5, 1, "3"),
        turned("sightings.csv", 7, 1, "8"),
        turned("loops.csv", 2, 2, "4"),
        turned("landmarks.csv", 2, 1, "1.5"),
        turned("landmarks.csv", 4, 2, "x"),
    ):
        change(folder)
    words = (folder / "log.toml").read_text(encoding="utf-8")
    words = words.replace('"small"', "3").replace('kind = "truth"', 'kind = "true"')
    (folder / "log.toml").write_text(words, encoding="utf-8")
    with (folder / "truth.tum").open("a", encoding="utf-8") as file:
        file.write("0 0 0 0 0 0 0 0\n1 2 3\n")
    faults = [str(fault).removeprefix(f"{folder}{os.sep}") for fault in attempted(log_folder.scan(folder))]
    starts = [
        "log.toml, line 1: name: found 3",
        "log.toml, line 81: truth.kind: found 'true'",
        "odometry.csv, line 3: dx is 'fast', expected a number.",
        "odometry.csv, line 3: cxx is blank, expected a number.",
        "sightings.csv, line 2: id is 0.5, expected a whole number",
        "sightings.csv, line 7: step is 8, expected 0 to 5",
        "sightings.csv, line 6: step is 2 after 3, expected rows sorted by step.",
        "odometry.csv, line 5: dtheta is nan",
        "odometry.csv, line 6: the covariance is not positive definite",
        "sightings.csv, line 3: range is -2.0, expected more than 0.",
        "loops.csv, line 2: to is 4, expected a step from 0 to before its own, 3.",
        "truth.tum, line 8: found 3 columns",
        "truth.tum, line 7: t is 0.0, expected later than",
        "landmarks.csv, line 4: x is 'x', expected a number.",
        "landmarks.csv, line 2: id is 1.5, expected a whole number",
    ]
    assert len(faults) == len(starts), faults
    for start in starts:
        assert any(fault.startswith(start) for fault in faults), (start, faults)


def test_the_first_fault_of_a_scan_is_what_reading_raises(folder: Path):
    turned("sightings.csv", 3, 3, "-2.0")(folder)
    turned("odometry.csv", 4, 4, "9.0")(folder)
    first, second = log_folder.scan(folder)
    assert refusal(log_folder.read, folder) == str(first) != str(second)


@pytest.mark.parametrize("missing", ["log.toml", "odometry.csv", "sightings.csv"])
def test_a_scan_goes_on_where_a_file_is_missing(folder: Path, missing: str):
    (folder / missing).unlink()
    turned("landmarks.csv", 3, 2, "x")(folder)
    first, second = (str(fault) for fault in log_folder.scan(folder))
    assert refusal(log_folder.read, folder) == first
    assert first.startswith(f"{folder / missing}: there is no such file")
    assert "landmarks.csv, line 3: x is 'x'" in second


def test_a_log_of_more_rows_than_are_written_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(files, "BLOCK", 4)
    monkeypatch.setattr(table, "CHUNK", 4)
    log_folder.write(tmp_path / "log", *small_dataset())
    assert_same(log_folder.read(tmp_path / "log"), small_dataset())
    turned("sightings.csv", 7, 3, "far")(tmp_path / "log")
    refused(r"line 7: range is 'far'", log_folder.read, tmp_path / "log")


@pytest.mark.parametrize(
    "change", [{"name": "\ud800"}, {"name": 5}, {"notes": {"a": "\ud800"}}, {"notes": {"a": object()}}]
)
def test_words_that_no_file_holds_are_refused(change: dict[str, Any], tmp_path: Path):
    log = dataclasses.replace(small_log(), **change)
    refused("^log .*(found this name|its notes cannot be written)", log_folder.write, tmp_path / "log", log, None)
    assert not list(tmp_path.iterdir())


def test_threads_that_write_one_place_do_not_meet(tmp_path: Path):
    """One of them is first, and its log is whole; the others are told."""
    together = threading.Barrier(8)

    def write(_: int) -> str:
        together.wait()
        try:
            log_folder.write(tmp_path / "log", small_log(), None)
        except InputError as error:
            return str(error)
        return ""

    for _ in range(5):
        with ThreadPoolExecutor(8) as threads:
            said = list(threads.map(write, range(8)))
        assert said.count("") == 1
        assert all("exists and is not" in words or "not empty" in words for words in said if words), said
        assert log_folder.read(tmp_path / "log").log.digest == small_log().digest
        assert [place.name for place in tmp_path.iterdir()] == ["log"]
        shutil.rmtree(tmp_path / "log")


# --- a sensor that is not the body


def test_sightings_of_a_sensor_are_converted_and_the_files_stay_as_they_were(folder: Path) -> None:
    sensor = Mounting(0.2, 0.0, -0.1, 0.05)
    raw = log_folder.read(folder).log
    with (folder / "log.toml").open("a", encoding="utf-8") as file:
        file.write("\n[sensor]\nx = 0.2\nyaw = -0.1\ndelay = 0.05\n")
    log = log_folder.read(folder).log
    np.testing.assert_array_equal(log.z, raw.of_sensor(sensor).z)
    assert not np.array_equal(log.z, raw.z)
    assert log.digest == raw.of_sensor(sensor).digest


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("ahead = 0.2", "sensor.ahead: there is no such key; expected one of delay, x, y, yaw."),
        ("yaw = 90", "sensor.yaw: found 90, expected radians from -pi to pi."),
        ('x = "20 cm"', "sensor.x: found '20 cm', expected a number."),
    ],
)
def test_a_sensor_that_cannot_be_is_named(folder: Path, value: str, words: str) -> None:
    with (folder / "log.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n[sensor]\n{value}\n")
    assert words in refusal(log_folder.read, folder)

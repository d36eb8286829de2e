"""Ranges, bearings and fixes in the folder of a log."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gyro_logs import small_gyro_log
from partial_logs import partial_log
from refusals import refused_at
from slamduel.core.factors import Dataset, Log, Systematic, Truth
from slamduel.core.fixes import FixTable
from slamduel.datasets.formats import log_folder
from small_log import assert_same, small_dataset


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    log_folder.write(tmp_path / "log", partial_log(), None)
    return tmp_path / "log"


def test_a_log_of_parts_reads_back_bit_for_bit(folder: Path) -> None:
    found = log_folder.read(folder)
    assert_same(found, Dataset(partial_log(), None))
    assert found.log.prior.systematic == Systematic(range_scale=0.1, heading_offset=0.2)
    assert found.log.partial is not None
    assert found.log.partial.columns["partial.z"].tobytes() == partial_log().partial.z.tobytes()  # pyright: ignore
    rows = (folder / "log.toml").read_text()
    assert '"ranges.csv" = 3' in rows
    assert '"bearings.csv" = 2' in rows
    assert '"fixes.csv" = 4' in rows


def test_true_ids_of_parts_read_back(tmp_path: Path) -> None:
    true = np.array([3, 12, 12, 8, 7])
    truth = small_dataset().truth
    assert truth is not None
    truth = truth._replace(assigned_partial=true)
    log_folder.write(tmp_path / "log", partial_log(), truth)
    found = log_folder.read(tmp_path / "log").truth
    assert found is not None
    assert found.assigned_partial is not None
    assert found.assigned_partial.tolist() == true.tolist()
    assert (tmp_path / "log" / "bearings.csv").read_text().splitlines()[2].endswith(",8")


def test_the_ranges_of_a_step_come_first(tmp_path: Path) -> None:
    """Their order in a step has no meaning; files cannot keep it."""
    log = partial_log()
    partial = log.partial
    assert partial is not None
    other = replace(log, partial=partial.rows(np.array([0, 2, 1, 3, 4])))
    assert other.digest != log.digest
    log_folder.write(tmp_path / "log", other, None)
    assert log_folder.read(tmp_path / "log").log.digest == log.digest


def test_sightings_and_the_arm_may_be_missing(folder: Path) -> None:
    log = partial_log()
    assert log.fixes is not None
    (folder / "sightings.csv").unlink()
    rows = [line.split(",")[:-2] for line in (folder / "fixes.csv").read_text().splitlines()]
    (folder / "fixes.csv").write_text("\n".join(map(",".join, rows)))
    words = (folder / "log.toml").read_text()
    start = words.index("[contents]")
    (folder / "log.toml").write_text(words[:start] + words[words.index("[prior]") :])
    found = log_folder.read(folder).log
    assert len(found.ids) == 0
    assert found.fixes is not None
    assert not found.fixes.arm.any()
    np.testing.assert_array_equal(found.fixes.z, log.fixes.z)


def test_turns_read_back_bit_for_bit(tmp_path: Path) -> None:
    log_folder.write(tmp_path / "log", small_gyro_log(), None)
    found = log_folder.read(tmp_path / "log")
    assert_same(found, Dataset(small_gyro_log(), None))
    assert '"gyro.csv" = 4' in (tmp_path / "log" / "log.toml").read_text()


TURN_FAULTS: dict[str, tuple[str, str, str, str]] = {
    "a turn in degrees": ("gyro.csv", "4,", "4,90", "gyro.csv, line 4: turn is 90"),
    "a step before the first": ("gyro.csv", "1,", "0,", "gyro.csv, line 2: step is 0, expected 1 to 5"),
    "a step twice": ("gyro.csv", "2,", "1,", "gyro.csv, line 3: step is 1 after 1, expected one row a step"),
    "another column": ("gyro.csv", "step,turn", "step,rate", "gyro.csv, line 1: column 'rate' in place of 'turn'"),
    "a negative deviation": (
        "log.toml",
        "bias_sd = 0.1",
        "bias_sd = -1",
        "bias_sd: found -1, expected a number at lea",
    ),
    "another key": ("log.toml", "bias_sd = 0.1", "drift = 0.1", "drift: there is no such key"),
}


@pytest.mark.parametrize("case", TURN_FAULTS)
def test_a_bad_turn_is_named(tmp_path: Path, case: str) -> None:
    file, old, new, said = TURN_FAULTS[case]
    log_folder.write(tmp_path / "log", small_gyro_log(), None)
    path = tmp_path / "log" / file
    lines = path.read_text().splitlines(keepends=True)
    row = next(i for i, line in enumerate(lines) if line.startswith(old))
    path.write_text("".join([*lines[:row], new + lines[row][len(old) :], *lines[row + 1 :]]))
    refused_at(tmp_path / "log", said, log_folder.read, tmp_path / "log")


def put(line: int, column: int, value: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        lines = [row.split(",") for row in text.split("\n")]
        lines[line - 1][column - 1] = value
        return "\n".join(map(",".join, lines))

    return change


FAULTS: dict[str, tuple[str, Callable[[str], str], str]] = {
    "a range below zero": ("ranges.csv", put(4, 3, "-0.5"), "ranges.csv, line 4: range is -0.5, expected more than 0."),
    "no landmark": (
        "bearings.csv",
        put(3, 2, ""),
        "bearings.csv, line 3: id is blank, expected that of a landmark, or -1",
    ),
    "no bearing": ("bearings.csv", put(2, 3, ""), "bearings.csv, line 2: bearing is blank, expected a number."),
    "NaN": ("ranges.csv", put(2, 3, "nan"), "ranges.csv, line 2: range is nan, expected a finite number."),
    "a bearing in degrees": (
        "bearings.csv",
        put(3, 3, "171"),
        "bearings.csv, line 3: bearing is 171.0, expected radians",
    ),
    "a heading in degrees": ("fixes.csv", put(3, 4, "90"), "fixes.csv, line 3: heading is 90.0, expected radians"),
    "no variance": ("ranges.csv", put(3, 4, "0"), "ranges.csv, line 3: crr is 0.0, expected a variance"),
    "a covariance of zero": (
        "fixes.csv",
        put(5, 8, "0"),
        "fixes.csv, line 5: the covariance is not",
    ),
    "half a covariance": (
        "fixes.csv",
        put(2, 8, ""),
        "fixes.csv, line 2: the covariance does not fit, expected that of x, y",
    ),
    "nothing measured": ("fixes.csv", put(5, 3, ""), "line 5: x, y and heading are all missing"),
    "an arm of one number": ("fixes.csv", put(2, 11, ""), "fixes.csv, line 2: arm_x is blank, expected a number."),
    "a step too late": ("ranges.csv", put(4, 1, "6"), "ranges.csv, line 4: step is 6, expected 0 to 5, the steps"),
    "steps out of order": ("bearings.csv", put(2, 1, "5"), "bearings.csv, line 3: step is 4 after 5, expected rows"),
    "another column": ("ranges.csv", put(1, 4, "variance"), "ranges.csv, line 1: column 'variance' in place of 'crr'"),
    "a row more": (
        "ranges.csv",
        lambda text: text + "5,8,1.0,0.1\n",
        "contents.rows has 3 for ranges.csv, which has 4 rows",
    ),
    "a changed number": (
        "ranges.csv",
        put(4, 3, "0.71"),
        "prior, odometry.csv, sightings.csv or loops.csv, or ranges.csv",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_named(folder: Path, case: str) -> None:
    file, change, said = FAULTS[case]
    text = (folder / file).read_text()
    (folder / file).write_text(change(text))
    refused_at(folder, said, log_folder.read, folder)


@pytest.mark.parametrize(("file", "columns"), [("ranges.csv", 4), ("bearings.csv", 4), ("fixes.csv", 12)])
@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "x"])
def test_a_bad_cell_is_told_once(folder: Path, file: str, columns: int, value: str) -> None:
    good = (folder / file).read_text()
    filled = [cell != "" for cell in good.split("\n")[1].split(",")]
    for column in (1 + k for k in range(columns) if filled[k]):
        (folder / file).write_text(put(2, column, value)(good))
        told = [str(fault) for fault in log_folder.scan(folder)]
        assert sum(f"{file}, line 2: " in fault for fault in told) == 1, told


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("range_scale = 0.1", "range_scale = -0.1", "range_scale: found -0.1, expected a number at least 0"),
        ("range_scale = 0.1", "scale = 0.1", "scale: there is no such key; did you mean"),
        ("each = false", "each = 1", "each: found 1, expected true or false"),
    ],
)
def test_a_bad_constant_error_is_named(folder: Path, old: str, new: str, said: str) -> None:
    words = (folder / "log.toml").read_text()
    assert old in words
    (folder / "log.toml").write_text(words.replace(old, new))
    refused_at(folder / "log.toml", said, log_folder.read, folder)


def test_each_is_kept(tmp_path: Path) -> None:
    log = partial_log()
    log = replace(log, prior=log.prior._replace(systematic=Systematic(0.1, 0.2, 0.3, each=True)))
    log_folder.write(tmp_path / "log", log, Truth(np.zeros(0), np.zeros((0, 3))))
    assert log_folder.read(tmp_path / "log").log.prior.systematic == Systematic(0.1, 0.2, 0.3, each=True)


def test_halves_that_differ_by_rounding_are_one_in_the_log(tmp_path: Path) -> None:
    log = partial_log()
    assert log.fixes is not None
    cov = log.fixes.cov.copy()
    cov[2, 0, 1] *= 1 + 1e-14
    log = replace(log, fixes=FixTable.from_arrays(len(log), log.fixes.step, log.fixes.z, cov, log.fixes.arm))
    log_folder.write(tmp_path / "log", log, None)
    found: Log = log_folder.read(tmp_path / "log").log
    assert found.digest == log.digest

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refusals import refused
from slamduel.core import scan as scans
from slamduel.core import table
from slamduel.core.errors import InputError
from slamduel.core.scan import Scan, attempted, counted, strict
from slamduel.core.se2 import Array
from slamduel.core.small_matrices import symmetric, upper
from slamduel.core.table import Table, read_csv, read_spaced, scan_csv, scan_spaced


@given(arrays(float, st.tuples(st.integers(1, 8), st.just(3)), elements=st.floats(allow_nan=False)))
def test_numbers_read_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, rows: Array):
    path = tmp_path_factory.mktemp("table") / "a.csv"
    path.write_text("a,b,c\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()))
    found = read_csv(path, ("a", "b", "c"))
    np.testing.assert_array_equal(found.rows, rows)
    np.testing.assert_array_equal(np.signbit(found.rows), np.signbit(rows))
    np.testing.assert_array_equal(found.lines, np.arange(len(rows)) + 2)


def test_a_spreadsheet_s_dialect_is_read(tmp_path: Path):
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbfa, b\r\n1, 2\r\n\r\n3,4\r\n\r\n\r\n")
    table = read_csv(tmp_path / "a.csv", ("a", "b"))
    np.testing.assert_array_equal(table.rows, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(table.lines, [2, 4])


def test_comments_between_rows_are_skipped_and_counted(tmp_path: Path):
    (tmp_path / "a.dat").write_text("# one\n# two\n 1 \t 2 \n# three\n3 4\n")
    table = read_spaced(tmp_path / "a.dat", ("a", "b"))
    np.testing.assert_array_equal(table.rows, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(table.lines, [3, 5])


@pytest.mark.parametrize("content", ["a,b\n", "a,b"])
def test_a_table_may_have_no_row(tmp_path: Path, content: str):
    (tmp_path / "a.csv").write_text(content)
    assert read_csv(tmp_path / "a.csv", ("a", "b")).rows.shape == (0, 2)


@pytest.mark.parametrize("cell", ["1_000", "٣", "0x10", "1,5", "", "--1", "1e", '"1"'])
def test_what_is_no_plain_number_is_refused(tmp_path: Path, cell: str):
    (tmp_path / "a.csv").write_text(f"a,b\n1,2\n3,{cell}\n", encoding="utf-8")
    refused(r"a\.csv, line 3: ", read_csv, tmp_path / "a.csv", ("a", "b"))


@pytest.mark.parametrize("value", ["0.5", "9007199254740994", "nan", "-inf"])
def test_a_whole_number_is_one(tmp_path: Path, value: str):
    (tmp_path / "a.csv").write_text(f"a,b\n1,2\n3,{value}\n")
    refused(r"a\.csv, line 3: b is .*, expected a whole number", read_csv(tmp_path / "a.csv", ("a", "b")).whole, "b")


@pytest.mark.parametrize("k", [2, 3])
def test_triangles_and_matrices_are_inverse(k: int):
    triangles = np.random.default_rng(1).normal(size=(5, k * (k + 1) // 2))
    full = symmetric(triangles)
    np.testing.assert_array_equal(full, full.swapaxes(1, 2))
    np.testing.assert_array_equal(full[:, 0, 1], triangles[:, 1])
    np.testing.assert_array_equal(upper(full).T, triangles)


def told(scan: Scan[Table]) -> tuple[list[str], Table]:
    """The faults, from the number of the line on, and what was read all the same."""
    faults = list[str]()
    while True:
        try:
            faults.append(str(next(scan)).partition(", line ")[2])
        except StopIteration as end:
            return faults, end.value


@pytest.mark.parametrize("chunk", [1, 2, 3, 100])
def test_a_scan_names_every_cell_and_keeps_the_good_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int):
    monkeypatch.setattr(table, "CHUNK", chunk)
    (tmp_path / "a.csv").write_text("a,b\n1,2\nx,y\n\n3\n\n\n5,nan\n7,8\n\n")
    faults, found = told(scan_csv(tmp_path / "a.csv", ("a", "b")))
    cells = ["3: a is 'x', expected a number.", "3: b is 'y', expected a number."]
    assert faults == [*cells, "5: found 1 columns, expected 2 (a,b)."]
    np.testing.assert_array_equal(found.broken, [1, 2])
    np.testing.assert_array_equal(found.rows, [[1, 2], [np.nan] * 2, [np.nan] * 2, [5, np.nan], [7, 8]])
    np.testing.assert_array_equal(found.lines, [2, 3, 5, 8, 9])
    sound = found.sound()
    np.testing.assert_array_equal(sound.lines, [2, 8, 9])
    faults, found = told(found.scan_finite())
    assert faults == ["8: b is nan, expected a finite number."]
    np.testing.assert_array_equal(found.sound().rows, [[1, 2], [7, 8]])


def test_every_odd_number_is_named(tmp_path: Path):
    (tmp_path / "a.dat").write_text("1 0.5\n0.5 nan\n3 4\n")
    faults, found = told(scan_spaced(tmp_path / "a.dat", ("a", "b")))
    assert not faults
    faults, found = told(found.scan_whole("a", "b"))
    assert [fault.partition(", ")[0] for fault in faults] == ["2: a is 0.5", "1: b is 0.5", "2: b is nan"]
    np.testing.assert_array_equal(found.sound().whole("b"), [4])


def test_a_row_is_refused_once(tmp_path: Path):
    (tmp_path / "a.dat").write_text("1\n2\n3\n")
    found = read_spaced(tmp_path / "a.dat", ("a",))
    bad = np.array([True, False, True])
    faults, found = told(found.refuse(bad, lambda row: f"row {row} is odd"))
    assert faults == ["1: row 0 is odd.", "3: row 2 is odd."]
    assert told(found.refuse(bad, lambda row: f"row {row} is odd"))[0] == []


def faulty(faults: int, fatal: bool) -> Scan[str]:
    """A scan with so many faults, which gives up at last or does not."""
    for k in range(faults):
        yield InputError(f"fault {k}.")
    if fatal:
        raise InputError("the end.")
    return "read"


def test_a_strict_scan_raises_the_first_fault():
    assert strict(faulty(0, False)) == "read"
    for scan in (faulty(2, False), faulty(2, True)):
        refused(r"fault 0\.", strict, scan)
    refused(r"the end\.", strict, faulty(0, True))


def test_an_attempted_scan_yields_what_it_raises():
    assert [str(fault) for fault in attempted(faulty(2, True))] == ["fault 0.", "fault 1.", "the end."]
    assert strict(attempted(faulty(0, False))) == "read"


def test_faults_are_told_as_they_are_found():
    heard = list[str]()

    def scan() -> Scan[str]:
        yield from faulty(2, False)
        heard.append("between")
        return (yield from faulty(1, False))

    assert scans.told(scan(), lambda fault: heard.append(str(fault))) == "read"
    assert heard == ["fault 0.", "fault 1.", "between", "fault 0."]
    refused(r"the end\.", scans.told, faulty(2, True), heard.append)


@pytest.mark.parametrize("faults", [0, 3])
def test_faults_are_counted_and_passed_on(faults: int):
    scan = counted(faulty(faults, False))
    assert len([next(scan) for _ in range(faults)]) == faults
    with pytest.raises(StopIteration) as end:
        next(scan)
    assert end.value.value == ("read", faults)

"""What is said of a cell or a header that cannot be read: on a line that a person can read, with what may be meant."""

from collections.abc import Callable
from pathlib import Path

import pytest

from refusals import refusal
from slamduel.core.csv_values import SHOWN, finite, number, shortened
from slamduel.core.table import read_csv, read_spaced
from slamduel.datasets.formats import g2o
from slamduel.datasets.formats.columns import read_columns
from slamduel.datasets.published import dlr, freiburg

Read = Callable[[Path], object]


def csv(path: Path) -> object:
    return read_csv(path, ("t", "x"))


def columns(path: Path) -> object:
    return read_columns(path, ("t", "y"), ("t", "x"))


def spaced(path: Path) -> object:
    return read_spaced(path, ("t", "x"))


def stepwise(path: Path) -> object:
    path.rename(path.parent / "sensor_data.dat")
    return freiburg.read(path.parent, freiburg.Options())


def sentence(read: Read, path: Path, content: str | bytes) -> str:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return refusal(read, path).replace(str(path.parent), "")


HUGE: dict[str, tuple[Read, str]] = {
    "csv cell": (csv, "t,x\n1,{}\n"),
    "csv header": (csv, "t,{}\n1,2\n"),
    "csv column too many": (csv, "t,x,{}\n1,2\n"),
    "columns cell": (columns, "t,x\n1,{}\n"),
    "columns header": (columns, "t,{}\n1,2\n"),
    "columns row": (columns, "t,x,{}\n1,2\n"),
    "spaced cell": (spaced, "1 {}\n"),
    "tag": (g2o.read, "{} 1 2\n"),
    "tagged cell": (g2o.read, "FIX {}\n"),
    "word": (stepwise, "{} 1 2 3\n"),
    "step's cell": (stepwise, "ODOMETRY 1 2 {}\n"),
    "id": (stepwise, "ODOMETRY 1 2 3\nSENSOR {} 1 1\n"),
    "huge number": (stepwise, "ODOMETRY 1 2 1{}\n".replace("{}", "0" * 300 + "{}")),
    "image": (dlr.read, "STEP {} 0 0 0 1 0 1 0 0 1\n"),
    "row": (dlr.read, "{} 1\n"),
}


@pytest.mark.parametrize(("read", "content"), HUGE.values(), ids=HUGE.keys())
def test_a_huge_cell_is_shown_by_its_beginning(tmp_path: Path, read: Read, content: str) -> None:
    assert len(sentence(read, tmp_path / "a", content.format("z" * 100_000))) < 700


@pytest.mark.parametrize("read", [csv, columns])
def test_a_header_of_many_columns_is_shown_by_its_beginning(tmp_path: Path, read: Read) -> None:
    header = ",".join(f"c{k}" for k in range(100_000))
    assert len(sentence(read, tmp_path / "a", f"{header}\n1,2\n")) < 400
    assert len(sentence(read, tmp_path / "a", f"t,x,{header}\n1,2\n")) < 400


@pytest.mark.parametrize("read", [csv, columns])
def test_what_does_not_print_is_shown_by_its_escape(tmp_path: Path, read: Read) -> None:
    assert "x is '1\\x1b2', expected a number" in sentence(read, tmp_path / "a", "t,x\n1,1\x1b2\n")
    assert "\\r" in sentence(read, tmp_path / "a", "t,y\rz\n1,2\n")
    assert "\r" not in sentence(read, tmp_path / "a", "t,y\rz\n1,2\n")


def test_a_cell_is_cut_where_it_is_too_long() -> None:
    assert shortened("z" * SHOWN) == repr("z" * SHOWN)
    assert shortened("z" * (SHOWN + 1)) == repr("z" * SHOWN) + "..."


@pytest.mark.parametrize(("cell", "found"), [("1e3", 1000.0), (" -2 ", -2.0), ("1_000", None), ("\u0663", None)])
def test_numbers_are_plain_ones(cell: str, found: float | None) -> None:
    assert number(cell) == found


HINTS = {
    "semicolons": ("t;x\n1;2\n", "/a, line 1: found ; between the columns, expected commas."),
    "tabs": ("t\tx\n1\t2\n", "/a, line 1: found tabs between the columns, expected commas."),
    "case": ("T,x\n1,2\n", "/a, line 1: found the column 'T', expected t, spelt like this."),
    "comma": (
        "t,x\n1,5,2,5\n",
        "line 2: found 4 columns, expected 2 (t,x); numbers have a decimal point, these perhaps",
    ),
}


@pytest.mark.parametrize("hint", HINTS)
@pytest.mark.parametrize("read", [csv, columns])
def test_what_is_plainly_meant_is_said(tmp_path: Path, read: Read, hint: str) -> None:
    content, words = HINTS[hint]
    assert words in sentence(read, tmp_path / "a", content)


@pytest.mark.parametrize("header", ['"t","x"', "t,X", "T ,x"])
def test_a_name_that_is_spelt_otherwise_is_said(tmp_path: Path, header: str) -> None:
    assert "spelt like this" in sentence(csv, tmp_path / "a", f"{header}\n1,2\n")


def test_a_row_with_a_cell_too_many_has_no_decimal_comma(tmp_path: Path) -> None:
    assert sentence(csv, tmp_path / "a", "t,x\n1.5,2,3\n") == "/a, line 2: found 3 columns, expected 2 (t,x)."


def test_a_decimal_comma_between_blanks_is_said(tmp_path: Path) -> None:
    found = sentence(spaced, tmp_path / "a", "1,5 2\n")
    assert found == "/a, line 1: t is '1,5', expected a number with a decimal point."


@pytest.mark.parametrize("codec", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("read", [csv, columns, spaced, stepwise, g2o.read])
def test_utf_16_is_told(tmp_path: Path, read: Read, codec: str) -> None:
    assert "found UTF-16, expected UTF-8" in sentence(read, tmp_path / "a", "t,x\n1,2\n".encode(codec))


@pytest.mark.parametrize("cell", ["nan", "inf", "-Infinity", "1_000", "\u0661", "1e999", "", "12 s"])
def test_what_is_no_finite_number_is_none(cell: str) -> None:
    assert finite(cell) is None


def test_a_finite_number() -> None:
    assert finite(" -1.5e3 ") == -1500.0

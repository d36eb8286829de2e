from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slamduel.frontend.errors import InputError
from slamduel.frontend.se2 import Array
from slamduel.frontend.table import read_csv, read_spaced, symmetric, upper


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
    with pytest.raises(InputError, match=r"a\.csv, line 3: "):
        read_csv(tmp_path / "a.csv", ("a", "b"))


@pytest.mark.parametrize("value", ["0.5", "9007199254740994", "nan", "-inf"])
def test_a_whole_number_is_one(tmp_path: Path, value: str):
    (tmp_path / "a.csv").write_text(f"a,b\n1,2\n3,{value}\n")
    with pytest.raises(InputError, match=r"a\.csv, line 3: b is .*, expected a whole number"):
        read_csv(tmp_path / "a.csv", ("a", "b")).whole("b")


def test_a_folder_is_no_table(tmp_path: Path):
    with pytest.raises(InputError, match="cannot be read"):
        read_csv(tmp_path, ("a", "b"))


@pytest.mark.parametrize("k", [2, 3])
def test_triangles_and_matrices_are_inverse(k: int):
    triangles = np.random.default_rng(1).normal(size=(5, k * (k + 1) // 2))
    full = symmetric(triangles)
    np.testing.assert_array_equal(full, full.swapaxes(1, 2))
    np.testing.assert_array_equal(full[:, 0, 1], triangles[:, 1])
    np.testing.assert_array_equal(upper(full).T, triangles)

"""Tables of numbers as text: what Python's csv module writes, however many blocks it takes."""

import csv
import io

import numpy as np
import pytest

from slamduel.core import files
from slamduel.core.files import number_rows

RNG = np.random.default_rng(3)
FLOATS = np.append(RNG.normal(0, 10.0 ** RNG.integers(-300, 300, 40)), (0.0, -0.0, 1e16, 1e-5, np.inf))
COUNTS = RNG.integers(-(2**62), 2**62, len(FLOATS))


@pytest.mark.parametrize("block", [1, 7, 45, 1000])
def test_rows_are_those_of_a_csv_writer_in_blocks_of_any_size(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "BLOCK", block)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(zip(COUNTS.tolist(), FLOATS.tolist(), strict=True))
    blocks = list(number_rows([COUNTS, FLOATS]))
    assert len(blocks) == -(-len(FLOATS) // block)
    assert "".join(blocks) == text.getvalue()
    back = [float(line.split(",")[1]) for line in "".join(blocks).splitlines()]
    assert np.array(back).tobytes() == FLOATS.tobytes()


def test_what_is_not_a_number_or_masked_is_blank() -> None:
    some = np.array([1.5, np.nan, -2.0])
    none = np.full(3, np.nan)
    count = np.ma.array([1, 2, 3], mask=[False, False, True])
    assert "".join(number_rows([some, none, count], " ", "EDGE ")) == "EDGE 1.5  1\nEDGE   2\nEDGE -2.0  \n"


def test_a_table_without_rows_has_no_text() -> None:
    assert list(number_rows([np.zeros(0), np.zeros(0, np.int64)])) == []

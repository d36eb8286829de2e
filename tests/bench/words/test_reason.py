"""What a backend says is kept in a form that everything can take, whatever it is."""

import sqlite3

import pytest

from slamduel.bench.words.reason import LONGEST, LONGEST_TRACEBACK, reason, traceback

ODD = "bad \ud800 \x1b[31mred\x00 \u202e \ufffd"


def test_an_ordinary_reason_is_kept_as_it_is() -> None:
    for text in ("", "step 4: the pose is not finite: [nan 0. 0.]", "Größe µ ✓ [bold] :x: <b> & 50 % of $x_1$"):
        assert reason(text) == text


def test_lines_become_one_and_what_cannot_be_seen_is_spelt() -> None:
    assert reason("[[nan nan]\n [0.\t1.]]") == "[[nan nan] [0. 1.]]"
    assert reason(ODD) == r"bad \ud800 \x1b[31mred\x00 \u202e \ufffd"
    assert traceback("one\n\ttwo \ud800\nthree") == "one\n\\ttwo \\ud800\nthree"


@pytest.mark.parametrize("text", ["x" * 5_000_000, "\ud800" * 5_000_000, "x\n" * 4_000, ODD * 600])
def test_a_long_one_is_cut_and_says_so(text: str) -> None:
    found = reason(f"Error: {text} (here.py:3)")
    assert len(found) == LONGEST
    assert found.startswith("Error: ")
    assert found.endswith("(here.py:3)")
    assert " ... [cut] ... " in found
    assert len(traceback(text)) <= LONGEST_TRACEBACK
    with sqlite3.connect(":memory:") as db:
        assert db.execute("SELECT ?, ?", (found, traceback(text))).fetchone() == (found, traceback(text))

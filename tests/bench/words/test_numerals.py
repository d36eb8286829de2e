"""Numbers and words as a reader wants them."""

from math import inf, nan

import pytest

from slamduel.bench.words.numerals import chance, counted, factor, larger, listed, number, plain, times


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"), (0.0213, "0.0213"), (0.5, "0.500"), (0.9999, "1.00"), (99.96, "100"), (12.34, "12.3"), (123.4, "123"),
        (1234567, "1,234,567"), (-4.5, "-4.50"), (2e-5, "0.0000200"), (2.08e7, "2.08\u00d710\u2077"),
        (1.2e-9, "1.20\u00d710\u207b\u2079"), (9999999, "1.00\u00d710\u2077"), (inf, "\u221e"), (-inf, "-\u221e"),
        (nan, "not a number"),
    ],
)  # fmt: skip
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_marks_of_an_axis_have_no_zeros_at_the_end() -> None:
    assert [plain(v) for v in (0.01, 0.5, 20, 100, 1000, 1e8)] == ["0.01", "0.5", "20", "100", "1,000", number(1e8)]


def test_words_for_many_and_few() -> None:
    assert (counted(1, "seed"), counted(1200, "step")) == ("1 seed", "1,200 steps")
    assert [listed(list("abc")[:n]) for n in (1, 2, 3)] == ["a", "a and b", "a, b and c"]


@pytest.mark.parametrize(
    ("ratio", "text"),
    [(1.004, "1.004"), (1.04, "1.04"), (1.84, "1.8"), (9.94, "9.9"), (9.96, "10"), (17.4, "17"), (1234, "1,200")],
)
def test_a_ratio_has_the_figures_that_matter(ratio: float, text: str) -> None:
    assert factor(ratio) == text


def test_an_interval_of_ratios() -> None:
    assert times(1.8, 2.3) == "1.8 to 2.3 times"
    assert times(1.8, inf) == "at least 1.8 times"
    assert times(2.04, 2.01) == "2.0 times"


@pytest.mark.parametrize(
    ("ratio", "text"),
    [(1.0, "0 %"), (1.004, "0.4 %"), (1.04, "4 %"), (1.46, "46 %"), (2.3, "2.3 times"), (inf, "any number of times")],
)
def test_how_much_more(ratio: float, text: str) -> None:
    assert larger(ratio) == text


def test_p_is_never_nothing() -> None:
    assert [chance(p) for p in (1e-9, 0.00021, 0.0234, 1.0)] == ["p < 0.0001", "p = 0.0002", "p = 0.023", "p = 1"]

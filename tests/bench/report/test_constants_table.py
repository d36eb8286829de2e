"""The report's table of estimated constants."""

from typing import Any

from judged_rows import told
from slamduel.bench.report.constants_table import PARTICLES, constants_table
from slamduel.bench.verdict.summary import lines


def test_a_column_without_any_value_is_left_out() -> None:
    unknown = constants_table(lines(told("ekf", range_scale=[0.05, 0.06], range_scale_sd=[0.004, 0.005])))
    assert [column.heading for column in unknown.headings] == ["constant", "estimate", "stated sd"]
    assert [[entry.text for entry in row.entries] for row in unknown.rows] == [["range scale", "0.0550", "0.00450"]]
    known = constants_table(lines(told("ekf", range_scale=[0.05], range_scale_true=[0.04])))
    assert [column.heading for column in known.headings] == ["constant", "estimate", "true"]
    assert not constants_table(lines(told("ekf", ate_m=[0.1]))).rows


def test_the_spread_of_particles_is_said_to_be_too_small_where_they_are_listed() -> None:
    ekf, fastslam = (told(name, range_scale=[0.05], range_scale_sd=[0.004]) for name in ("ekf", "fastslam"))
    assert PARTICLES in constants_table(lines([*ekf, *fastslam])).caption
    assert PARTICLES not in constants_table(lines(ekf)).caption


def test_the_caption_says_how_many_of_these_the_error_is() -> None:
    """Medians over runs and constants of 9, 1 and 3 standard deviations."""
    true = [0.041, 0.049, 0.053]
    columns: dict[str, Any] = {"range_scale": [0.05] * 3, "range_scale_sd": [0.001] * 3, "range_scale_true": true}
    ekf, fastslam = (told(name, **columns) for name in ("ekf", "fastslam"))
    assert f"{PARTICLES}, the error being 3.00 times that (median)" in constants_table(lines([*ekf, *fastslam])).caption
    assert "the error being" not in constants_table(lines(ekf)).caption

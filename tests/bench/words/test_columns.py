"""The table of columns: what other tools rely on stays, and what a name says of a column is true of its kind."""

import pytest

from slamduel.bench.words.column import CPU_S, ERROR_M, INSIDE_95, NEES, Column
from slamduel.bench.words.columns import CELLS, COLUMNS, FINAL, METRICS, about
from slamduel.bench.words.report_columns import REPORT

UNITS = {
    "_rad_s": "rad/s",
    "_m": "m",
    "_rad": "rad",
    "_us": "µs",
    "_ms": "ms",
    "_s": "s",
    "_mb": "MB",
    "_deg": "degrees",
}


def test_the_columns_of_cells_csv_stay_as_they_are() -> None:
    assert [column.name for column in CELLS] == [
        "dataset", "dataset_options", "backend", "options", "seed", "status", "reason", "digest", "truth_kind",
        "steps", "sightings", "ignored", "landmarks", "ate_m", "ate_origin_m", "heading_rad", "rpe_m", "map_rmse_m",
        "nees", "nees_inside", "nis", "final_ate_m", "final_ate_origin_m", "final_map_rmse_m", "cost_j",
        "step_us_mean", "step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "belief_us_mean",
        "finish_s", "setup_s", "cpu_s", "peak_mb", "timing_alone", "bound_m", "final_bound_m",
        "over_1ms", "over_10ms", "over_100ms",
    ]  # fmt: skip
    assert [column.name for column in CELLS if column.kind.names_cell] == [column.name for column in CELLS[:5]]


def test_every_name_is_there_once_with_a_heading_and_a_meaning() -> None:
    assert len(COLUMNS) == len([*CELLS, *METRICS, *REPORT])
    for column in COLUMNS.values():
        assert column.heading
        assert column.meaning.endswith(".")


@pytest.mark.parametrize("column", [*CELLS, *METRICS], ids=lambda column: column.name)
def test_a_unit_is_what_the_name_ends_in(column: Column) -> None:
    stem = column.name.partition("_us_")[0] + "_us" if "_us_" in column.name else column.name
    unit = next((unit for ending, unit in UNITS.items() if stem.endswith(ending)), "")
    assert column.kind.unit == unit


def test_a_final_column_is_of_the_kind_of_the_online_one() -> None:
    for column in (*CELLS, *METRICS):
        online = column.name.removeprefix("final_")
        assert column.kind is about(online).kind
    assert {column.name for column in FINAL} < {column.name for column in METRICS}


def test_a_failure_counts_in_errors_alone() -> None:
    errors = {column.name.removeprefix("final_") for column in COLUMNS.values() if column.kind.is_error}
    lengths = {f"rpe_{stretch}_m" for stretch in ("10m", "100m", "1s", "10s")}
    paths = {"ate_m", "ate_origin_m", "ate_median_m", "heading_rad", "map_rmse_m", "rpe_m", "rpe_rad"}
    relations = {f"relation{what}_{unit}" for what in ("", "_se", "_sd", "_max") for unit in ("m", "deg")}
    assert errors == paths | lengths | relations


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("ate_m", 0.01234, "0.0123"),
        ("landmarks", 1234.0, "1,234"),
        ("nees_inside", 0.95, "95.0 %"),
        ("real_time", 0.002, "0.200 %"),
        ("finish_s", 1e-9, "<0.001"),
        ("cpu_s", 1.5, "1.50"),
        ("growth_steps", -0.001, "0.00"),
        ("step_us_p50", 12.34, "12.3"),
    ],
)
def test_a_value_is_written_as_its_kind_is(name: str, value: float, text: str) -> None:
    assert about(name).kind.shown(value) == text


def test_a_column_alone_has_a_name_a_unit_and_a_first_sentence() -> None:
    assert about("heading_rad").with_unit == "error of the heading, rad"
    assert about("nis").with_unit == "NIS (1 = consistent)"
    assert about("setup_s").gist == "Time of the set-up: CPU time of making the backend."
    assert Column("j", "J", NEES, "NEES of it. More.").gist == "J: NEES of it."
    assert (INSIDE_95.expected, NEES.expected, ERROR_M.expected, CPU_S.expected) == (0.95, 1, None, None)


def test_a_column_of_another_version_is_a_plain_number() -> None:
    old = about("wheel_slip")
    assert (old.called, old.kind.unit, old.gist, old.kind.shown(0.5)) == ("wheel slip", "", "", "0.500")

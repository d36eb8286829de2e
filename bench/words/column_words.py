"""What a column is called where it stands alone: on an axis, in a title or in a sentence."""

from .columns import COLUMNS, WORKED_OUT

CONSISTENCY = ("nees", "final_nees", "landmark_nees", "final_landmark_nees", "nis")
"""Columns that are 1 where a belief is as wide as its errors."""

EXPECTED = {**dict.fromkeys(CONSISTENCY, 1.0), "nees_inside": 0.95, "landmark_nees_inside": 0.95}
"""What a column is on average where a belief is as wide as its errors."""

_SAID = {
    "heading_rad": "error of the heading", "final_heading_rad": "error of the final heading",
    "map_rmse_m": "error of the map", "final_map_rmse_m": "error of the final map",
    "nees_inside": "share of steps inside 95 %",
    "step_us_mean": "mean time of a step", "step_us_p50": "median time of a step",
    "step_us_p95": "95th percentile of a step's time", "step_us_p99": "99th percentile of a step's time",
    "step_us_max": "time of the slowest step", "belief_us_mean": "mean time of a belief",
    "step_us_fifth1": "mean time of a step in the first fifth",
    "step_us_fifth5": "mean time of a step in the last fifth",
    "finish_s": "time of the finish",
    "setup_s": "time of the set-up", "cpu_s": "time of the whole log",
}  # fmt: skip
"""Of columns whose heading needs the table's."""


def called(column: str) -> str:
    """Its name, without a unit."""
    about = (COLUMNS | WORKED_OUT).get(column)
    return _SAID.get(column) or (about.heading if about else column.replace("_", " "))


def with_unit(column: str) -> str:
    """Its name and unit, or what its value is where all is well."""
    about = (COLUMNS | WORKED_OUT).get(column)
    unit = about.unit if about and about.unit != "1" else ""
    return called(column) + f", {unit}" * bool(unit) + " (1 = consistent)" * (column in CONSISTENCY)


def meaning(column: str) -> str:
    """The first sentence of its definition; "" for a column that has none."""
    about = (COLUMNS | WORKED_OUT).get(column)
    if about is None:
        return ""
    first = about.meaning.split(". ")[0].rstrip(".")
    return f"{called(column)[:1].upper()}{called(column)[1:]}: {_lowered(first)}."


def _lowered(sentence: str) -> str:
    """As it goes on after a colon; abbreviations stay."""
    return sentence if sentence[:2].isupper() else sentence[:1].lower() + sentence[1:]

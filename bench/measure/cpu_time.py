"""Computes the columns of CPU time: of a step, of the parts of a run, relative to the log's time, and its growth."""

from typing import Any

import numpy as np

from ...core.arrays import length
from ...core.factors import Log
from ...core.se2 import Array, Ints
from .drive import Outcome, Timing
from .growth import growth, mapped, slope, slope_from, slope_mapping, whole_from

DEADLINES_MS = (1, 10, 100)  # each has a column
STRETCHES = 5  # equal parts of a run whose mean costs are reported


def repeated_cost(timed: Timing) -> dict[str, Any]:
    """Computes the columns that a timing pass measures: costs in the unit that each name ends in, and the machine's."""
    us = timed.step_ns / 1e3
    p50, p95, p99 = np.percentile(us, (50, 95, 99)).tolist()
    return {
        "step_us_mean": float(us.mean()),
        "step_us_p50": p50,
        "step_us_p95": p95,
        "step_us_p99": p99,
        "step_us_max": float(us.max()),
        "finish_s": timed.finish_ns / 1e9,
        "setup_s": timed.setup_ns / 1e9,
        "cpu_s": float(timed.step_ns.sum() + timed.setup_ns + timed.finish_ns) / 1e9,
        **timed.meanwhile,
        **({} if timed.online is None else {f"over_{ms}ms": float((us > 1e3 * ms).mean()) for ms in DEADLINES_MS}),
    }


def step_cost(log: Log, outcome: Outcome) -> dict[str, Any]:
    """Computes all columns of costs."""
    us = outcome.step_ns / 1e3
    row = repeated_cost(outcome) | {"belief_us_mean": float(outcome.belief_ns.mean() / 1e3), "repeats": 1}
    if len(us) >= STRETCHES:
        row |= {f"step_us_fifth{k}": float(part.mean()) for k, part in enumerate(_fifths(us), start=1)}
    covered = length(log.t)
    row |= {} if covered is None else {"length_s": covered}
    if outcome.online is None:  # a batch method does nothing in its steps
        return row
    if covered is not None:
        row["real_time"] = float(outcome.step_ns.sum()) / 1e9 / covered
        row["late_share"] = float((outcome.step_ns[:-1] > 1e9 * np.diff(log.t)).mean())
    return row | growth_columns(us, mapped(log))


def growth_columns(us: Array, sizes: Ints) -> dict[str, Any]:
    """Computes the columns of growth from the cost of every step (n,) and how many landmarks are known after it (n,).

    The slope of a long log is over the steps since the map is whole, whose number goes on from the log's start. A
    second one is over those before.
    """
    number, row, whole = 1 + np.arange(len(us)), dict[str, Any](), whole_from(sizes)
    row |= {} if whole is None else {"whole_from": whole}
    for name, x in (("steps", number), ("landmarks", sizes)):
        found = growth(x, us)
        if found is not None:
            row |= {f"growth_{name}": found.exponent, f"growth_{name}_se": found.error}
    start = slope_from(whole, len(us))
    slopes = {"steps": slope(us, start), "mapping": slope_mapping(us, whole)}
    for name, found in slopes.items():
        if found is not None:
            row |= {f"slope_{name}{end}": value for end, value in zip(("", "_low", "_high"), found, strict=True)}
    row |= {} if slopes["steps"] is None else {"slope_from": start}
    if len(us) < STRETCHES:
        return row
    fifths = _fifths(us)
    starts = np.cumsum([0, *map(len, fifths[:-1])])
    firsts = {"first": 0} | ({} if whole is None else {"whole": int(np.searchsorted(starts, whole))})
    means = [float(part.mean()) for part in fifths]
    later = {name: k for name, k in firsts.items() if k < STRETCHES - 1 and means[k] > 0}
    return row | {f"last_over_{name}": means[-1] / means[k] for name, k in later.items()}


def _fifths(us: Array) -> list[Array]:
    return np.array_split(us, STRETCHES)

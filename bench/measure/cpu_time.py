"""Computes the columns of CPU time: of a step, of the parts of a run, relative to the log's time, and its growth."""

from typing import Any

import numpy as np

from ...core.factors import Log
from .drive import Outcome, Timing
from .growth import growth, mapped
from .times import length

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
    }


def step_cost(log: Log, outcome: Outcome) -> dict[str, Any]:
    """Computes all columns of costs."""
    us = outcome.step_ns / 1e3
    row = repeated_cost(outcome) | {"belief_us_mean": float(outcome.belief_ns.mean() / 1e3), "repeats": 1}
    if len(us) >= STRETCHES:
        parts = np.array_split(us, STRETCHES)
        row |= {f"step_us_fifth{k}": float(part.mean()) for k, part in enumerate(parts, start=1)}
    covered = length(log.t)
    row |= {} if covered is None else {"length_s": covered}
    if outcome.online is None:  # a batch method does nothing in its steps
        return row
    if covered is not None:
        row["real_time"] = float(outcome.step_ns.sum()) / 1e9 / covered
    for name, x in (("steps", 1 + np.arange(len(us))), ("landmarks", mapped(log))):
        found = growth(x, outcome.step_ns)
        if found is not None:
            row |= {f"growth_{name}": found.exponent, f"growth_{name}_se": found.error}
    return row

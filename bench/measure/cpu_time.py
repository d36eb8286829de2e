"""Computes the columns of CPU time: of a step, of the parts of a run, relative to the log's time, and its growth."""

from typing import Any

import numpy as np

from ...frontend.factors import Log
from .drive import Outcome
from .growth import growth, mapped
from .times import length

STRETCHES = 5  # equal parts of a run whose mean costs are reported


def step_cost(log: Log, outcome: Outcome) -> dict[str, Any]:
    """Computes the columns of costs, in the unit that each name ends in."""
    us = outcome.step_ns / 1e3
    p50, p95, p99 = np.percentile(us, (50, 95, 99)).tolist()
    row = {
        "step_us_mean": float(us.mean()),
        "step_us_p50": p50,
        "step_us_p95": p95,
        "step_us_p99": p99,
        "step_us_max": float(us.max()),
        "belief_us_mean": float(outcome.belief_ns.mean() / 1e3),
        "finish_s": outcome.finish_ns / 1e9,
        "setup_s": outcome.setup_ns / 1e9,
        "cpu_s": float(outcome.step_ns.sum() + outcome.setup_ns + outcome.finish_ns) / 1e9,
    }
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

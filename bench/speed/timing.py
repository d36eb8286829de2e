"""Times steppers in turns: CPU time per step until a budget is spent, and its distribution."""

import gc
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Step
from ...core.se2 import Array, Ints
from ..measure.drive import timing_pass
from ..process.clock import clock_cost

FIFTHS = 5
CHUNK = 50  # steps between two checks of the budget
LEAST = 3  # steps that are timed however long they take


class Timing(NamedTuple):
    """µs of CPU per step."""

    steps: int
    mean: float
    p50: float
    p95: float
    p99: float
    max: float
    fifths: tuple[float, ...]  # means over the fifths of the run, NaN for one without a step


class TimingRow(NamedTuple):
    """A timing at one size, or why there is none."""

    kind: str  # backend | part (of a backend's step)
    name: str
    landmarks: int
    timing: Timing | None = None
    reason: str = ""  # "" where it was timed
    beside: str = ""  # of a part: the backend
    implementation: str = ""  # whose program a backend is


def timing(ns: Ints | Array) -> Timing:
    """Summarises CPU times (n,), n > 0, in ns in the order in which they were spent."""
    us = ns / 1e3
    p50, p95, p99 = np.percentile(us, (50, 95, 99)).tolist()
    fifths = tuple(float(part.mean()) if len(part) else np.nan for part in np.array_split(us, FIFTHS))
    return Timing(len(us), float(us.mean()), p50, p95, p99, float(us.max()), fifths)


def in_turns(steppers: Sequence[Any], drives: Sequence[Sequence[Step]], seconds: float) -> list[Ints]:
    """Measures ns of CPU (n,) of each step, without collection, a chunk of each stepper's drive in turn.

    The drives have the same length; it ends when `seconds` are spent, of all together.
    """
    spent = [[np.zeros(0, np.int64)] for _ in steppers]
    clock, first, chunk = clock_cost(), 0, LEAST
    gc.collect()
    gc.disable()
    try:
        while first < len(drives[0]) and sum(part.sum() for parts in spent for part in parts) < seconds * 1e9:
            for parts, stepper, steps in zip(spent, steppers, drives, strict=True):
                parts.append(timing_pass(stepper, list(steps[first : first + chunk]))[1])
            first += chunk
            of_all = max(sum(float(parts[-1].mean()) for parts in spent), 1.0)
            chunk = int(np.clip(0.1 * seconds * 1e9 / of_all, 1, CHUNK))
    finally:
        gc.enable()
    return [np.maximum(np.concatenate(parts) - clock, 0) for parts in spent]

"""Times steppers: CPU time per step until a budget is spent, its distribution, and bytes of state."""

import gc
from collections.abc import Iterator, Sequence
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Step
from ...core.se2 import Array, Ints
from ..measure.drive import timing_pass
from ..process.clock import clock_cost

FIFTHS = 5
CHUNK = 50  # steps between two checks of the budget
LEAST = 3  # steps that are timed however long they take
FOREIGN = ("gtsam",)  # packages whose objects hold memory that Python cannot see


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

    kind: str  # backend | reference | part (of a backend's step) | together (with others, in turns)
    name: str
    landmarks: int
    particles: int | None = None
    timing: Timing | None = None
    reason: str = ""  # "" where it was timed
    beside: str = ""  # of a reference or part: the backend in whose process it was timed
    finish_ms: float | None = None  # the smoothing at the end, all of it
    array_bytes: int | None = None  # NumPy arrays that the backend holds
    resident_bytes: int | None = None  # what the process grew by; None where Python sees all that the backend holds
    implementation: str = ""  # whose program a backend is


def timing(ns: Ints | Array) -> Timing:
    """Summarises CPU times (n,), n > 0, in ns in the order in which they were spent."""
    us = ns / 1e3
    p50, p95, p99 = np.percentile(us, (50, 95, 99)).tolist()
    fifths = tuple(float(part.mean()) if len(part) else np.nan for part in np.array_split(us, FIFTHS))
    return Timing(len(us), float(us.mean()), p50, p95, p99, float(us.max()), fifths)


def stepped(stepper: Any, steps: Sequence[Step], seconds: float) -> Ints:
    """Measures ns of CPU (n,) of each `stepper.step(step)`, without collection, until `seconds` are spent."""
    return in_turns([stepper], [steps], seconds)[0]


def in_turns(steppers: Sequence[Any], drives: Sequence[Sequence[Step]], seconds: float) -> list[Ints]:
    """Measures as `stepped`, each on its drive of the same length, a chunk in turn; `seconds` are for all together."""
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


def array_bytes(backend: object) -> int:
    """Sums the bytes of NumPy arrays reachable from `backend`, each whole; read-only ones are the log's."""
    return sum({id(array): array.nbytes for array in _arrays(backend)}.values())


def holds_foreign(backend: object) -> bool:
    """True if it holds objects of a package whose memory Python cannot see."""
    return any(type(thing).__module__.split(".")[0] in FOREIGN for thing in _reached(backend))


def _arrays(backend: object) -> Iterator[np.ndarray[Any, Any]]:
    for thing in _reached(backend):
        if isinstance(thing, np.ndarray):
            while isinstance(thing.base, np.ndarray):
                thing = thing.base  # noqa: PLW2901 - a view's memory is its base's
            if thing.flags.writeable:
                yield thing


def _reached(start: object) -> Iterator[object]:
    """Yields every object reachable from `start`, itself first; not through classes, functions and modules."""
    seen, todo = {id(start)}, [start]
    while todo:
        thing = todo.pop()
        yield thing
        for inner in gc.get_referents(thing):
            compiled = type(inner).__module__.startswith("numba")  # a compiler hangs on it
            if id(inner) not in seen and not compiled and not isinstance(inner, _CODE):
                seen.add(id(inner))
                todo.append(inner)


_CODE = (type, ModuleType, FunctionType, BuiltinFunctionType, MethodType)

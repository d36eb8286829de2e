"""Times the parts of an iSAM2 step: GTSAM's update, its query of the latest pose, and Python's own.

It also times what is no part of a step: the pose's marginal covariance, and back-substitution for all variables.
"""

import gc
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.factors import Step
from ..process.clock import clock_cost
from .timing import TimingRow, timing

EVERY = 20  # steps between two timings of what is no part of a step
PYTHON = "Python's own"  # the rest of a step: making factors

PARTS = ("update", "latest pose", PYTHON)

WHOLE, BY_HAND = "whole step", "by hand"  # of the backend, and of a loop by hand, in turns

_TREE, _UPDATE, _LATEST = "_tree", "update", "_latest"  # their names in the backend, that of the update in its tree


class Stopwatch:
    """Measures the CPU time of an object's methods, in ns by the method's name."""

    def __init__(self) -> None:
        self.spent: dict[str, int] = {}
        self.calls = 0
        self.clock = clock_cost()

    def watch(self, owner: Any, name: str) -> None:
        """Starts timing that method; one that fails still counts."""
        method = getattr(owner, name)

        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.process_time_ns()
            try:
                return method(*arguments, **named)
            finally:
                self.calls += 1
                self.spent[name] = self.spent.get(name, 0) + time.process_time_ns() - start - self.clock

        setattr(owner, name, timed)


def isam2_parts(backend: Any, steps: Sequence[Step], seconds: float, landmarks: int, beside: str) -> list[TimingRow]:
    """Times the parts of the steps of an `isam2` after its survey; none for any other backend."""
    from ...backends.graphs.isam2 import Isam2

    if not isinstance(backend, Isam2):
        return []
    watch = Stopwatch()
    tree = getattr(backend, _TREE)
    watch.watch(tree, _UPDATE)
    watch.watch(backend, _LATEST)
    solved = tree.isam.calculateBestEstimate
    parts: dict[str, list[int]] = {name: [] for name in (*PARTS, "marginal", "back-substitution")}
    begun = time.process_time()
    gc.collect()
    gc.disable()
    try:
        for k, step in enumerate(steps):
            if k >= EVERY and time.process_time() - begun > seconds:
                break
            watch.spent.clear()
            watch.calls = 0
            start = time.process_time_ns()
            backend.step(step)
            whole = time.process_time_ns() - start - watch.clock
            update, latest = (watch.spent.get(method, 0) for method in (_UPDATE, _LATEST))
            outside = whole - update - latest - watch.calls * watch.clock  # reading the clock is the watch's own
            for name, ns in zip(PARTS, (update, latest, outside), strict=True):
                parts[name].append(ns)
            if k % EVERY == 0:
                parts["marginal"].append(_spent(backend.belief) - watch.clock)
                parts["back-substitution"].append(_spent(solved) - watch.clock)
    finally:
        gc.enable()
    return [
        TimingRow("part", name, landmarks, timing=timing(np.maximum(np.array(ns, np.int64), 0)), beside=beside)
        for name, ns in parts.items()
    ]


def _spent(call: Any) -> int:
    start = time.process_time_ns()
    call()
    return time.process_time_ns() - start

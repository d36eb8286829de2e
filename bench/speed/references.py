"""Times references in the backend's own process, so that a ratio compares algorithms, not machines.

`dsyrk`: one BLAS call that updates a triangle of the covariance by as many columns as the step's sightings have
numbers; no dense filter that makes a step at once does less. `memory`: that triangle read and written once, at the
bandwidth of copying an array too large for the caches. `textbook`: EKF-SLAM in NumPy, every matrix in full. `particle
loop`: FastSLAM 1.0 with a Python loop over particles. `locate`: the search for the robot on the whole map by the last
128 steps without ids, as many as are ever held, as before the first step of a filter whose start is unknown.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ...backends.locating.locate import locate
from ...backends.locating.locating import WINDOW
from ...backends.locating.map_index import indexed
from ...core.factors import UNKNOWN
from ...core.se2 import Ints
from ..process.clock import clock_cost
from .timing import LEAST, TimingRow, stepped, timing
from .world import World

BUDGET = 2.0  # s of CPU for each reference, at least three steps
CALLS = 300  # calls of BLAS or copies, at most
LARGE = 64 << 20  # bytes of an array that no cache holds
LARGEST_TEXTBOOK = 1000  # landmarks; its step takes 3 s there, and the cube of that beyond
MOST_IN_A_LOOP = 1000  # particles up to which a loop over them is timed: a step takes half a second there


class Floors:
    """dsyrk and memory at one size, timed whenever `measure` is called: before the backend and after it."""

    def __init__(self, landmarks: int, sightings: int) -> None:
        self._landmarks = landmarks
        self._n = 3 + 2 * landmarks
        self._rank = 2 * min(sightings, landmarks)
        self._dsyrk, self._copies = list[Ints](), list[Ints]()

    def measure(self) -> None:
        """Times both once more."""
        from scipy.linalg import blas

        dsyrk: Any = blas.dsyrk  # pyright: ignore[reportAttributeAccessIssue] - made when SciPy is built  # ty: ignore[missing-attribute]
        n = self._n
        covariance = np.zeros((n, n), order="F")
        factor = np.asfortranarray(np.random.default_rng(0).standard_normal((n, self._rank)))
        self._dsyrk.append(_called(lambda: dsyrk(-1e-6, factor, beta=1.0, c=covariance, overwrite_c=1, lower=1)))
        source, target = np.ones(LARGE // 8), np.ones(LARGE // 8)
        self._copies.append(_called(lambda: np.copyto(target, source), seconds=0.2))

    def rows(self, beside: str) -> list[TimingRow]:
        """The measured rows."""
        bytes_a_step = 2 * 8 * self._n * (self._n + 1) / 2
        streamed = (bytes_a_step / (2 * LARGE)) * np.concatenate(self._copies).astype(np.float64)
        return [
            TimingRow("reference", "dsyrk", self._landmarks, timing=timing(np.concatenate(self._dsyrk)), beside=beside),
            TimingRow("reference", "memory", self._landmarks, timing=timing(streamed), beside=beside),
        ]


def textbook(world: World, beside: str) -> TimingRow:
    """Times the textbook filter from a given map: its cost is the same as if it had made it."""
    from ...backends.programs.textbook_ekf import TextbookEkf

    landmarks = len(world.map.ids)
    if landmarks > LARGEST_TEXTBOOK:
        said = f"not timed beyond {LARGEST_TEXTBOOK} landmarks, where a step takes seconds"
        return TimingRow("reference", "textbook", landmarks, reason=said, beside=beside)
    ns = stepped(TextbookEkf(world.surveyed()), world.drive, BUDGET)
    return TimingRow("reference", "textbook", landmarks, timing=timing(ns), beside=beside)


def particle_loop(world: World, particles: int, seed: int, beside: str) -> TimingRow:
    """Times the loop from a given map."""
    from ...backends.programs.textbook_fastslam import TextbookFastSlam

    landmarks = len(world.map.ids)
    if particles > MOST_IN_A_LOOP:
        said = f"not timed beyond {MOST_IN_A_LOOP:,} particles, where a step takes half a second"
        return TimingRow("reference", "particle loop", landmarks, particles, reason=said, beside=beside)
    loop = TextbookFastSlam(world.surveyed(), particles, np.random.default_rng(seed))
    ns = stepped(loop, world.drive, BUDGET)
    return TimingRow("reference", "particle loop", landmarks, particles, timing(ns), beside=beside)


def search(world: World, beside: str) -> TimingRow:
    """Times `locate` on a given map, repeated as the window of steps moves on through the drive."""
    known = world.surveyed().map
    assert known is not None
    on, spent, clock = indexed(known), list[int](), clock_cost()
    unnamed = [
        step._replace(sightings=step.sightings._replace(ids=np.full(len(step.sightings.ids), UNKNOWN)))
        for step in world.drive
    ]
    last = min(WINDOW, len(unnamed))
    locate(unnamed[:last], on)
    while len(spent) < LEAST or (len(spent) < CALLS and sum(spent) < BUDGET / 4 * 1e9):
        start = time.process_time_ns()
        locate(unnamed[last - WINDOW if last > WINDOW else 0 : last], on)
        spent.append(time.process_time_ns() - start)
        last = last + 1 if last < len(unnamed) else min(WINDOW, len(unnamed))
    return TimingRow("reference", "locate", len(known.ids), timing=timing(np.array(spent) - clock), beside=beside)


def _called(call: Callable[[], Any], seconds: float = BUDGET / 4) -> Ints:
    """Measures CPU time (n,) in ns of calling `call`, after an uncounted first call, the clock's cost subtracted."""
    call()
    spent, clock = list[int](), clock_cost()
    while len(spent) < CALLS and sum(spent) < seconds * 1e9:
        start = time.process_time_ns()
        call()
        spent.append(time.process_time_ns() - start)
    return np.maximum(np.array(spent) - clock, 1)

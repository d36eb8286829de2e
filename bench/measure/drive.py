"""Drives one backend through one log twice: once for the clock, once for its beliefs.

The timing pass calls only `step` and `finish`, so nothing can hide in a call that is not timed. The second pass, on a
fresh backend with the same randomness, also asks for the belief after every step; its path must be the same to the last
bit, or speed and accuracy would be those of two different runs. A repeat is a timing pass alone.
"""

import gc
import hashlib
import time
from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...backends.api import Backend, Belief, Builder, Calibration, Solution, TakenOut, TakesOut, WantsTruth
from ...backends.association.layer import Associating
from ...backends.locating.locating import begin
from ...core.factors import Log, Map, Step, Truth
from ...core.kernels import compiled
from ...core.se2 import Array, Ints
from ..process.clock import CLOCK, Meanwhile
from ..process.threads import one_thread
from .answers import (
    COV,
    POSE,
    Broken,
    check_again,
    check_believed,
    checked_assigned,
    checked_assigned_partial,
    checked_calibration,
    checked_covs,
    checked_map,
    checked_pose,
    checked_solution,
    finite,
    finite_cov,
    is_floats,
)

WARM_UP = 20
"""Steps that a separate backend runs through before the clock starts, so that most compilation and imports are over.
The timing pass is repeated if a compiled function of ours is first called after that."""


BLOCK = 10_000
"""Steps of a log that exist as objects at once: all of 10^6 steps take 1 GB."""


NO_CALIBRATION = Calibration()


class InBlocks:
    """The steps of a log, made as objects block by block between calls that are timed."""

    def __init__(self, log: Log) -> None:
        self._log = log

    def __len__(self) -> int:
        return len(self._log)

    def __iter__(self) -> Iterator[Step]:
        ahead = iter(self._log)
        while block := list(islice(ahead, BLOCK)):
            yield from block


class Steps(Protocol):
    """Some steps, whose number is known."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[Step]: ...


@dataclass(frozen=True, kw_only=True)
class Timing:
    """A timing pass. Where a backend has no online estimate `online` is None, and so on."""

    online: Array | None  # (n, 3)
    solution: Solution | None
    assigned: Ints | None = None  # (s,) the landmark it took every sighting for by the log's last step
    final_assigned: Ints | None = None  # (s,) once it had finished
    assigned_partial: Ints | None = None  # (p,) likewise of partial sightings
    final_assigned_partial: Ints | None = None  # (p,)
    calibration: Calibration = NO_CALIBRATION  # constant errors that it has estimated along the way
    taken_out: TakenOut | None = None  # landmarks that have moved, and misread sightings
    step_ns: Ints  # (n,) process CPU time, the clock's own cost taken off
    wall_ns: Ints  # (n,)
    setup_ns: int
    finish_ns: int
    clock_ns: int  # what was taken off each
    told: bool  # it was given the ground truth, and makes use of it
    meanwhile: Mapping[str, float] = field(default_factory=dict[str, float])  # the machine's state, by column


@dataclass(frozen=True, kw_only=True)
class Beliefs:
    """The beliefs after every step."""

    cov: Array  # (n, 3, 3), NaN where not known
    nis: Array  # (n,) NaN where there is none
    nis_dof: Ints  # (n,)
    n_eff: Array  # (n,) NaN where there are no particles
    ancestors: Array  # (n,) of the particles, NaN where there are none or they are not counted
    refused: Ints  # (n,) sightings and loop closures that a gate rejected
    located: NDArray[np.bool]  # (n,) False until an unknown start is found
    left_out: int = 0  # loop closures to poses that were no longer kept
    belief_ns: Ints  # (n,) CPU time of asking, the clock's cost taken off


@dataclass(frozen=True, kw_only=True)
class Outcome(Timing, Beliefs):
    """The estimates and costs of a backend on a log."""

    map: Map
    map_ns: int
    associate_ns: Ints | None = None  # (n,) CPU time of data association, part of step_ns
    tried: Ints | None = None  # (n,) pairs or nodes that data association has tried


def path_digest(timed: Timing) -> str:
    """The sha256 of the online path, and of the final path and map: the same for the same bits."""
    digest = hashlib.sha256()
    end = timed.solution
    for part in (timed.online, *(() if end is None else (end.path, end.map.ids, end.map.xy))):
        digest.update(b"none" if part is None else np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


def drive(
    builder: Builder, options: Any, log: Log, generator: Callable[[], np.random.Generator], truth: Truth | None = None
) -> Outcome:
    """Drives the backend through `log`; `generator` makes one in the same state every time it is called.

    A `truth` is given to a backend that asks for it, each time one is made, outside of what is timed. Raises Diverged
    where a number is not finite, Broken where the contract is not kept, and whatever the backend raises.
    """
    log = log if builder.associating(options) else log.identified()
    warm_up(builder, options, log, generator, truth)
    with one_thread():  # of what the warm-up has loaded, too
        return _driven(builder, options, log, generator, truth)


def _driven(
    builder: Builder, options: Any, log: Log, generator: Callable[[], np.random.Generator], truth: Truth | None
) -> Outcome:
    steps = InBlocks(log)
    timed = _timed(builder, options, log, steps, generator, truth)
    backend = begin(builder, log.prior, options, generator())
    _tell(backend, truth)
    if isinstance(backend, Associating):
        backend.timed = True
    beliefs = _belief_pass(backend, steps, timed)
    spent: dict[str, Any] = {}
    if isinstance(backend, Associating):
        spent = {"associate_ns": np.maximum(np.array(backend.ns) - timed.clock_ns, 0), "tried": np.array(backend.tried)}
    start = time.process_time_ns()
    found = backend.map()
    map_ns = time.process_time_ns() - start
    return Outcome(**vars(timed), **vars(beliefs), **spent, map=checked_map(found, "map()"), map_ns=map_ns)


def timed_again(
    builder: Builder, options: Any, log: Log, generator: Callable[[], np.random.Generator], truth: Truth | None = None
) -> Timing:
    """Repeats the timing pass of `drive`, and nothing else of it; raises as that does."""
    log = log if builder.associating(options) else log.identified()
    warm_up(builder, options, log, generator, truth)
    with one_thread():
        return _timed(builder, options, log, InBlocks(log), generator, truth)


def _timed(
    builder: Builder,
    options: Any,
    log: Log,
    steps: Steps,
    generator: Callable[[], np.random.Generator],
    truth: Truth | None,
) -> Timing:
    clock = CLOCK.cost()
    gc.collect()
    gc.disable()
    try:
        while True:
            ready, machine = compiled.ready(), Meanwhile()
            start = time.process_time_ns()
            backend = begin(builder, log.prior, options, generator())
            setup_ns = time.process_time_ns() - start
            told = _tell(backend, truth)
            online, step_ns, wall_ns = timing_pass(backend, steps)
            assigned, of_parts = checked_assigned(backend, log), checked_assigned_partial(backend, log)
            start = time.process_time_ns()
            finished = backend.finish()
            finish_ns = time.process_time_ns() - start
            meanwhile = machine.columns()
            if ready == compiled.ready():  # else a later part of the log needed new code
                break
    finally:
        gc.enable()
    solution = checked_solution(finished, len(steps))
    return Timing(
        online=online,
        solution=solution,
        assigned=assigned,
        final_assigned=None if solution is None else checked_assigned(backend, log),
        assigned_partial=of_parts,
        final_assigned_partial=None if solution is None else checked_assigned_partial(backend, log),
        calibration=checked_calibration(backend),
        taken_out=backend.taken_out() if isinstance(backend, TakesOut) else None,
        step_ns=np.maximum(step_ns - clock, 0),
        wall_ns=np.maximum(wall_ns - clock, 0),
        setup_ns=setup_ns,
        finish_ns=finish_ns,
        clock_ns=clock,
        told=told,
        meanwhile=meanwhile,
    )


def _tell(backend: Backend, truth: Truth | None) -> bool:
    """Gives the backend the ground truth, if there is one and it asks for it; returns True if it makes use of it."""
    return truth is not None and isinstance(backend, WantsTruth) and backend.tell(truth)


def warm_up(
    builder: Builder, options: Any, log: Log, generator: Callable[[], np.random.Generator], truth: Truth | None = None
) -> None:
    """Takes a separate backend through the log's first steps, every method once."""
    backend = begin(builder, log.prior, options, generator())
    _tell(backend, truth)
    for step in islice(log if builder.associating(options) else log.identified(), WARM_UP):
        backend.step(step)
    backend.belief()
    backend.map()
    backend.finish()


def timing_pass(backend: Backend, steps: Steps) -> tuple[Array | None, Ints, Ints]:
    """The online path (n, 3), and each step's CPU and wall time in ns."""
    poses = bytearray()
    cpu, wall = (array("q", bytes(8 * len(steps))) for _ in range(2))
    cpu_clock, wall_clock = time.process_time_ns, time.perf_counter_ns
    for k, step in enumerate(steps):
        cpu_start = cpu_clock()
        wall_start = wall_clock()
        pose = backend.step(step)
        wall_end = wall_clock()
        cpu[k] = cpu_clock() - cpu_start
        wall[k] = wall_end - wall_start
        if pose is not None:
            poses += checked_pose(pose, k)
    times = np.frombuffer(cpu, np.int64), np.frombuffer(wall, np.int64)
    online = np.frombuffer(poses).reshape(-1, *POSE)
    if len(online) not in (0, len(steps)):
        raise Broken("step() returned a pose at some steps and None at others, expected one or the other throughout")
    return (online if len(online) else None, *times)


def _belief_pass(backend: Backend, steps: Steps, timed: Timing) -> Beliefs:
    """Asks for the belief after every step; Broken where asking has changed the path."""
    online = timed.online
    n, clock = len(steps), time.process_time_ns
    nis, n_eff, ancestors = (array("d", [np.nan]) * n for _ in range(3))
    ns, nis_dof, refused = (array("q", bytes(8 * n)) for _ in range(3))
    located, left_out = bytearray(b"\1") * n, 0
    path = b"" if online is None else online.tobytes()
    known, covs, believed, poses = array("q"), bytearray(), array("q"), bytearray()
    try:
        for k, step in enumerate(steps):
            pose = backend.step(step)
            if not (is_floats(pose, POSE) and pose.tobytes() == path[24 * k : 24 * k + 24]):
                check_again(pose, online, k)
            start = clock()
            belief = backend.belief()
            ns[k] = clock() - start
            if belief is None:
                continue
            if not isinstance(belief, Belief):  # pyright: ignore[reportUnnecessaryIsInstance] - a backend may return anything
                raise Broken(f"belief() returned {type(belief).__name__} at step {k}, expected Belief or None")
            place, cov, k_nis, nis_dof[k], k_n_eff, k_ancestors, refused[k], _, found, lost = belief
            located[k], left_out = bool(found), left_out + lost
            nis[k], n_eff[k], ancestors[k] = (
                np.nan if value is None else value for value in (k_nis, k_n_eff, k_ancestors)
            )
            poses += (
                place if is_floats(place, POSE) else finite(place, POSE, f"step {k}: the belief's pose")
            ).tobytes()
            believed.append(k)
            if cov is not None:
                covs += (cov if is_floats(cov, COV) else finite_cov(cov, k)).tobytes()
                known.append(k)
    finally:  # what is not finite was there before any error
        all_covs = checked_covs(covs, known, n)
    check_believed(np.frombuffer(poses).reshape(-1, *POSE), believed, online)
    return Beliefs(
        cov=all_covs,
        nis=np.frombuffer(nis, np.float64),
        nis_dof=np.frombuffer(nis_dof, np.int64),
        n_eff=np.frombuffer(n_eff, np.float64),
        ancestors=np.frombuffer(ancestors, np.float64),
        refused=np.frombuffer(refused, np.int64),
        located=np.frombuffer(located, np.bool),
        left_out=left_out,
        belief_ns=np.maximum(np.frombuffer(ns, np.int64) - timed.clock_ns, 0),
    )

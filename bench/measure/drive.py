"""Drives one backend through one log twice: once for the clock, once for its beliefs.

The timing pass calls only `step` and `finish`, so nothing can hide in a call that is not timed. The second pass, on a
fresh backend with the same randomness, also asks for the belief after every step; its path must be the same to the last
bit, or speed and accuracy would be those of two different runs.
"""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from ...backends.api import Backend, Belief, Builder, Diverged, Solution, WantsTruth
from ...frontend import compiled
from ...frontend.errors import SlamduelError
from ...frontend.factors import Log, Map, Step, Truth
from ...frontend.se2 import Array, Ints
from .clock import CLOCK

FARTHEST = 1e9  # m from the origin: more than any coordinates on Earth, national grids included

WARM_UP = 20
"""Steps that a separate backend runs through before the clock starts, so that most compilation and imports are over.
The timing pass is repeated if a compiled function of ours is first called after that."""

_POSE, _COV = (3,), (3, 3)
_FLOAT = np.dtype(np.float64)


class Broken(SlamduelError):
    """A backend broke the contract: what it returned, and what was expected."""


@dataclass(frozen=True)
class Outcome:
    """The estimates and costs of a backend on a log. Where it has no online estimate `online` is None, and so on."""

    online: Array | None  # (n, 3)
    cov: Array  # (n, 3, 3), NaN where not known
    nis: Array  # (n,) NaN where there is none
    nis_dof: Ints  # (n,)
    n_eff: Array  # (n,) NaN where there are no particles
    ancestors: Array  # (n,) of the particles, NaN where there are none or they are not counted
    refused: Ints  # (n,) sightings that a gate rejected
    map: Map
    solution: Solution | None
    step_ns: Ints  # (n,) process CPU time, the clock's own cost taken off
    wall_ns: Ints  # (n,)
    belief_ns: Ints  # (n,)
    map_ns: int
    setup_ns: int
    finish_ns: int
    clock_ns: int  # what was taken off each
    told: bool  # it was given the ground truth, and makes use of it


def drive(
    builder: Builder, options: Any, log: Log, generator: Callable[[], np.random.Generator], truth: Truth | None = None
) -> Outcome:
    """Drives the backend through `log`; `generator` makes one in the same state every time it is called.

    A `truth` is given to a backend that asks for it, each time one is made, outside of what is timed. Raises Diverged
    where a number is not finite, Broken where the contract is not kept, and whatever the backend raises.
    """
    log = log if builder.associates else log.identified()
    steps = list(log)
    warm_up(builder, options, log, generator, truth)
    clock = CLOCK.cost()

    gc.collect()
    gc.disable()
    try:
        while True:
            ready = compiled.ready()
            start = time.process_time_ns()
            backend = builder.make(log.prior, options, generator())
            setup_ns = time.process_time_ns() - start
            told = _tell(backend, truth)
            online, step_ns, wall_ns = timing_pass(backend, steps)
            start = time.process_time_ns()
            finished = backend.finish()
            finish_ns = time.process_time_ns() - start
            if ready == compiled.ready():  # else a later part of the log needed new code
                break
    finally:
        gc.enable()
    solution = _checked_solution(finished, len(steps))
    del backend, finished

    backend = builder.make(log.prior, options, generator())
    _tell(backend, truth)
    beliefs = _belief_pass(backend, steps, online)
    start = time.process_time_ns()
    found = backend.map()
    map_ns = time.process_time_ns() - start
    return Outcome(
        online=online,
        cov=beliefs.cov,
        nis=beliefs.nis,
        nis_dof=beliefs.nis_dof,
        n_eff=beliefs.n_eff,
        ancestors=beliefs.ancestors,
        refused=beliefs.refused,
        map=_checked_map(found, "map()"),
        solution=solution,
        step_ns=np.maximum(step_ns - clock, 0),
        wall_ns=np.maximum(wall_ns - clock, 0),
        belief_ns=np.maximum(beliefs.ns - clock, 0),
        map_ns=map_ns,
        setup_ns=setup_ns,
        finish_ns=finish_ns,
        clock_ns=clock,
        told=told,
    )


def _tell(backend: Backend, truth: Truth | None) -> bool:
    """Gives the backend the ground truth, if there is one and it asks for it; returns True if it makes use of it."""
    return truth is not None and isinstance(backend, WantsTruth) and backend.tell(truth)


def warm_up(
    builder: Builder,
    options: Any,
    log: Log,
    generator: Callable[[], np.random.Generator],
    truth: Truth | None = None,
) -> None:
    """Takes a separate backend through the log's first steps, every method once."""
    backend = builder.make(log.prior, options, generator())
    _tell(backend, truth)
    for step in islice(log if builder.associates else log.identified(), WARM_UP):
        backend.step(step)
    backend.belief()
    backend.map()
    backend.finish()


def timing_pass(backend: Backend, steps: list[Step]) -> tuple[Array | None, Ints, Ints]:
    """Returns the online path (n, 3), and each step's CPU and wall time in ns."""
    poses = bytearray()
    cpu, wall = [0] * len(steps), [0] * len(steps)
    cpu_clock, wall_clock = time.process_time_ns, time.perf_counter_ns
    for k, step in enumerate(steps):
        cpu_start = cpu_clock()
        wall_start = wall_clock()
        pose = backend.step(step)
        wall_end = wall_clock()
        cpu[k] = cpu_clock() - cpu_start
        wall[k] = wall_end - wall_start
        if pose is not None:
            poses += _pose(pose, k)
    times = np.array(cpu, np.int64), np.array(wall, np.int64)
    online = np.frombuffer(poses).reshape(-1, *_POSE)
    if len(online) not in (0, len(steps)):
        raise Broken("step() returned a pose at some steps and None at others, expected one or the other throughout")
    return (online if len(online) else None, *times)


class _Beliefs(NamedTuple):
    cov: Array
    nis: Array
    nis_dof: Ints
    n_eff: Array
    ancestors: Array
    refused: Ints
    ns: Ints  # CPU time of asking


def _belief_pass(backend: Backend, steps: list[Step], online: Array | None) -> _Beliefs:
    """Returns the belief after every step; Broken where asking has changed the path."""
    n, clock, ns = len(steps), time.process_time_ns, [0] * len(steps)
    nis, n_eff, ancestors = (list[Any]([None]) * n for _ in range(3))
    nis_dof, refused = [0] * n, [0] * n
    path = b"" if online is None else online.tobytes()
    known, covs = list[int](), bytearray()
    try:
        for k, step in enumerate(steps):
            pose = backend.step(step)
            if not (_is_floats(pose, _POSE) and pose.tobytes() == path[24 * k : 24 * k + 24]):
                _check_again(pose, online, k)
            start = clock()
            belief = backend.belief()
            ns[k] = clock() - start
            if belief is None:
                continue
            if not isinstance(belief, Belief):  # pyright: ignore[reportUnnecessaryIsInstance] - a backend may return anything
                raise Broken(f"belief() returned {type(belief).__name__} at step {k}, expected Belief or None")
            _, cov, nis[k], nis_dof[k], n_eff[k], ancestors[k], refused[k], _ = belief
            if cov is not None:
                covs += (cov if _is_floats(cov, _COV) else _finite_cov(cov, k)).tobytes()
                known.append(k)
    finally:  # what is not finite was there before any error
        found = _covariances(covs, known, n)
    return _Beliefs(
        cov=found,
        nis=np.array(nis, np.float64).reshape(n),
        nis_dof=np.array(nis_dof, np.int64).reshape(n),
        n_eff=np.array([np.nan if value is None else value for value in n_eff]),
        ancestors=np.array([np.nan if value is None else value for value in ancestors]),
        refused=np.array(refused, np.int64).reshape(n),
        ns=np.array(ns, np.int64),
    )


def _pose(pose: Any, k: int) -> bytes:
    """Copies what step() returned at step k, after a check that is cheap where it passes."""
    if _is_floats(pose, _POSE):
        x, y, heading = pose.tolist()
        if -FARTHEST <= x <= FARTHEST and -FARTHEST <= y <= FARTHEST and isfinite(heading):
            return pose.tobytes()
    return _on_earth(pose, _POSE, f"step {k}: the pose").tobytes()


def _check_again(pose: Any, online: Array | None, k: int) -> None:
    """Raises Broken unless the pose, if there is one, is the same as without asking for beliefs."""
    again = None if pose is None else np.frombuffer(_pose(pose, k))
    if online is not None and (again is None or again.tobytes() != online[k].tobytes()):
        raise Broken(f"step {k}: the path differs once beliefs are asked for: {again}, expected {online[k]}")


def _covariances(covs: bytearray, known: Sequence[int], n: int) -> Array:
    """Returns (n, 3, 3) from the bytes of those that are known, at these steps; Diverged names the first not finite."""
    cov, found = np.full((n, *_COV), np.nan), np.frombuffer(covs).reshape(-1, *_COV)
    for row in np.flatnonzero(~np.isfinite(found).all(axis=(1, 2)))[:1]:
        _finite_cov(found[row], known[row])
    cov[known] = found
    return cov


def _is_floats(values: Any, shape: tuple[int, ...]) -> TypeGuard[Array]:
    return type(values) is np.ndarray and values.shape == shape and values.dtype is _FLOAT


def _checked_solution(solution: Any, n: int) -> Solution | None:
    if solution is None:
        return None
    if not isinstance(solution, Solution):
        raise Broken(f"finish() returned {type(solution).__name__}, expected Solution or None")
    path = _on_earth(solution.path, (n, 3), "finish(): the path")
    return solution._replace(path=path, map=_checked_map(solution.map, "finish()"))


def _checked_map(found: Any, where: str) -> Map:
    if not isinstance(found, Map):
        raise Broken(f"{where} returned {type(found).__name__} for a map, expected Map")
    n = len(found.ids)
    cov = None if found.cov is None else _finite(found.cov, (2 * n, 2 * n), f"{where}: the map's covariance")
    return Map(np.array(found.ids, np.int64), _finite(found.xy, (n, 2), f"{where}: the map"), cov)


def _on_earth(poses: Any, shape: tuple[int, ...], what: str) -> Array:
    """Checks as `_finite`, for poses: beyond `FARTHEST` the numbers mean nothing any more."""
    found = _finite(poses, shape, what)
    far = float(np.abs(found[..., :2]).max(initial=0.0))
    if far > FARTHEST:
        raise Diverged(f"{what} is {far:.1e} m from the origin, farther than the {FARTHEST:.0e} m of any log")
    return found


def _finite_cov(cov: Any, k: int) -> Array:
    return _finite(cov, _COV, f"step {k}: the belief's covariance")


def _finite(values: Any, shape: tuple[int, ...], what: str) -> Array:
    """Copies `values`; Broken unless of that shape, Diverged unless finite."""
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise Broken(f"{what} is {type(values).__name__}, expected an array of floats of shape {shape}") from None
    if array.shape != shape:
        raise Broken(f"{what} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        raise Diverged(f"{what} is not finite: {array if array.size <= 9 else 'an array'}")
    return array

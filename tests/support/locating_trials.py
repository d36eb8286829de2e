"""Robots that start anywhere in a log, without ids, on a given map, or are carried elsewhere: are they found?

    python tests/support/locating_trials.py 200

(`make study-locating`) prints, for so many starts over six maps, how often `locate` and `mcl` are right, wrong or
silent at the first pose that they are sure of; how often they are sure of one on as many maps of other worlds, where
there is nothing to be found; and how soon a robot is found again that was carried elsewhere. The exit status is 1 where
`locate` is right less than 95 times in a hundred, or ever wrong, or speaks on the map of another world, or takes more
than 0.1 s of CPU time to look once, or the robot is found again within 20 steps less than 95 times in a hundred.
"""

import gc
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

import slamduel
from lost_logs import MAP_SD, astray, surveyed, unnamed
from slamduel.backends.api import Backend
from slamduel.backends.locating.locating import begin
from slamduel.backends.registry import find
from slamduel.bench.measure.drive import drive
from slamduel.bench.plan.reference import known as referenced
from slamduel.core.factors import Log, Map, Truth
from slamduel.core.se2 import Array
from slamduel.datasets.on_map import elsewhere

RAW = "victoria-park-raw"
MAPS = {
    "circle[steps=400,landmarks=80,sighting=0.05,odometry=0.02]": MAP_SD,
    "city[landmarks=200]": MAP_SD,
    "victoria-park": 0.3,
    "aruco-room": MAP_SD,
    "aruco-robot": MAP_SD,
    "bailey": MAP_SD,
}
"""Standard deviation of a landmark, m, by the log; that of the park's is of its batch optimum, the map itself."""
WORLDS = {"circle[steps=400,landmarks=80,sighting=0.05,odometry=0.02": 120, "city[landmarks=200,steps=600": 100}
"""Time, s, at which the robot is carried elsewhere in these worlds."""
STEADY = 128
"""Steps with sightings after which `mcl` is asked again."""
LONGEST = 400
"""Steps with sightings after which it is given up: three times as many as a robot is looked for by at once."""
PARTICLES = 10_000
FOUND_AGAIN = 20
"""Steps in which a robot that was carried elsewhere is found again."""
AFTER = 60
"""Steps after that at which it is still looked at."""


class Trial(NamedTuple):
    """A log without ids, its map, and steps from which a robot is looked for."""

    log: Log
    truth: Truth
    given: Map
    starts: list[int]


class Ended(NamedTuple):
    """The end of a search."""

    said: str  # right, wrong, silent: at the first pose that is said to be located
    steps: int  # until then
    seeing: int  # of these, with sightings
    cpu: float  # s, until then
    slowest: float  # s, of a step
    later: str  # right, wrong, silent: after STEADY steps with sightings; "" before


def trial(name: str, starts: int = 24) -> Trial:
    """Makes the log of that name; starts are drawn from those of its steps whose truth is known."""
    if name == RAW:
        return _raw_park(starts)
    log, truth = slamduel.load(name)
    truth = referenced(log, truth)
    assert truth is not None
    assert truth.map is not None
    return _drawn(unnamed(log), truth, surveyed(truth.map, MAPS[name]), starts)


def search(name: str, made: Trial, start: int, given: Map | None = None, *, later: bool = False) -> Ended:
    """Gives a backend the steps from a start on until it is sure of a pose, and with `later` the STEADY first ones."""
    log, truth, known = made.log, made.truth, given or made.given
    builder = find(name)
    options = builder.options(particles=PARTICLES) if name == "mcl" else builder.options()
    backend = begin(builder, log.prior._replace(map=known, start="unknown"), options, np.random.default_rng(start))
    said = steady = ""
    steps = seeing = first = 0
    spent = [0.0]
    gc.collect()
    for k in range(start, len(log)):
        step = log[k] if k > start else log[k]._replace(odometry=None)
        seeing += bool(len(step.sightings.ids))
        began = time.process_time()
        pose, belief = backend.step(step), backend.belief()
        assert pose is not None
        row = int(np.searchsorted(truth.t, log.t[k]))
        true = truth.poses[row] if truth.t[min(row, len(truth.t) - 1)] == log.t[k] else None
        verdict = "silent"
        if belief.located and true is not None:
            verdict = "wrong" if given is not None or astray(pose, true, known) else "right"
        if not steps:
            spent.append(time.process_time() - began)
        if belief.located and not steps:
            steps, first = k - start + 1, seeing
        if steps and not said and true is not None:
            said = verdict
        if later and seeing == STEADY and true is not None:
            steady = steady or verdict
        if seeing >= LONGEST or (said and (steady or not later)):
            break
    return Ended(said or "silent", steps, first, sum(spent), max(spent), steady)


def another(known: Map, seed: int) -> Map:
    """Makes the map of another world that is built as this one."""
    return known._replace(xy=elsewhere(known.xy, np.random.default_rng(seed).standard_normal(known.xy.shape)))


def found_again(world: str, seed: int, *, ids: bool) -> int | None:
    """Returns the steps in which a robot that is carried elsewhere is found again, and stays so; None: is not.

    Its start is not known either.
    """
    at = WORLDS[world]
    log, truth = slamduel.load(f"{world},kidnap={at}{'' if ids else ',ids=hidden'}]", seed=seed)
    assert truth is not None
    assert truth.map is not None
    given = surveyed(truth.map)
    leaves: int = log.notes["faults"]["kidnapped at step"]
    builder = find("ekf")
    options = builder.options() if ids else builder.options(association="jcbb")
    lost = replace(log, prior=log.prior._replace(map=given, start="unknown"))
    backend = begin(builder, lost.prior, options, np.random.default_rng(seed))
    right = np.array([_follows(backend, lost, truth, given, k) for k in range(min(len(log), leaves + AFTER))])
    if not right[leaves - 1]:
        return None
    missed = np.flatnonzero(~right[leaves:])
    taken = int(missed[-1]) + 1 if len(missed) else 0
    return taken if taken <= FOUND_AGAIN else None


def _follows(backend: Backend, log: Log, truth: Truth, given: Map, k: int) -> bool:
    pose, belief = backend.step(log[k]), backend.belief()
    return pose is not None and belief is not None and belief.located and not astray(pose, truth.poses[k], given)


def _drawn(log: Log, truth: Truth, given: Map, starts: int) -> Trial:
    known = np.flatnonzero(np.isin(log.t, truth.t) & (np.arange(len(log)) < 0.8 * len(log)))
    return Trial(log, truth, given, np.random.default_rng(3).choice(known, starts).tolist())


@cache
def _smoothed_park() -> tuple[Log, Array, Map]:
    data = os.environ.get("SLAMDUEL_DATA")
    log, _ = slamduel.load(f"{RAW}[path={Path(data) / 'victoria_park_raw'}]" if data else RAW)
    builder = find("smoother")
    options = builder.options(association="jcbb", confirm=3)
    solution = drive(builder, options, log, lambda: np.random.default_rng(0)).solution
    return log, solution.path, solution.map


def _raw_park(starts: int) -> Trial:
    """The park as recorded, on the map that smoothing makes of it: where that puts the robot counts as true."""
    log, path, given = _smoothed_park()
    return _drawn(log, Truth(log.t, path, given, kind="reference"), given, starts)


def table(names: Iterable[str], starts: int, show: Callable[[str], None]) -> bool:
    """Shows a row for each map and method; returns False where `locate` is not as it must be."""
    good = True
    for name in names:
        made = trial(name, starts)
        others = [another(made.given, seed) for seed in range(starts)]
        for method, backend in (("locate", "dead-reckoning"), ("mcl", "mcl")):
            search(backend, made, made.starts[0])  # compiles
            ended = [search(backend, made, start, later=method == "mcl") for start in made.starts]
            strange = [search(backend, made, start, on) for start, on in zip(made.starts, others, strict=True)]
            show(f"{name:60} {len(made.given.ids):4} landmarks {method:6} {_words(ended)}; {_spoke(strange)}")
            if method == "locate":
                right = sum(one.said == "right" for one in ended)
                wrong = any(one.said == "wrong" for one in ended + strange)
                good &= not wrong and right >= 0.95 * starts and max(one.slowest for one in ended + strange) <= 0.1
    return good


def again(drives: int, show: Callable[[str], None]) -> bool:
    """Shows how soon a robot is found again that was carried elsewhere; returns False where that is too seldom."""
    good = True
    for ids in (True, False):
        for world, at in WORLDS.items():
            taken = [found_again(world, seed, ids=ids) for seed in range(drives // len(WORLDS))]
            found = [steps for steps in taken if steps is not None]
            show(
                f"{world},kidnap={at}], ids {'known' if ids else 'hidden'}: found again within {FOUND_AGAIN} steps "
                f"{len(found)} of {len(taken)}, median {np.median(found or [np.nan]):g}, most {max(found, default=0)}"
            )
            good &= len(found) >= 0.95 * len(taken)
    return good


def _words(ended: Sequence[Ended]) -> str:
    sure = [one for one in ended if one.steps] or list(ended)
    steps, seeing = np.median([(one.steps, one.seeing) for one in sure], axis=0)
    cpu = np.median([one.cpu for one in sure])
    words = f"{_counts([one.said for one in ended])}, after {steps:3g} steps, {seeing:3g} with sightings, "
    words += f"{1e3 * cpu:4.0f} ms, a step {1e3 * max(one.slowest for one in ended):3.0f} ms"
    later = [one.later for one in ended if one.later]
    return f"{words}; after {STEADY}: {_counts(later)}" if later else words


def _counts(said: list[str]) -> str:
    return " ".join(f"{verdict} {said.count(verdict):3}" for verdict in ("right", "wrong", "silent"))


def _spoke(strange: Sequence[Ended]) -> str:
    spoke = sum(one.said != "silent" for one in strange)
    slowest = 1e3 * max(one.slowest for one in strange)
    return f"on other worlds' maps sure of a pose {spoke} of {len(strange)}, a step {slowest:3.0f} ms"


def main() -> int:
    """Prints the tables; 1 where something is missed.

    Garbage is collected between searches, as `bench run` does: within a step it would count as part of it.
    """
    gc.disable()
    many = int(sys.argv[1])
    names = sys.argv[2:] or [*MAPS, RAW]
    good = table(names, -(-many // len(MAPS)), lambda line: print(line, flush=True))
    return 0 if again(many // 2, lambda line: print(line, flush=True)) and good else 1


if __name__ == "__main__":
    sys.exit(main())

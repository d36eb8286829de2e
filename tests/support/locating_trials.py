"""Starts anywhere in a log, without ids, on a given map: how often `locate` and `mcl` are right, wrong, or silent.

    python tests/support/locating_trials.py

prints a row for each map. The steps grow until a robot is found, up to 128 with sightings (as `Locating` holds).
"""

import sys
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

import slamduel
from lost_logs import astray, surveyed, unnamed
from slamduel.backends.locating.locate import locate
from slamduel.backends.locating.locating import WINDOW
from slamduel.backends.locating.map_index import MapIndex
from slamduel.backends.registry import find
from slamduel.bench.plan.reference import known as referenced
from slamduel.frontend.factors import Log, Map, Step, Truth

MAPS = {
    "circle[steps=400,landmarks=80,sighting=0.05,odometry=0.02]": 0.01,
    "city[landmarks=200]": 0.01,
    "victoria-park": 0.3,
    "aruco-room": 0.01,
    "aruco-robot": 0.01,
    "bailey": 0.01,
}
"""Standard deviation of a landmark, m, by the log. The park's is that of its batch optimum, the map itself."""
SIZES = (1, 2, 4, 8, 16, 24, 32, 40, 48, 64, 96, WINDOW)
"""Steps with sightings after which a robot is looked for."""


class Tally(NamedTuple):
    """Shares of the starts, and CPU times."""

    right: float
    wrong: float
    silent: float
    steps: float  # with sightings, median of those found
    slowest: float  # s, CPU time of looking once
    whole: float  # s, CPU time of a start, median


class Trial(NamedTuple):
    """A log without ids, its map, and where each of its steps that may be a start is."""

    log: Log
    truth: Truth
    given: Map
    starts: list[int]


def trial(name: str, starts: int = 24, seed: int = 0) -> Trial:
    """Makes the log of that name; starts are drawn from those steps whose truth is known."""
    log, truth = slamduel.load(name, seed=seed)
    truth = referenced(log, truth)
    assert truth is not None
    assert truth.map is not None
    given = surveyed(truth.map, MAPS.get(name, 0.01))
    known = np.flatnonzero(np.isin(log.t, truth.t) & (np.arange(len(log)) < 0.8 * len(log)))
    rng = np.random.default_rng(3)
    return Trial(unnamed(log), truth, given, rng.choice(known, starts).tolist())


def located(made: Trial, on: Map | None = None) -> Tally:
    """Looks for the robot by `locate` from every start, on another map where one is given."""
    index = MapIndex.of(made.given if on is None else on)
    said, steps, once, whole = list[str](), list[int](), [0.0], list[float]()
    locate(next(iter(windows(made.log, 0))), index)  # compiles
    for start in made.starts:
        verdict, spent = "silent", 0.0
        for size, held in zip(SIZES, windows(made.log, start), strict=False):
            began = time.process_time()
            fix = locate(held, index)
            once.append(time.process_time() - began)
            spent += once[-1]
            if fix is not None:
                true = made.truth.poses[np.searchsorted(made.truth.t, held[0].t)]
                verdict = "wrong" if astray(fix.pose, true, made.given) else "right"
                steps.append(size)
                break
        said.append(verdict)
        whole.append(spent)
    return _tally(said, steps, max(once), whole)


def monte_carlo(made: Trial, particles: int = 10_000) -> Tally:
    """Looks for the robot by `mcl`, and asks at the end of the longest window."""
    builder = find("mcl")
    prior = made.log.prior._replace(map=made.given, start="unknown")
    said, steps, whole, slowest = list[str](), list[int](), list[float](), 0.0
    for start in made.starts:
        backend = builder.make(prior, builder.options(particles=particles), np.random.default_rng(start))
        *_, held = windows(made.log, start)
        began, first, seeing, belief = time.process_time(), 0, 0, None
        for step in held:
            before = time.process_time()
            backend.step(step)
            slowest = max(slowest, time.process_time() - before)
            seeing += bool(len(step.sightings.ids))
            belief = backend.belief()
            first = first or seeing * bool(belief is not None and belief.located)
        whole.append(time.process_time() - began)
        true = made.truth.poses[np.searchsorted(made.truth.t, held[-1].t)]
        assert belief is not None
        found = "wrong" if astray(belief.pose, true, made.given) else "right"
        said.append(found if belief.located else "silent")
        steps += [first] * (said[-1] == "right")
    return _tally(said, steps, slowest, whole)


def windows(log: Log, start: int) -> Iterable[list[Step]]:
    """Yields the steps from a start on, up to as many with sightings as each of `SIZES`."""
    held, seeing = list[Step](), 0
    for k in range(start, len(log)):
        step = log[k]
        if not held and not len(step.sightings.ids):
            continue
        held.append(step if held else step._replace(odometry=None))
        seeing += bool(len(step.sightings.ids))
        if seeing in SIZES and len(step.sightings.ids):
            yield list(held)
        if seeing == SIZES[-1]:
            return


def _tally(said: list[str], steps: list[int], slowest: float, whole: list[float]) -> Tally:
    share = {verdict: said.count(verdict) / len(said) for verdict in ("right", "wrong", "silent")}
    return Tally(**share, steps=float(np.median(steps or [0])), slowest=slowest, whole=float(np.median(whole)))


def main() -> None:
    """Prints the table."""
    for name in sys.argv[1:] or MAPS:
        made = trial(name)
        for method, found in {"locate": located(made), "mcl": monte_carlo(made)}.items():
            print(
                f"{name:60} {len(made.given.ids):4} landmarks {method:6} right {100 * found.right:3.0f} % wrong "
                f"{100 * found.wrong:3.0f} % silent {100 * found.silent:3.0f} % steps {found.steps:3.0f} "
                f"once {1e3 * found.slowest:5.1f} ms, a start {1e3 * found.whole:6.1f} ms",
                flush=True,
            )


if __name__ == "__main__":
    main()

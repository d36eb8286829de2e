"""The settings of the front ends and of the smoother, each halved and doubled: what does that change?

    SLAMDUEL_DATA=... python tests/support/settings_trials.py laser depth smoother

(`make study-settings`) prints a table of docs/settings.md for each part named. Errors are ratios to those with the
settings as they are, which the first row has. A number in a settings class is varied by a class that has another one;
one of a module in the module, whose inner loops are then compiled again. A share above a half is varied by what it
lacks to 1. It takes half an hour on one core.
"""

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba import njit

from depth_drives import drive
from redkitchen import FOLDER, judged
from slamduel.backends.incremental import smoother
from slamduel.backends.smoothing import forest
from slamduel.bench.front_ends.consistency import compared, errors
from slamduel.bench.measure.accuracy import align, aligned, ate
from slamduel.bench.plan.load import made, one
from slamduel.core.factors import Log, Truth
from slamduel.core.se2 import Array
from slamduel.datasets.formats import carmen
from slamduel.datasets.formats.relations import beside, read_relations, related
from slamduel.datasets.worlds import depth_room, laser_floor
from slamduel.frontend.depth import level
from slamduel.frontend.depth.log import log_of, looked_at
from slamduel.frontend.depth.settings import Settings as DepthSettings
from slamduel.frontend.laser import _matching
from slamduel.frontend.laser.recording import LaserRecording, matched
from slamduel.frontend.laser.settings import Settings as LaserSettings

INTEL = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "lidar" / "intel.clf.gz"

SHARES = {"lost", "replaced", "score", "inside", "ratio", "agree"}
"""Settings that are varied by what they lack to 1."""

FALSE_TURN = {0.2: math.radians(1), 0.1: math.radians(2)}
"""By the distance from the truth, m, beyond which a loop is false: the turn from it, rad, beyond which it is, too."""

LOGS = ("victoria-park", "bailey", "city[landmarks=1000,steps=5000]")

MATCHING = (
    *("LINE", "LONG", "THIN", "POINT_SD", "INSIDE", "HITS", "SOFT"),
    *("EARLY", "MIDDLE", "NEARER", "NEAREST", "CLOSER", "CLOSEST", "ACROSS"),
)
LEVEL = ("EVERY", "FAR", "HEIGHT", "SLOPE", "LEAST", "STEEPEST", "UP", "DRAWS")
"""Constants of modules that are varied, too."""

Figures = dict[str, float]
"""By column; those in ABSOLUTE as they are, the others as ratios."""

ABSOLUTE = {"NEES", "lost", "false"}


def values(name: str, value: float) -> tuple[float, float]:
    """The two other values of a number."""
    if name in SHARES:
        return 1 - 2 * (1 - value), 1 - (1 - value) / 2
    return (max(1, value // 2) if isinstance(value, int) else value / 2), 2 * value


def numbers(owner: Any, names: Iterable[str]) -> dict[str, float]:
    """The numbers of a class or a module, by name."""
    found = {name: getattr(owner, name) for name in names if not name.startswith("_")}
    return {name: x for name, x in found.items() if type(x) in (int, float) and x != 0}


def with_setting(settings: type, name: str, value: float, **options: Any) -> Any:
    """An instance in which one number is another one."""
    if name in {one.name for one in fields(settings)}:
        return settings(**(options | {name: value}))
    return type("Settings", (settings,), {name: value})(**options)


@contextlib.contextmanager
def changed(module: ModuleType, name: str, value: Any) -> Generator[None]:
    """Gives a constant of a module another value; inner loops of the module are compiled again, with it."""
    places = [one for key, one in sys.modules.items() if key.startswith("slamduel")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, name, value)
        for key, loop in list(vars(module).items()):
            if getattr(loop, "__module__", "") == module.__name__ and hasattr(loop, "py_func"):
                new = njit(error_model="numpy")(loop.py_func)
                for place in places:
                    if getattr(place, key, None) is loop:
                        patch.setattr(place, key, new)
        yield


def error(path: Array, true: Array) -> float:
    """The RMSE of position, m, after alignment."""
    path = np.asarray(path)
    return ate(aligned(align(path, true), path), true)


def compared_with(true: Array, motions: Sequence[Any], loops: Iterable[tuple[Any, int, int]], far: float) -> Figures:
    """Motions between neighbours and loops, each a motion to a step from an earlier one, by the true poses."""
    off = errors(np.array([one.delta for one in motions]), true[:-1], true[1:])
    found = {"motions": float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean()))}
    found["NEES"] = compared("", off, np.array([one.cov for one in motions])).nees
    apart = [errors(one.delta[None], true[[to]], true[[step]])[0] for one, to, step in loops]
    false = sum(bool(np.hypot(e[0], e[1]) > far or abs(e[2]) > FALSE_TURN[far]) for e in apart)
    return found | {"loops": len(apart), "false": false}


# laser


@cache
def floor() -> tuple[LaserRecording, Truth]:
    return laser_floor.record(laser_floor.Options(laps=1.15, scan_rate=3.0), np.random.default_rng(0))


@cache
def scans() -> LaserRecording:
    """The first thousand of the recorded log."""
    whole, _ = carmen.read(INTEL, carmen.Options())
    odometry = None if whole.odometry is None else whole.odometry[:1000]
    return replace(whole, t=whole.t[:1000], ranges=whole.ranges[:1000], odometry=odometry)


def laser_figures(settings: LaserSettings) -> Figures:
    """Errors on a made-up floor, and of a recorded log by its relations."""
    recording, truth = floor()
    end = matched(recording, settings)
    true = truth.poses[[step.scan for step in end.steps]]
    found = compared_with(true, end.steps[1:], [(one, one.to, one.step) for one in end.loops], 0.2)
    found = {"floor": error(end.estimate, true)} | {name: x for name, x in found.items() if name != "motions"}
    end = matched(scans(), settings)
    truth, _ = related(read_relations(beside(INTEL)), end)
    return found | {"intel": float(truth.relations.judged().errors(np.array(end.estimate))[:, 0].mean())}


# depth


@cache
def room() -> tuple[Any, Any, Truth]:
    return drive(0, depth_room.Drive(laps=1.2, frame_rate=1.5), 52)


def depth_figures(make: Callable[..., DepthSettings]) -> Figures:
    """Errors in a rendered room, by a smoother on landmarks, of neighbours and of loops; and of a recorded sequence."""
    recording, _, truth = room()
    log = log_of(recording, looked_at(recording, make()))
    found = {"room": error(smoothed(log)[1], truth.poses[np.searchsorted(truth.t, log.t)])}
    end = looked_at(recording, make(landmarks=False, loops=True, odometry="visual"))
    true = truth.poses[np.searchsorted(truth.t, [step.t for step in end.steps])]
    motions = [step.motion for step in end.steps[1:] if step.motion is not None]
    found |= compared_with(true, motions, [(one.motion, one.to, one.step) for one in end.loops], 0.1)
    if FOLDER.is_dir():
        seen = judged(range(0, 60, 3), make())[:, 0]
        found |= {"kitchen": float(np.nanmedian(seen)), "lost": float(np.isnan(seen).sum())}
    return found


# smoother


@cache
def log_named(name: str) -> Log:
    return made(one(name, "study-settings"), 0)[0].identified()


def smoothed(log: Log) -> tuple[Array, Array]:
    """The online path and the final one."""
    backend = smoother.Smoother(log.prior, smoother.Options(joint_up_to=0), np.random.default_rng(0))
    online = np.array([backend.step(step) for step in log])
    return online, backend.finish().path


def smoother_figures() -> Figures:
    """CPU time of a step, the least of three runs, and distance of the online path from the final one, per log."""
    found = Figures()
    for name in LOGS:
        log, best, off = log_named(name), np.inf, 0.0
        steps = list(log)
        for _ in range(3):
            backend = smoother.Smoother(log.prior, smoother.Options(joint_up_to=0), np.random.default_rng(0))
            start = time.process_time()
            online = np.array([backend.step(step) for step in steps])
            best = min(best, time.process_time() - start)
            off = ate(online, backend.finish().path)
        short = name.partition("[")[0]
        found |= {f"{short}, time": 1e3 * best / len(steps), f"{short}, off": off}
    return found


# tables


Case = tuple[str, float, tuple[float, float], Callable[[float], Figures]]
"""A number's name and value, two others, and the figures with any."""


def shown(measure: Callable[[float], Figures], value: float, usual: Figures) -> list[str]:
    """A value's figures as the table has them."""
    try:
        found = measure(value)
    except Exception as failure:  # whatever a nonsensical setting does
        print(f"{type(failure).__name__}: {failure}", file=sys.stderr)
        return ["fails"] * len(usual)
    return [f"{found[c]:.3g}" if c in ABSOLUTE else f"{found[c] / before:.2f}" for c, before in usual.items()]


def table(title: str, usual: Figures, cases: Iterable[Case]) -> None:
    """Prints a table as its rows are measured."""
    print(f"\n## {title}\n\n| setting | value | tried |", " | ".join(usual), "|")
    print("| --- | --- | --- |", " | ".join(["---"] * len(usual)), "|")
    print("| as they are | | |", " | ".join(f"{value:.3g}" for value in usual.values()), "|", flush=True)
    for name, value, others, measure in cases:
        pairs = zip(*(shown(measure, other, usual) for other in others), strict=True)
        cells = [one if one == other else f"{one}, {other}" for one, other in pairs]
        print(f"| `{name}` | {value:g} | {', '.join(f'{x:g}' for x in others)} |", " | ".join(cells), "|", flush=True)


def settings_cases(settings: type, first: str, figures: Callable[[str, float], Figures]) -> Generator[Case]:
    """A change of the first one by one in a thousand, which shows what is chance; then every number of the class."""
    value = getattr(settings, first)
    yield f"{first}, hardly", value, (0.999 * value, 1.001 * value), partial(figures, first)
    for name, value in numbers(settings, vars(settings)).items():
        yield name, value, values(name, value), partial(figures, name)


def module_cases(module: ModuleType, names: Sequence[str], measure: Callable[[], Figures]) -> Generator[Case]:
    """Each of these numbers of a module."""

    def figures(name: str, value: float) -> Figures:
        with changed(module, name, value):
            return measure()

    for name, value in numbers(module, names).items():
        yield f"{module.__name__.rpartition('.')[2]}.{name}", value, values(name, value), partial(figures, name)


def study_laser() -> None:
    def figures(name: str, value: float) -> Figures:
        return laser_figures(with_setting(LaserSettings, name, value))

    usual = partial(laser_figures, LaserSettings())
    cases = settings_cases(LaserSettings, "sd", figures), module_cases(_matching, MATCHING, usual)
    table("Laser", usual(), chain(*cases))


def study_depth() -> None:
    def figures(name: str, value: float) -> Figures:
        return depth_figures(partial(with_setting, DepthSettings, name, value))

    usual = partial(depth_figures, DepthSettings)
    cases = settings_cases(DepthSettings, "gate", figures), module_cases(level, LEVEL, usual)
    table("Depth cameras", usual(), chain(*cases))


def study_smoother() -> None:
    smoother_figures()  # loads the kernels
    root = ("CAP", "REACH", "PATIENCE", "EARLY", "ENOUGH", "LEAST")
    cases = ((smoother, root), (forest, ("AS_MUCH", "SURE")))
    table("Smoother", smoother_figures(), chain(*(module_cases(*one, smoother_figures) for one in cases)))


PARTS = {"laser": study_laser, "depth": study_depth, "smoother": study_smoother}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()

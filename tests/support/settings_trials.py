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
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit

from depth_drives import drive
from redkitchen import FOLDER, judged
from slamduel.backends.smoothing import forest, smoother
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

DATA = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "lidar"

SHARES = {"lost", "replaced", "score", "inside", "ratio", "agree"}
"""Settings that are varied by what they lack to 1."""

WRONG, WRONG_TURN = 0.2, math.radians(1)
"""m and rad; a loop that is farther from the truth is false."""

FLOORS, LAPS = (0,), 1.15
SCANS = {"intel.clf.gz": (1000, 0.0)}
"""Scans of a recorded log, from its first one on, and how far ahead of the robot's origin the scanner is, m."""

ROOMS, FRAMES = (0,), 52
ROOM = depth_room.Drive(laps=1.2, frame_rate=1.5)
KITCHEN = range(0, 60, 3)

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
    if isinstance(value, int):
        return max(1, value // 2), 2 * value
    return value / 2, 2 * value


def numbers(owner: Any, names: Sequence[str]) -> dict[str, float]:
    """The numbers of a class or a module, by name."""
    found = {name: getattr(owner, name) for name in names}
    return {name: x for name, x in found.items() if type(x) in (int, float) and x != 0 and not name.startswith("_")}


def with_setting(settings: type, name: str, value: float, **options: Any) -> Any:
    """An instance in which one number is another one."""
    if name in {one.name for one in fields(settings)}:
        return settings(**(options | {name: value}))
    return type("Settings", (settings,), {name: value})(**options)


@contextlib.contextmanager
def changed(module: ModuleType, name: str, value: Any) -> Generator[None]:
    """Gives a constant of a module another value; inner loops of the module are compiled again, with it."""
    before = getattr(module, name)
    setattr(module, name, value)
    loops = [(key, loop) for key, loop in vars(module).items() if getattr(loop, "__module__", "") == module.__name__]
    loops = [(key, loop) for key, loop in loops if hasattr(loop, "py_func")]
    places = [one for key, one in sys.modules.items() if key.startswith("slamduel")]
    put = list[tuple[ModuleType, str, Any]]()
    for key, loop in loops:
        new = njit(error_model="numpy")(loop.py_func)
        for place in places:
            if getattr(place, key, None) is loop:
                put.append((place, key, loop))
                setattr(place, key, new)
    try:
        yield
    finally:
        setattr(module, name, before)
        for place, key, loop in put:
            setattr(place, key, loop)


# laser


@cache
def floor(seed: int) -> tuple[LaserRecording, Truth]:
    return laser_floor.record(laser_floor.Options(laps=LAPS, scan_rate=3.0), np.random.default_rng(seed))


@cache
def scans(name: str) -> LaserRecording:
    count, ahead = SCANS[name]
    recording, _ = carmen.read(DATA / name, carmen.Options(ahead=ahead))
    odometry = None if recording.odometry is None else recording.odometry[:count]
    return replace(recording, t=recording.t[:count], ranges=recording.ranges[:count], odometry=odometry)


def laser_figures(settings: LaserSettings) -> Figures:
    """Errors on the made-up floors, of two recorded logs by their relations, and loops."""
    off, cov, ates, loops, false = list[Array](), list[Array](), list[float](), 0, 0
    for seed in FLOORS:
        recording, truth = floor(seed)
        end = matched(recording, settings)
        true = truth.poses[[step.scan for step in end.steps]]
        off.append(errors(np.array([step.delta for step in end.steps[1:]]), true[:-1], true[1:]))
        cov.append(np.array([step.cov for step in end.steps[1:]]))
        ates.append(error(end.estimate, true))
        loops += len(end.loops)
        for loop in end.loops:
            e = errors(loop.delta[None], true[[loop.to]], true[[loop.step]])[0]
            false += bool(np.hypot(e[0], e[1]) > WRONG or abs(e[2]) > WRONG_TURN)
    found = {"floor": float(np.mean(ates)), "NEES": compared("", np.concatenate(off), np.concatenate(cov)).nees}
    found |= {"loops": loops, "false": false}
    for name in SCANS:
        end = matched(scans(name), settings)
        truth, _ = related(read_relations(beside(DATA / name)), end)
        found[name.partition(".")[0]] = float(truth.relations.judged().errors(np.array(end.estimate))[:, 0].mean())
    return found


# depth


def depth_figures(make: Callable[..., DepthSettings]) -> Figures:
    """Errors in rendered rooms, by a smoother on landmarks, of neighbours and of loops; and of a recorded sequence."""
    ates, off, cov, loops, false = list[float](), list[Array](), list[Array](), 0, 0
    for seed in ROOMS:
        recording, _, truth = drive(seed, ROOM, FRAMES)
        log = log_of(recording, looked_at(recording, make()))
        ates.append(error(smoothed(log)[1], truth.poses[np.searchsorted(truth.t, log.t)]))
        end = looked_at(recording, make(landmarks=False, loops=True, odometry="visual"))
        true = truth.poses[np.searchsorted(truth.t, [step.t for step in end.steps])]
        motions = [step.motion for step in end.steps[1:] if step.motion is not None]
        off.append(errors(np.array([motion.delta for motion in motions]), true[:-1], true[1:]))
        cov.append(np.array([motion.cov for motion in motions]))
        loops += len(end.loops)
        for loop in end.loops:
            e = errors(loop.motion.delta[None], true[[loop.to]], true[[loop.step]])[0]
            false += bool(np.hypot(e[0], e[1]) > WRONG / 2 or abs(e[2]) > 2 * WRONG_TURN)
    all_off = np.concatenate(off)
    found = {"room": float(np.mean(ates)), "motions": float(np.sqrt((all_off[:, :2] ** 2).sum(axis=1).mean()))}
    found |= {"NEES": compared("", all_off, np.concatenate(cov)).nees, "loops": loops, "false": false}
    if FOLDER.is_dir():
        seen = judged(KITCHEN, make())
        found |= {"kitchen": float(np.nanmedian(seen[:, 0])), "lost": float(np.isnan(seen[:, 0]).sum())}
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


def error(path: Array, true: Array) -> float:
    """The RMSE of position, m, after alignment."""
    path = np.asarray(path)
    return ate(aligned(align(path, true), path), true)


def tried(measure: Callable[[], Figures]) -> Figures | None:
    """The figures; None where the setting makes it fail."""
    try:
        return measure()
    except Exception as failure:  # whatever a nonsensical setting does
        print(f"{type(failure).__name__}: {failure}", file=sys.stderr)
        return None


Case = tuple[str, float, Sequence[float], list[Figures | None]]


def table(title: str, usual: Figures, cases: Iterator[Case]) -> None:
    """Prints a table as its rows are measured."""
    print(f"\n## {title}\n\n| setting | value | tried |", " | ".join(usual), "|")
    print("| --- | --- | --- |", " | ".join(["---"] * len(usual)), "|")
    print("| as they are | | |", " | ".join(f"{value:.3g}" for value in usual.values()), "|", flush=True)
    for name, value, others, figures in cases:
        cells = list[str]()
        for column, before in usual.items():
            pair = ["fails" if one is None else shown(column, one[column], before) for one in figures]
            cells.append(pair[0] if pair[0] == pair[1] else ", ".join(pair))
        print(f"| `{name}` | {value:g} | {', '.join(f'{x:g}' for x in others)} |", " | ".join(cells), "|", flush=True)


def shown(column: str, value: float, before: float) -> str:
    """A figure as the table has it."""
    return f"{value:.3g}" if column in ABSOLUTE else f"{value / before:.2f}"


def settings_cases(settings: type, figures: Callable[[Any], Figures], instance: Callable[..., Any]) -> Iterator[Case]:
    """Each number of a settings class."""
    for name, value in numbers(settings, list(vars(settings))).items():
        pair = values(name, value)
        yield name, value, pair, [tried(partial(figures, instance(settings, name, x))) for x in pair]


def module_cases(modules: Mapping[ModuleType, Sequence[str]], measure: Callable[[], Figures]) -> Iterator[Case]:
    """Each number of these modules."""
    for module, names in modules.items():
        for name, value in numbers(module, names).items():
            pair, found = values(name, value), list[Figures | None]()
            for x in pair:
                with changed(module, name, x):
                    found.append(tried(measure))
            yield f"{module.__name__.rpartition('.')[2]}.{name}", value, pair, found


def hardly(name: str, value: float, figures: Callable[[float], Figures]) -> Iterator[Case]:
    """A change by one in a thousand: what differs with it is chance."""
    pair = (0.999 * value, 1.001 * value)
    yield f"{name}, hardly", value, pair, [tried(partial(figures, x)) for x in pair]


def study_laser() -> None:
    def one_of(name: str, value: float) -> Figures:
        return laser_figures(with_setting(LaserSettings, name, value))

    def cases() -> Iterator[Case]:
        yield from hardly("sd", LaserSettings.sd, partial(one_of, "sd"))
        yield from settings_cases(LaserSettings, laser_figures, with_setting)
        usual = partial(laser_figures, LaserSettings())
        yield from module_cases({_matching: MATCHING}, usual)

    table("Laser", laser_figures(LaserSettings()), cases())


def study_depth() -> None:
    def make(settings: type, name: str, value: float) -> Callable[..., DepthSettings]:
        return partial(with_setting, settings, name, value)

    def cases() -> Iterator[Case]:
        yield from hardly("gate", DepthSettings.gate, lambda x: depth_figures(make(DepthSettings, "gate", x)))
        yield from settings_cases(DepthSettings, depth_figures, make)
        yield from module_cases({level: LEVEL}, partial(depth_figures, DepthSettings))

    table("Depth cameras", depth_figures(DepthSettings), cases())


def study_smoother() -> None:
    constants = {smoother: ("CAP", "REACH", "PATIENCE", "EARLY", "ENOUGH", "LEAST"), forest: ("AS_MUCH", "SURE")}
    smoother_figures()  # loads the kernels
    table("Smoother", smoother_figures(), module_cases(constants, smoother_figures))


PARTS = {"laser": study_laser, "depth": study_depth, "smoother": study_smoother}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()

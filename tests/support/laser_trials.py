"""Laser logs under changes that should not matter: how often is a run worse than the others of its log?

    SLAMDUEL_DATA=... python tests/support/laser_trials.py [LOG ...]

(`make study-laser`) prints a table of docs/settings.md: for each log the median error, the worst run's in medians,
and how many are above 1.3 and 3. Logs are judged by relations: recorded ones by those published whose stamps are exact,
made-up floors by those of as many pairs of scans that are near one another.
"""

import os
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slamduel.core.se2 import Array, Ints, between
from slamduel.datasets.formats.carmen import Options, read
from slamduel.datasets.worlds import laser_floor
from slamduel.frontend.laser.recording import LaserRecording, matched, placed
from slamduel.frontend.laser.settings import Settings

DATA = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "lidar"

EXACT = 2e-5
"""s; stamps of relations are those of scans to this."""

NEAR, PAIRS = 5.0, 4000
"""m between the scans of a pair on a made-up floor, at most, and how many pairs are looked at."""

WORSE, BAD = 1.3, 3.0
"""Medians of its log."""

FAULTS: dict[str, dict[str, Any]] = {
    "": {},
    "stalls": {"stalls": 6.0},
    "late heading": {"late_heading": 0.5},
    "stuck": {"stuck": 4.0},
    "spins": {"spins": 4.0},
    "clock stalls": {"clock_stalls": 6.0},
}

FLOORS = range(10)

Judge = Callable[[Array, Ints], float]
"""The error, m, of the poses (k, 3) of the scans in rows (k,)."""


class Case(NamedTuple):
    """A log."""

    recording: LaserRecording
    judge: Judge


class Change(NamedTuple):
    """A change of a recording that should not matter."""

    recording: LaserRecording
    rows: Ints  # (k,) its scans among those of the log
    settings: Settings = Settings()


def changes(recording: LaserRecording, draws: int = 8) -> Iterator[tuple[str, Change]]:
    """The recording as it is but for a change, by name."""
    rows = np.arange(len(recording.t))
    for draw in range(draws):
        noise = 1e-6 * np.random.default_rng(draw).standard_normal(recording.ranges.shape)
        yield f"1 um, draw {draw}", Change(replace(recording, ranges=recording.ranges + noise), rows)
    for most in (20.0, 30.0, 40.0, 50.0):
        scanner = replace(recording.scanner, most=most)
        yield f"max_range {most:g}", Change(replace(recording, scanner=scanner), rows)
    for step in (0.4, 0.45, 0.55, 0.6):
        yield f"step {step:g}", Change(recording, rows, Settings(step=step))
    for cell in (0.04, 0.06):
        yield f"cell {cell:g}", Change(recording, rows, Settings(cell=cell))
    yield "every second scan", Change(_rows(recording, rows[::2]), rows[::2])
    backwards = _rows(recording, rows[::-1])
    yield "backwards", Change(replace(backwards, t=recording.t[-1] - backwards.t), rows[::-1])


def error(change: Change, judge: Judge) -> float:
    """The error of a run, m."""
    return judge(placed(change.recording, matched(change.recording, change.settings)), change.rows)


def _rows(recording: LaserRecording, rows: Ints) -> LaserRecording:
    odometry = None if recording.odometry is None else recording.odometry[rows]
    return replace(recording, t=recording.t[rows], ranges=recording.ranges[rows], odometry=odometry)


@cache
def floor(seed: int, fault: str, laps: float = 1.15) -> Case:
    """A made-up floor with that fault of the wheels."""
    options = laser_floor.Options(laps=laps, **FAULTS[fault])
    recording, truth = laser_floor.record(options, np.random.default_rng(seed))

    near = np.hypot(*(truth.poses[:, None, :2] - truth.poses[None, :, :2]).transpose(2, 0, 1)) < NEAR
    first, second = np.nonzero(np.triu(near, 1))
    pairs = np.random.default_rng(0).choice(len(first), PAIRS, replace=False)
    first, second = first[pairs], second[pairs]
    return Case(recording, _judge(first, second, between(truth.poses[first], truth.poses[second]), len(recording.t)))


@cache
def recorded(name: str, scans: int | None = None) -> Case:
    """A recorded log: intel, fr079, or killian, whose wheels are made up around a corrected path."""
    path, options = DATA / f"{name}.clf.gz", Options(ahead=-0.04 if name == "fr079" else 0.0)
    if name == "killian":
        path = Path(os.environ.get("TMPDIR", "/tmp")) / "killian.clf"
        with zipfile.ZipFile(DATA / "killian.g2o.zip") as archive:
            path.write_bytes(archive.read("killian.g2o"))
    recording, _ = read(path, options)
    if name == "killian":
        assert recording.odometry is not None
        recording = replace(recording, odometry=laser_floor.wheels(recording.odometry, 1.0, np.random.default_rng(0)))
    recording = _rows(recording, np.arange(len(recording.t))[:scans])
    relations = np.loadtxt(DATA / f"{'mit-' if name == 'killian' else ''}{name}.relations")
    first, second = (_nearest(recording.t, relations[:, k]) for k in (0, 1))
    exact = (np.abs(recording.t[first] - relations[:, 0]) < EXACT) & (
        np.abs(recording.t[second] - relations[:, 1]) < EXACT
    )
    delta = relations[exact][:, [2, 3, 7]]
    return Case(recording, _judge(first[exact], second[exact], delta, len(recording.t)))


def _judge(first: Ints, second: Ints, delta: Array, scans: int) -> Judge:
    """Scores a path by its relations (k, 3) from scans in rows `first` (k,) to those in `second`, of that many."""

    def judge(path: Array, rows: Ints) -> float:
        at = np.full(scans, -1)
        at[rows] = np.arange(len(rows))
        a, b = at[first], at[second]
        here = (a >= 0) & (b >= 0)
        off = between(delta[here], between(path[a[here]], path[b[here]]))
        return float(np.hypot(off[:, 0], off[:, 1]).mean())

    return judge


def _nearest(t: Array, times: Array) -> Ints:
    """The rows of `t` (n,) nearest to `times`."""
    after = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    return np.where(times - t[after - 1] < t[after] - times, after - 1, after)


def every() -> dict[str, Callable[[], Case]]:
    """All logs, by name; those at hand alone."""
    cases: dict[str, Callable[[], Case]] = {
        f"floor {seed}{', ' * bool(fault)}{fault}": partial(floor, seed, fault) for seed in FLOORS for fault in FAULTS
    }
    at_hand = {"intel": "intel.clf.gz", "fr079": "fr079.clf.gz", "killian": "killian.g2o.zip"}
    return cases | {name: partial(recorded, name) for name, file in at_hand.items() if (DATA / file).is_file()}


def main(names: list[str]) -> None:
    cases, ratios = every(), list[float]()
    print("| log | median, m | worst run, in medians | which | above 1.3 | above 3 |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in names or cases:
        case = cases[name]()
        errors = {change: error(made, case.judge) for change, made in changes(case.recording)}
        median = float(np.median(list(errors.values())))
        worst = max(errors, key=lambda one: errors[one])
        here = [one / median for one in errors.values()]
        ratios += here
        counts = [sum(one > limit for one in here) for limit in (WORSE, BAD)]
        print(f"| {name} | {median:.4f} | {max(here):.2f} | {worst} | {counts[0]} | {counts[1]} |", flush=True)
    print(f"\n{sum(one > WORSE for one in ratios)} of {len(ratios)} runs are above {WORSE:g} medians of their log,")
    print(f"{sum(one > BAD for one in ratios)} above {BAD:g}.")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Makes logs of made-up drives as CSV files, each with one of the mistakes that people make, or none.

    python tests/support/mistaken_logs.py [LOGS]

(`make study-mistakes`) prints how often `bench validate` names the mistake, as in docs/contradictions.md. Worlds,
speeds, noise, lengths, sensors and rates are drawn at random. Nothing here is of the code that finds the mistakes.
"""

import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.random import Generator

from slamduel.backends.api import Diverged
from slamduel.backends.common_options import LOSSES
from slamduel.backends.graphs.batch import Batch
from slamduel.bench.contradiction.remark import remarks
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Log
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.tables.csv_options import Options
from slamduel.datasets.tables.csv_tables import make

FIRST = 1000
"""Seed of the first log; tests have others."""

Form = Literal["poses", "motions", "speeds"]
HEADERS: dict[Form, str] = {"poses": "t,x,y,heading", "motions": "t,dx,dy,dtheta", "speeds": "t,v,omega"}


@dataclass(frozen=True)
class Drive:
    """A drive as its robot's program knows it; the tables are right."""

    t: Array  # (n,) s, of the odometry
    true: Array  # (n, 3) headings not wrapped
    speeds: Array  # (n, 2) m/s and rad/s, noisy, held until the next row
    detections: Array  # (s, 4) t, id, range, bearing
    base: float  # m between the wheels
    landmarks: Array  # (m, 2)
    noise: dict[str, float]  # options of the reader, as it is


def drive(rng: Generator) -> Drive:
    """Draws a drive."""
    size, speed = rng.uniform(4, 40), rng.uniform(0.2, 1.5)
    n, dt = int(rng.uniform(600, 2500)), float(rng.choice([0.05, 0.1]))
    forward, turning, by_turn = rng.uniform([0.005, 0.002, 0.005], [0.05, 0.03, 0.05])
    command = _commands(rng, n, dt, size, speed)
    true = _driven(command, dt, np.array([*rng.uniform(-50, 50, 2), rng.uniform(-np.pi, np.pi)]))
    way, turn = np.abs(command[:, 0]) * dt, np.abs(command[:, 1]) * dt
    noise = np.column_stack((forward * np.sqrt(way), np.hypot(turning * np.sqrt(way), by_turn * np.sqrt(turn))))
    speeds = command + noise * rng.standard_normal((n, 2)) / dt

    landmarks = true[0, :2] + rng.uniform(-size, size, (int(rng.uniform(8, 40)), 2)) * 0.8
    reach, view = size * rng.uniform(0.4, 1.2), rng.choice([1.2, 2.0, np.pi, 2 * np.pi])
    range_sd, bearing_sd = rng.uniform(0.005, 0.1), rng.uniform(0.003, 0.04)
    rows = []
    for k in range(0, n, int(rng.choice([2, 3, 5, 10]))):
        off = landmarks - true[k, :2]
        r, bearing = np.hypot(*off.T), wrap(np.arctan2(off[:, 1], off[:, 0]) - true[k, 2])
        seen = np.flatnonzero(
            (r < reach) & (r > 10 * range_sd) & (np.abs(bearing) < view / 2) & (rng.random(len(r)) < 0.8)
        )
        z = np.column_stack((r, bearing))[seen] + rng.standard_normal((len(seen), 2)) * [range_sd, bearing_sd]
        rows.append(np.column_stack((np.full(len(seen), k * dt), seen, z[:, 0], wrap(z[:, 1]))))
    stated = {"forward": forward, "turning": turning, "turning_by_turn": by_turn}
    return Drive(
        dt * np.arange(n, dtype=float), true, speeds, np.concatenate(rows), rng.uniform(0.15, 0.5), landmarks,
        stated | {"range_sd": range_sd, "bearing_sd": bearing_sd},
    )  # fmt: skip


def _commands(rng: Generator, n: int, dt: float, size: float, speed: float) -> Array:
    """(n, 2) speeds of a robot that goes to one point after another, slower where it turns, and rests now and then."""
    pose, goal, command, rest = np.zeros(3), rng.uniform(-size, size, 2) * 0.7, np.zeros((n, 2)), 0
    for k in range(n):
        off = goal - pose[:2]
        if np.hypot(*off) < 0.2 * size:
            goal, rest = rng.uniform(-size, size, 2) * 0.7, int(rng.random() < 0.2) * int(2 / dt)
            off = goal - pose[:2]
        if rest:
            rest -= 1
            continue
        aside = wrap(np.arctan2(off[1], off[0]) - pose[2])
        omega = float(np.clip(1.5 * aside, -0.8, 0.8))
        command[k] = speed * (1 - 0.7 * abs(omega) / 0.8), omega
        pose += np.array([command[k, 0] * np.cos(pose[2]), command[k, 0] * np.sin(pose[2]), omega]) * dt
    return command


def _driven(speeds: Array, dt: float, start: Array) -> Array:
    """(n, 3) poses by speeds, each held until the next row, along arcs; headings not wrapped."""
    heading = start[2] + np.concatenate(([0.0], np.cumsum(speeds[:-1, 1] * dt)))
    turn = speeds[:-1, 1] * dt
    middle, chord = heading[:-1] + turn / 2, speeds[:-1, 0] * dt * np.sinc(turn / (2 * np.pi))
    xy = start[:2] + np.cumsum(np.column_stack((chord * np.cos(middle), chord * np.sin(middle))), axis=0)
    return np.column_stack((np.concatenate((start[None, :2], xy)), heading))


class Tables(NamedTuple):
    """The tables of a log."""

    form: Form
    odometry: Array  # (n, 3 or 4)
    detections: Array  # (s, 4)


Change = Callable[[Tables, Drive, Generator], Tables]


def tables(one: Drive, form: Form, rng: Generator) -> Tables:
    """The tables as they should be, positions and headings in a world of their own."""
    dt = one.t[1] - one.t[0]
    start = np.array([*rng.uniform(-20, 20, 2), rng.uniform(-np.pi, np.pi)])
    poses = _driven(one.speeds, dt, start)
    if form == "poses":
        values = poses
    elif form == "motions":
        values = np.concatenate((np.zeros((1, 3)), between(poses[:-1], poses[1:])))
        values[1:, 2] = np.diff(poses[:, 2])
    else:
        values = one.speeds
    return Tables(form, np.column_stack((one.t, values)), one.detections)


def _odometry(change: Callable[[Array], Array]) -> Change:
    def changed(found: Tables, _: Drive, __: Generator) -> Tables:
        return found._replace(odometry=np.column_stack((found.odometry[:, 0], change(found.odometry[:, 1:].copy()))))

    return changed


def _scaled(*factors: float) -> Change:
    return _odometry(lambda values: values * np.array(factors))


def _bearing(change: Callable[[Array], Array]) -> Change:
    def changed(found: Tables, _: Drive, __: Generator) -> Tables:
        z = found.detections.copy()
        z[:, 3] = wrap(change(z[:, 3]))
        return found._replace(detections=z)

    return changed


def _wrapped(values: Array) -> Array:
    values[:, 2] = wrap(values[:, 2])
    return values


def _in_the_world(found: Tables, one: Drive, rng: Generator) -> Tables:
    poses = _driven(one.speeds, one.t[1] - one.t[0], np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    return found._replace(odometry=np.column_stack((one.t, np.diff(poses, axis=0, prepend=poses[:1]))))


def _late(found: Tables, one: Drive, rng: Generator) -> Tables:
    z = found.detections.copy()
    z[:, 0] += rng.choice([-1.0, 1.0]) * rng.choice([0.2, 0.5, 1.0, 2.0])
    return found._replace(detections=z)


def _wheels(change: Callable[[Array, Array], tuple[Array, Array]]) -> Change:
    def changed(found: Tables, one: Drive, _: Generator) -> Tables:
        v, omega = one.speeds.T
        left, right = change(v - omega * one.base / 2, v + omega * one.base / 2)
        return found._replace(odometry=np.column_stack((one.t, (left + right) / 2, (right - left) / one.base)))

    return changed


MISTAKES: dict[str, tuple[str, Form, Change]] = {
    "bearings to the right": ("positive to the other side", "poses", _bearing(lambda b: -b)),
    "turning rate of the other sign": ("positive to the other side", "speeds", _scaled(1, -1)),
    "wheels swapped": ("positive to the other side", "speeds", _wheels(lambda left, right: (right, left))),
    "sensor turned by 90 degrees": ("turned by 90 degrees", "motions", _bearing(lambda b: b + np.pi / 2)),
    "sensor turned by -90 degrees": ("turned by 90 degrees", "speeds", _bearing(lambda b: b - np.pi / 2)),
    "headings from north": ("turned by 90 degrees", "poses", _odometry(lambda p: p - np.array([0, 0, np.pi / 2]))),
    "sensor backwards": ("looks backwards", "poses", _bearing(lambda b: b + np.pi)),
    "speed of the other sign": ("looks backwards", "speeds", _scaled(-1, 1)),
    "speed in km/h": ("km/h", "speeds", _scaled(3.6, 1)),
    "motions in mm": ("millimetres", "motions", _scaled(1000, 1000, 1)),
    "motions in cm": ("centimetres", "motions", _scaled(100, 100, 1)),
    "ranges in mm": ("millimetres", "speeds", lambda f, _, __: f._replace(detections=f.detections * [1, 1, 1000, 1])),
    "ranges in feet": (
        "ranges are in feet",
        "poses",
        lambda f, _, __: f._replace(detections=f.detections / [1, 1, 0.3048, 1]),
    ),
    "turning rate in degrees": ("in degrees", "speeds", _scaled(1, 180 / np.pi)),
    "headings in degrees": ("in degrees", "poses", _odometry(lambda p: _wrapped(p) * [1, 1, 180 / np.pi])),
    "motions in the world's frame": ("world's frame", "motions", _in_the_world),
    "headings clockwise": ("clockwise", "poses", _odometry(lambda p: p * [1, 1, -1])),
    "headings clockwise from north": ("clockwise", "poses", _odometry(lambda p: p * [1, 1, -1] + [0, 0, np.pi / 2])),
    "x and y swapped": ("x and y are swapped", "poses", _odometry(lambda p: p[:, [1, 0, 2]])),
    "y of the other sign": ("x and y are swapped", "poses", _odometry(lambda p: p * [1, -1, 1])),
    "heading constant": ("headings never change", "poses", _odometry(lambda p: p * [1, 1, 0])),
    "a clock that is late": ("s late|s early", "poses", _late),
    "one wheel reversed": (
        "counts of one wheel have the other sign",
        "speeds",
        _wheels(lambda left, right: (left, -right)),
    ),
    "the other wheel reversed": (
        "counts of one wheel have the other sign",
        "speeds",
        _wheels(lambda left, right: (-left, right)),
    ),
    "one wheel stuck": ("one wheel's counts stand still", "speeds", _wheels(lambda left, right: (left, 0 * right))),
}
"""Mistake -> words that name it, the form of the odometry, and how it is made."""


def log(one: Drive, found: Tables, folder: Path, *, truth: bool) -> Dataset:
    """Writes the tables and reads them as a user's."""
    form = found.form
    np.savetxt(folder / "odometry.csv", found.odometry, "%.9g", ",", header=HEADERS[form], comments="")
    kept = found.detections[np.argsort(found.detections[:, 0], kind="stable")]
    header = "t,id,range,bearing"
    np.savetxt(folder / "detections.csv", kept, ["%.9g", "%d", "%.9g", "%.9g"], ",", header=header, comments="")
    files = {name: str(folder / f"{name}.csv") for name in ("odometry", "detections")}
    if truth:
        poses = one.true.copy()
        np.savetxt(
            folder / "truth.csv", np.column_stack((one.t, poses)), "%.9g", ",", header=HEADERS["poses"], comments=""
        )
        files["truth"] = str(folder / "truth.csv")
    options = replace(Options(max_speed=1e6), **files, **one.noise)
    return make(options, np.random.default_rng(0))


def drawn(seed: int, mistake: str | None, folder: Path) -> tuple[Dataset, Drive]:
    """A log with that mistake, half of them with truth, and its drive."""
    rng = np.random.default_rng(seed)
    one = drive(rng)
    form: Form = ("poses", "motions", "speeds")[seed % 3] if mistake is None else MISTAKES[mistake][1]
    found = tables(one, form, rng)
    if mistake is not None:
        found = MISTAKES[mistake][2](found, one, rng)
    return log(one, found, folder, truth=bool(seed % 2)), one


def error(of: Log, one: Drive) -> float:
    """The error of the optimum of J, m: root mean square after alignment."""
    batch = Batch(of.identified(), list(LOSSES).index("none"), 0.0)
    try:
        batch.start_by_chunks()
        batch.fit(1e-6, 50)
    except Diverged:
        return np.inf
    path, _ = batch.place()
    true = np.column_stack([np.interp(of.t, one.t, one.true[:, k]) for k in (0, 1)])
    return onto(path[:, :2], true)


def onto(points: Array, others: Array) -> float:
    """Root mean square distance (m) of points (n, 2) from others, once turned and moved onto them."""
    a, b = points - points.mean(axis=0), others - others.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, np.linalg.det(u @ v)]) @ v
    return float(np.sqrt(((a @ turn - b) ** 2).sum(axis=1).mean()))


class Outcome(NamedTuple):
    """How a log's mistake was found."""

    named: bool
    another: bool  # is named
    word: bool  # any remark, or a refusal
    matters: bool  # the error is above twice that without the mistake


def outcome(seed: int, mistake: str | None, folder: Path) -> Outcome:
    """Makes a log with the mistake and one without, and reads the remarks."""
    clean = error(*_of(drawn(seed, None, folder)))
    try:
        dataset, one = drawn(seed, mistake, folder)
    except InputError:
        return Outcome(named=False, another=False, word=True, matters=True)
    said = remarks(dataset)
    named = mistake is not None and any(re.search(MISTAKES[mistake][0], one) for one in said)
    another = any("J falls" in one for one in said) and not named
    return Outcome(named, another, bool(said), error(dataset.log, one) > 2 * clean)


def _of(made: tuple[Dataset, Drive]) -> tuple[Log, Drive]:
    return made[0].log, made[1]


def main(seeds: int) -> None:
    """Prints the table, of that many logs with each mistake and ten times as many without."""
    total = Counter[str]()
    print("| mistake | logs | named | another is named | a remark | the error doubles, a remark |")
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for mistake in (*MISTAKES, None):
            found = [
                outcome(seed, mistake, Path(folder))
                for seed in range(FIRST, FIRST + (seeds if mistake else 10 * seeds))
            ]
            counts = {
                "logs": len(found),
                "named": sum(one.named for one in found),
                "another": sum(one.another for one in found),
                "word": sum(one.word for one in found),
                "of": sum(one.matters for one in found),
                "matters": sum(one.matters and one.word for one in found),
            }
            total.update(counts if mistake else {})
            print(_row(mistake or "none", counts), flush=True)
    print(_row("all with a mistake", total))


def _row(name: str, counts: Mapping[str, int]) -> str:
    logs, named, another, word, of, matters = counts.values()
    return f"| {name} | {logs} | {named} | {another} | {word} | {matters} of {of} |"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 30)

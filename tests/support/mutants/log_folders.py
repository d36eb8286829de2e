"""Mutated folders of logs: tables of other content, log.toml of other values, files that are damaged or not there."""

import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from fuzzing import damaged
from slamduel.core.se2 import Array, compose
from slamduel.datasets.formats import log_folder

from .ending import Ended, in_any_order, judged, sound
from .random_drive import random_drive

Files = dict[str, bytes]
Mutation = Callable[[Files, np.random.Generator], None]

REUSED = 20  # mutations of one drive
WORDS, SEALED = "log.toml", 0.2  # share of folders whose log.toml keeps the digests of the others
OTHER: tuple[Any, ...] = (
    "a text", True, [True, 0, 0], float("nan"), float("inf"), -1, 1e308, [], {}, [[1, 2], [3]], [[0.0] * 3] * 3, [1, 2],
)  # fmt: skip
"""Values of other types and shapes."""


def _cells(name: str, change: Callable[[list[list[str]], np.random.Generator], None]) -> Mutation:
    """Changes the cells of a CSV file, header included."""

    def mutate(files: Files, rng: np.random.Generator) -> None:
        rows = [line.split(",") for line in files[name].decode().splitlines()]
        change(rows, rng)
        files[name] = "".join(",".join(row) + "\n" for row in rows).encode()

    return mutate


def _numbers(name: str, change: Callable[[Array], None], first: int = 1) -> Mutation:
    """Changes the numbers (n, columns) of a file from line `first` on; those of step 0's blank cells are NaN."""

    def mutate(files: Files, rng: np.random.Generator) -> None:
        comma = name.endswith(".csv")
        lines = files[name].decode().splitlines()
        cells = [[float(one or "nan") for one in line.split("," if comma else None)] for line in lines[first:]]
        rows = np.array(cells)
        change(rows)
        texts = [["" if np.isnan(x) else str(int(x)) if x == int(x) else repr(float(x)) for x in row] for row in rows]
        files[name] = (
            "\n".join([*lines[:first], *(("," if comma else " ").join(row) for row in texts)]) + "\n"
        ).encode()

    return mutate


def _times(name: str, columns: slice | int, by: float, first: int = 1) -> Mutation:
    def change(rows: Array) -> None:
        rows[:, columns] *= by

    return _numbers(name, change, first)


def _plus(name: str, column: int, by: float, first: int = 1) -> Mutation:
    def change(rows: Array) -> None:
        rows[:, column] += by

    return _numbers(name, change, first)


def _exchanged(name: str, one: int, other: int, *, header: bool) -> Mutation:
    def change(rows: list[list[str]], rng: np.random.Generator) -> None:
        for row in rows if header else rows[1:]:
            row[one], row[other] = row[other], row[one]

    return _cells(name, change)


def _lost_rows(rows: list[list[str]], rng: np.random.Generator) -> None:
    first = int(rng.integers(1, len(rows) - 1))
    del rows[first : first + int(rng.integers(1, len(rows) // 3))]


def _twice(rows: list[list[str]], rng: np.random.Generator) -> None:
    rows[1:] = [list(row) for row in rows[1:] for _ in range(2)]


def _absolute(rows: Array) -> None:
    """Poses in place of motions."""
    pose = np.zeros(3)
    for row in rows[1:]:
        pose = compose(pose, row[1:4])
        row[1:4] = pose


def _of_the_world(rows: Array) -> None:
    """Motions in the world's frame in place of the robot's."""
    heading = 0.0
    for row in rows[1:]:
        c, s = np.cos(heading), np.sin(heading)
        heading += row[3]
        row[1:3] = c * row[1] - s * row[2], s * row[1] + c * row[2]


def _w_first(rows: Array) -> None:
    rows[:, 4:] = rows[:, [7, 4, 5, 6]]


def _gone(name: str) -> Mutation:
    return lambda files, rng: files.update({name: b"gone"})


def _empty(name: str) -> Mutation:
    return lambda files, rng: files.update({name: b""})


def _key(*path: str) -> Mutation:
    """Another value of a key in log.toml."""

    def mutate(files: Files, rng: np.random.Generator) -> None:
        _set(files, path, OTHER[rng.integers(len(OTHER))])

    return mutate


def _value(value: Any, *path: str) -> Mutation:
    return lambda files, rng: _set(files, path, value)


def _set(files: Files, path: tuple[str, ...], value: Any) -> None:
    words = tomllib.loads(files[WORDS].decode())
    inside = words
    for name in path[:-1]:
        inside = inside.setdefault(name, {})
    inside[path[-1]] = value
    files[WORDS] = tomli_w.dumps(words).encode()


def _without(*names: str) -> Mutation:
    def mutate(files: Files, rng: np.random.Generator) -> None:
        words = tomllib.loads(files[WORDS].decode())
        for name in names:
            words.pop(name, None)
        files[WORDS] = tomli_w.dumps(words).encode()

    return mutate


ODOMETRY, SIGHTINGS, TRUTH = "odometry.csv", "sightings.csv", "truth.tum"
MUTATIONS: dict[str, Mutation] = {
    **{f"{name}: gone": _gone(name) for name in (WORDS, ODOMETRY, SIGHTINGS)},
    **{f"{name}: empty": _empty(name) for name in (WORDS, ODOMETRY, SIGHTINGS, TRUTH)},
    f"{TRUTH}: gone, so no truth": lambda files, rng: (_gone(TRUTH)(files, rng), _without("truth")(files, rng))[0],
    **{f"{name}: lost rows": _cells(name, _lost_rows) for name in (ODOMETRY, SIGHTINGS)},
    **{f"{name}: rows twice": _cells(name, _twice) for name in (ODOMETRY, SIGHTINGS)},
    f"{ODOMETRY}: columns swapped": _exchanged(ODOMETRY, 1, 3, header=True),
    f"{ODOMETRY}: dx and dtheta swapped": _exchanged(ODOMETRY, 1, 3, header=False),
    f"{ODOMETRY}: degrees": _times(ODOMETRY, 3, 180 / np.pi),
    f"{ODOMETRY}: mirrored": _times(ODOMETRY, 3, -1.0),
    f"{ODOMETRY}: millimetres": _times(ODOMETRY, slice(1, 3), 1000.0),
    f"{ODOMETRY}: milliseconds": _times(ODOMETRY, 0, 1000.0),
    f"{ODOMETRY}: absolute poses": _numbers(ODOMETRY, _absolute),
    f"{ODOMETRY}: of the world": _numbers(ODOMETRY, _of_the_world),
    f"{ODOMETRY}: covariances too small": _times(ODOMETRY, slice(4, 10), 1e-6),
    f"{ODOMETRY}: covariances too large": _times(ODOMETRY, slice(4, 10), 1e6),
    f"{ODOMETRY}: covariances negative": _times(ODOMETRY, slice(4, 10), -1.0),
    f"{SIGHTINGS}: columns swapped": _exchanged(SIGHTINGS, 2, 3, header=True),
    f"{SIGHTINGS}: range and bearing swapped": _exchanged(SIGHTINGS, 2, 3, header=False),
    f"{SIGHTINGS}: step and id swapped": _exchanged(SIGHTINGS, 0, 1, header=False),
    f"{SIGHTINGS}: degrees": _times(SIGHTINGS, 3, 180 / np.pi),
    f"{SIGHTINGS}: mirrored": _times(SIGHTINGS, 3, -1.0),
    f"{SIGHTINGS}: millimetres": _times(SIGHTINGS, 2, 1000.0),
    f"{SIGHTINGS}: steps from 1": _plus(SIGHTINGS, 0, 1.0),
    f"{SIGHTINGS}: a step early": _plus(SIGHTINGS, 0, -1.0),
    f"{SIGHTINGS}: covariances too small": _times(SIGHTINGS, slice(4, 7), 1e-6),
    f"{SIGHTINGS}: covariances too large": _times(SIGHTINGS, slice(4, 7), 1e4),
    f"{SIGHTINGS}: no ids": _times(SIGHTINGS, 1, 0.0),
    f"{TRUTH}: another clock": _plus(TRUTH, 0, 0.25),
    f"{TRUTH}: millimetres": _times(TRUTH, slice(1, 3), 1000.0),
    f"{TRUTH}: mirrored": _times(TRUTH, 2, -1.0),
    f"{TRUTH}: w first": _numbers(TRUTH, _w_first),
    **{f"{WORDS}: {'.'.join(path)} of another type": _key(*path) for path in (
        ("name",), ("prior",), ("prior", "pose"), ("prior", "cov"), ("prior", "map"), ("truth",), ("truth", "kind"),
        ("contents",), ("contents", "rows"), ("notes",), ("other",),
    )},
    f"{WORDS}: prior elsewhere": _value([9.0, -7.0, 1.0], "prior", "pose"),
    f"{WORDS}: prior turned": _value([0.0, 0.0, 2.0], "prior", "pose"),
    f"{WORDS}: prior in degrees": _value([0.0, 0.0, 90.0], "prior", "pose"),
    f"{WORDS}: prior unknown": _value((1e6 * np.eye(3)).tolist(), "prior", "cov"),
    f"{WORDS}: prior indefinite": _value([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "prior", "cov"),
    f"{WORDS}: prior asymmetric": _value([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "prior", "cov"),
    f"{WORDS}: no prior": _without("prior"),
}  # fmt: skip


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many folders, every kind in turn; each sixth is a damaged file instead."""
    kinds = in_any_order(MUTATIONS, seed)
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        clean, right = Files(), dict[str, Any]()
        for case in range(cases):
            rng = np.random.default_rng([seed, case])
            folder = Path(scratch) / str(case)
            if case % REUSED == 0:
                log_folder.write(folder / "sound", *random_drive(rng))
                clean = {path.name: path.read_bytes() for path in (folder / "sound").iterdir()}
                right = sound(log_folder.read(folder / "sound"))
            files = dict(clean)
            if rng.random() > SEALED:
                _without("contents")(files, rng)
            if case % 6 == 5:
                victim = sorted(files)[case // 6 % len(files)]
                (files[victim],) = list(damaged(files[victim], case // 6 % 6 + 1, case))[-1:]
                kind = f"{victim}: damaged"
            else:
                kind = kinds[(case - case // 6) % len(kinds)]
                MUTATIONS[kind](files, rng)
            _put(folder / "log", files)
            yield judged(f"folder {kind}", lambda place=folder / "log": log_folder.read(place), right)


def _put(folder: Path, files: Files) -> None:
    folder.mkdir(parents=True)
    for name, content in files.items():
        if content != b"gone":
            (folder / name).write_bytes(content)

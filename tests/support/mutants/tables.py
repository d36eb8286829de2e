"""Mutations of a drive's tables: odometry, detections and ground truth."""

from collections.abc import Callable

import numpy as np

from .drive import TABLES, Tables

Mutation = Callable[[Tables, np.random.Generator], None]


def _scaled(table: str, column: int, by: float) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        del rng
        tables[table][:, column] *= by

    return mutate


def _shifted(table: str, column: int, least: float, most: float) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        tables[table][:, column] += rng.choice((-1, 1)) * rng.uniform(least, most)

    return mutate


def _hole(table: str) -> Mutation:
    """Without 10 to 50 % of the rows, in one piece from the inside."""

    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        n = len(tables[table])
        count = int(rng.uniform(0.1, 0.5) * n)
        first = int(rng.integers(1, n - count - 1))
        tables[table] = np.delete(tables[table], slice(first, first + count), axis=0)

    return mutate


def _part(table: str, *, early: bool) -> Mutation:
    """Only the first, or last, 30 to 90 % of the rows."""

    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        count = int(rng.uniform(0.3, 0.9) * len(tables[table]))
        tables[table] = tables[table][:count] if early else tables[table][-count:]

    return mutate


def _thinned(table: str) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        kept = rng.random(len(tables[table])) > 0.2
        kept[[0, -1]] = True
        tables[table] = tables[table][kept]

    return mutate


def _shuffled(table: str) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        rng.shuffle(tables[table], axis=0)

    return mutate


def _doubled(table: str) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        del rng
        tables[table] = np.repeat(tables[table], 2, axis=0)

    return mutate


def _swapped(table: str, one: int, other: int) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        del rng
        tables[table][:, [one, other]] = tables[table][:, [other, one]]

    return mutate


def _jump(table: str) -> Mutation:
    """From some row on the positions are 1 to 5 m further."""

    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        first = int(rng.uniform(0.2, 0.8) * len(tables[table]))
        tables[table][first:, 1:3] += rng.uniform(1, 5) * rng.choice((-1, 1), 2)

    return mutate


def _restarted(tables: Tables, rng: np.random.Generator) -> None:
    """From some row on the odometry counts from zero again."""
    rows = tables["odometry"]
    first = int(rng.uniform(0.2, 0.8) * len(rows))
    rows[first:, 1:] -= rows[first, 1:]


def _stuck(tables: Tables, rng: np.random.Generator) -> None:
    """For 5 to 20 s the odometry repeats its pose."""
    rows = tables["odometry"]
    count = int(rng.uniform(50, 200))
    first = int(rng.integers(50, len(rows) - count))
    rows[first : first + count, 1:] = rows[first, 1:]


def _spike(table: str, column: int, by: float) -> Mutation:
    """One to three entries far off."""

    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        rows = rng.integers(1, len(tables[table]), size=rng.integers(1, 4))
        tables[table][rows, column] += rng.choice((-1, 1)) * by

    return mutate


def _wrong_ids(tables: Tables, rng: np.random.Generator) -> None:
    """1 to 20 % of the ids are another landmark's."""
    ids = tables["detections"][:, 1]
    wrong = rng.random(len(ids)) < rng.uniform(0.01, 0.2)
    ids[wrong] = (ids[wrong] + rng.integers(1, 15, wrong.sum())) % 15


def _renumbered(tables: Tables, rng: np.random.Generator) -> None:
    """From some row on the ids are dealt anew."""
    ids = tables["detections"][:, 1]
    first = int(rng.uniform(0.2, 0.8) * len(ids))
    ids[first:] = rng.permutation(15)[ids[first:].astype(int)]


def _merged(tables: Tables, rng: np.random.Generator) -> None:
    """Two landmarks have one id."""
    ids = tables["detections"][:, 1]
    one, other = rng.choice(np.unique(ids), 2, replace=False)
    ids[ids == one] = other


def _drifting(tables: Tables, rng: np.random.Generator) -> None:
    """The sensor's clock runs 1 to 10 % fast."""
    tables["detections"][:, 0] *= 1 + rng.uniform(0.01, 0.1)


def _together(*mutations: Mutation) -> Mutation:
    def mutate(tables: Tables, rng: np.random.Generator) -> None:
        for one in mutations:
            one(tables, rng)

    return mutate


DEGREES, MILLI = 180 / np.pi, 1000.0
MUTATIONS: dict[str, Mutation] = {
    "odometry: hole": _hole("odometry"),
    "odometry: ends early": _part("odometry", early=True),
    "odometry: begins late": _part("odometry", early=False),
    "odometry: degrees": _scaled("odometry", 3, DEGREES),
    "odometry: millimetres": _together(_scaled("odometry", 1, MILLI), _scaled("odometry", 2, MILLI)),
    "odometry: milliseconds": _scaled("odometry", 0, MILLI),
    "odometry: mirrored": _scaled("odometry", 3, -1.0),
    "odometry: x and y swapped": _swapped("odometry", 1, 2),
    "odometry: jump": _jump("odometry"),
    "odometry: counts anew": _restarted,
    "odometry: stuck": _stuck,
    "odometry: heading spike": _spike("odometry", 3, 1.5),
    "odometry: x spike": _spike("odometry", 1, 3.0),
    "odometry: thinned": _thinned("odometry"),
    "odometry: shuffled": _shuffled("odometry"),
    "odometry: doubled": _doubled("odometry"),
    "odometry: another clock": _shifted("odometry", 0, 0.5, 200.0),
    "detections: hole": _hole("detections"),
    "detections: degrees": _scaled("detections", 3, DEGREES),
    "detections: millimetres": _scaled("detections", 2, MILLI),
    "detections: feet": _scaled("detections", 2, 3.28),
    "detections: milliseconds": _scaled("detections", 0, MILLI),
    "detections: mirrored": _scaled("detections", 3, -1.0),
    "detections: mounted askew": _shifted("detections", 3, 0.2, 1.5),
    "detections: late": _shifted("detections", 0, 0.5, 5.0),
    "detections: clock drifts": _drifting,
    "detections: wrong ids": _wrong_ids,
    "detections: ids anew": _renumbered,
    "detections: ids merged": _merged,
    "detections: range spike": _spike("detections", 2, 4.0),
    "detections: bearing spike": _spike("detections", 3, 0.6),
    "detections: thinned": _thinned("detections"),
    "detections: shuffled": _shuffled("detections"),
    "detections: range and bearing swapped": _swapped("detections", 2, 3),
    "truth: another clock": _shifted("truth", 0, 0.5, 200.0),
    "truth: degrees": _scaled("truth", 3, DEGREES),
    "truth: millimetres": _together(_scaled("truth", 1, MILLI), _scaled("truth", 2, MILLI)),
    "truth: mirrored": _scaled("truth", 2, -1.0),
    "truth: jump": _jump("truth"),
    "truth: hole": _hole("truth"),
    "truth: ends early": _part("truth", early=True),
    "all: milliseconds": _together(*(_scaled(name, 0, MILLI) for name in TABLES)),
}

"""Mutated logs: each has to be refused, to be remarked on, or to give the result of the unmutated one.

As a program it tries that many: python tests/support/mutations.py 2000 (make study-mutations). It prints how each kind
ended and every mutation that made the result worse in silence, and exits with status 1 if there is one.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import slamduel
from fuzzing import damaged
from slamduel.backends import registry
from slamduel.bench.measure.cell import Job, run_on
from slamduel.datasets.remarks import remarks
from slamduel.frontend.errors import InputError
from slamduel.frontend.factors import Dataset
from slamduel.frontend.se2 import Array, compose, wrap

WORSE = 2.0  # times the unmutated ATE
BAND = 0.3, 3.0  # of NEES over its dimension, a multiple of the unmutated one if that is above 1
LESS = ("hole", "ends early", "begins late", "thinned", "damaged")  # data that is missing may cost accuracy
REUSED = 20  # mutations of one drive
TABLES = {"odometry": "t,x,y,heading", "detections": "t,id,range,bearing", "truth": "t,x,y,heading"}
ENDS = ("refused", "remarked", "same", "worse", "crashed")

Tables = dict[str, Array]
Mutation = Callable[[Tables, np.random.Generator], None]


class Ended(NamedTuple):
    """How one mutation ended."""

    kind: str  # of the mutation
    end: str  # of ENDS
    words: str  # the refusal, the remark, or the numbers


def drive(rng: np.random.Generator) -> Tables:
    """A robot drives a rounded path for 60 s among 15 landmarks, with the default noise of CSV logs."""
    t = np.arange(0, 60, 0.1)
    speed, turning = 0.6 + 0.2 * np.sin(t / 7), 0.25 + 0.35 * np.sin(t / 9)
    motions = np.column_stack((speed * 0.1, 0 * t, turning * 0.1))
    way, turn = np.abs(motions[:, 0]), np.abs(motions[:, 2])
    wrong = motions.copy()
    wrong[:, 0] += rng.normal(0, 0.05, len(t)) * np.sqrt(way)
    wrong[:, 2] += rng.normal(0, 1, len(t)) * np.sqrt(0.03**2 * way + 0.05**2 * turn)
    truth, odometry = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for k in range(1, len(t)):
        truth[k], odometry[k] = compose(truth[k - 1], motions[k]), compose(odometry[k - 1], wrong[k])
    places = truth[rng.integers(len(t), size=15), :2] + rng.normal(0, 2.0, (15, 2))
    seen: list[Array] = []
    for k in range(0, len(t), 5):
        x, y = (places - truth[k, :2]).T
        distance, bearing = np.hypot(x, y), wrap(np.arctan2(y, x) - truth[k, 2])
        near = np.flatnonzero((distance < 6) & (distance > 0.5) & (np.abs(bearing) < 1.2))
        z = distance[near] + rng.normal(0, 0.1, len(near)), wrap(bearing[near] + rng.normal(0, 0.02, len(near)))
        seen.append(np.column_stack((np.full(len(near), t[k]), near.astype(np.float64), *z)))
    return {
        "odometry": np.column_stack((t, odometry)),
        "detections": np.concatenate(seen),
        "truth": np.column_stack((t, truth)),
    }


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


def texts(tables: Tables) -> dict[str, str]:
    """The CSV files of the tables."""
    return {name: "\n".join([TABLES[name], *(_row(name, row) for row in rows)]) + "\n" for name, rows in tables.items()}


def _row(name: str, row: Array) -> str:
    return ",".join(str(int(x)) if name == "detections" and k == 1 else f"{x:.9g}" for k, x in enumerate(row))


def written(folder: Path, files: dict[str, str | bytes]) -> str:
    """Writes CSV files; returns the dataset's name with its options."""
    for name, content in files.items():
        path = folder / f"{name}.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return f"csv[{','.join(f'{name}={folder / name}.csv' for name in files)}]"


def result(made: Dataset) -> tuple[dict[str, Any], str]:
    """The row of an EKF on the log, and everything that is said of log and cell."""
    builder = registry.find("ekf")
    found = run_on(Job("ekf", "ekf", builder.options(), 0, 8000), lambda: made.log, lambda: made.truth)
    said = [*remarks(made), found.reason, *([f"ends as {found.status}"] if found.status != "done" else [])]
    return found.row, "; ".join(filter(None, said))


def judged(kind: str, name: str, right: dict[str, Any]) -> Ended:
    """Runs the dataset and compares with the unmutated row `right`."""
    try:
        made = slamduel.load(name)
    except InputError as error:
        return Ended(kind, "refused", str(error))
    except Exception as error:
        return Ended(kind, "crashed", f"{type(error).__name__}: {error}")
    row, said = result(made)
    if said:
        return Ended(kind, "remarked", said)
    numbers = f"ATE {row.get('ate_m')}, NEES {row.get('nees')}; unmutated {right['ate_m']}, {right['nees']}"
    if row.get("nees") is None or row.get("ate_m") is None:
        return Ended(kind, "worse", f"no NEES or no ATE: {numbers}")
    off = not BAND[0] <= row["nees"] <= BAND[1] * max(1.0, right["nees"])
    worse = off or (row["ate_m"] > WORSE * right["ate_m"] and not kind.endswith(LESS))
    return Ended(kind, "worse" if worse else "same", numbers)


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many logs, every kind in turn; each sixth is a damaged file instead."""
    kinds = list(MUTATIONS)
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        folder = Path(scratch)
        clean, right = Tables(), dict[str, Any]()
        for case in range(cases):
            rng = np.random.default_rng([seed, case])
            if case % REUSED == 0:
                clean = drive(rng)
                right, said = result(slamduel.load(written(folder, dict(texts(clean)))))
                assert not said, said
                assert BAND[0] <= right["nees"] <= BAND[1], right["nees"]
            if case % 6 == 5:
                files: dict[str, str | bytes] = dict(texts(clean))
                victim = list(files)[case // 6 % len(files)]
                (files[victim],) = list(damaged(texts(clean)[victim].encode(), case // 6 % 6 + 1, case))[-1:]
                yield judged(f"{victim}: damaged", written(folder, files), right)
                continue
            kind = kinds[(case - case // 6) % len(kinds)]
            mutated = {name: rows.copy() for name, rows in clean.items()}
            MUTATIONS[kind](mutated, rng)
            yield judged(kind, written(folder, dict(texts(mutated))), right)


def main(cases: int) -> int:
    """Tries the mutations and prints how they ended."""
    counts: dict[str, Counter[str]] = {}
    silent: list[Ended] = []
    for ended in tried(cases):
        counts.setdefault(ended.kind, Counter())[ended.end] += 1
        if ended.end in ("worse", "crashed"):
            silent.append(ended)
    print(f"{'':40}" + "".join(f"{end:>10}" for end in ENDS))
    for kind, found in sorted(counts.items()):
        print(f"{kind:40}" + "".join(f"{found[end] or '':>10}" for end in ENDS))
    total = sum(counts.values(), Counter[str]())
    print(f"{'all':40}" + "".join(f"{total[end]:>10}" for end in ENDS))
    for ended in silent:
        print(f"{ended.end}: {ended.kind}: {ended.words}")
    return 1 if silent else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))

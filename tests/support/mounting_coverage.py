"""How often `bench noise` finds a sensor's place and delay within their 95 % intervals: `make study-mountings`.

    python -m mounting_coverage [LOGS] [WORLD ...]

A sensor is planted 5 cm ahead and 50 ms late: on simulated worlds by the true path, which no odometry is asked for; on
MRCLAM, where SLAMDUEL_DATA has it, by its files' times, and either way from one log to the next. There the estimate
without that is taken off, as its own place and clock are not known.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import binomtest

from planted_errors import fit_of
from slamduel.bench.plan.load import load
from slamduel.bench.systematic.estimated import Estimated
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.mounting import Mounting, from_body
from slamduel.core.se2 import between

AHEAD, LATE = 0.05, 0.05  # m, s
WORLDS = ("circle", "aruco-room", "mrclam")
EXPECTED = 0.93
"""Share of intervals, which the share found may be below by chance alone."""

Found = dict[str, Estimated]


def late(log: Log, truth: Truth, seconds: float) -> Log:
    """The log of a sensor whose pictures were taken that long before the steps that they are of."""
    poses = np.column_stack((truth.poses[:, :2], np.unwrap(truth.poses[:, 2])))
    way = CubicSpline(truth.t, poses)
    z, cov = from_body(log.z, log.z_cov, between(way(log.t - seconds), way(log.t))[log.sighting_step])
    return replace(log, z=z, z_cov=cov)


def ahead(log: Log, metres: float) -> Log:
    """The log of a sensor that sits so much ahead."""
    return log.of_sensor(Mounting(-metres))


def simulated(world: str, logs: int) -> Iterator[tuple[str, str, Estimated | None, float]]:
    """Yields by what it is found, the error, its estimate and what was planted."""
    for seed in range(logs):
        dataset = load(world, seed)
        assert dataset.truth is not None
        log = ahead(late(dataset.log, dataset.truth, LATE), AHEAD)
        for by_truth in (True, False):
            yield from _compared(dataset._replace(log=log), by_truth=by_truth)


def _compared(
    dataset: Dataset, *, by_truth: bool, without: Dataset | None = None, x: float = AHEAD, delay: float = LATE
) -> Iterator[tuple[str, str, Estimated | None, float]]:
    found = _estimates(dataset, by_truth=by_truth)
    own = {} if without is None else _estimates(without, by_truth=by_truth)
    for name, planted in (("x", x), ("delay", delay)):
        one, before = found.get(name), own.get(name)
        if without is not None:
            one = None if one is None or before is None else Estimated(*(value - before.value for value in one))
        yield "by truth" if by_truth else "without it", name, one, planted


def _estimates(dataset: Dataset, *, by_truth: bool) -> Found:
    try:
        return dict(fit_of(dataset, by_truth=by_truth).estimates)
    except AssertionError:  # nothing is found at all
        return {}


def mrclam(logs: int) -> Iterator[tuple[str, str, Estimated | None, float]]:
    """As for simulated worlds, of set 6: five robots, and four ways to plant."""
    folder = Path(os.environ["SLAMDUEL_DATA"]) / "mrclam" / "MRCLAM_Dataset6"
    for k in range(min(logs, 20)):
        robot, x, delay = k % 5 + 1, AHEAD * (-1) ** (k // 5), LATE * (-1) ** (k // 10)
        plain = load(f"mrclam[robot={robot},path={folder}]")
        with tempfile.TemporaryDirectory() as name:
            copy = Path(name) / folder.name
            _with_late_sightings(folder, copy, robot, delay)
            planted = load(f"mrclam[robot={robot},path={copy}]")
        planted = planted._replace(log=ahead(planted.log, x))
        for by_truth in (True, False):
            yield from _compared(planted, by_truth=by_truth, without=plain, x=x, delay=delay)


def _with_late_sightings(folder: Path, copy: Path, robot: int, seconds: float) -> None:
    copy.mkdir()
    for file in folder.iterdir():
        (copy / file.name).symlink_to(file)
    sightings = copy / f"Robot{robot}_Measurement.dat"
    lines = sightings.read_text().splitlines()
    sightings.unlink()
    told = (line if line.startswith("#") else _later(line, seconds) for line in lines)
    sightings.write_text("\n".join(told) + "\n")


def _later(line: str, seconds: float) -> str:
    time, *rest = line.split()
    return " ".join((f"{float(time) + seconds:.6f}", *rest))


def main(logs: int, worlds: list[str]) -> int:
    """Prints the shares with their 95 % intervals; 1 where one is lower than chance has it."""
    low = False
    for world in worlds:
        if world == "mrclam" and "SLAMDUEL_DATA" not in os.environ:
            print("mrclam: left out, SLAMDUEL_DATA is not set")
            continue
        inside: dict[tuple[str, str], list[bool]] = {}
        off: dict[tuple[str, str], list[float]] = {}
        count = 0
        for by, name, one, planted in mrclam(logs) if world == "mrclam" else simulated(world, logs):
            held, errors = inside.setdefault((by, name), []), off.setdefault((by, name), [])
            count += (by, name) == ("by truth", "x")
            if one is not None:
                held.append(one.low <= planted <= one.high)
                errors.append(one.value - planted)
        for (by, name), held in inside.items():
            if not held:
                print(f"{world}, {by}: {name} is not told by any of {count} logs")
                continue
            share = binomtest(sum(held), len(held)).proportion_ci(method="exact")
            mean, size = np.mean(off[by, name]), np.std(off[by, name])
            low |= share.high < EXPECTED
            print(
                f"{world}, {by}: {name} told by {len(held)} of {count} logs, inside in {sum(held) / len(held):.1%} "
                f"({share.low:.1%} to {share.high:.1%}); off by {1e3 * mean:.2f} ± {1e3 * size:.2f} thousandths",
                flush=True,
            )
    return int(low)


if __name__ == "__main__":
    asked = sys.argv[1:]
    sys.exit(main(int(asked[0]) if asked else 200, asked[1:] or list(WORLDS)))

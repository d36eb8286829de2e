"""Landmarks that are elsewhere are named: swapped and far places, ids at two places; and none of a good log."""

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import recorded
from slamduel.bench.contradiction.places import elsewhere
from slamduel.bench.contradiction.remark import remarks
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Map, Truth
from tiers import first_quick

WORLDS = ("circle", "bailey", "city[landmarks=60]", "matlab-report")
SEEDS = first_quick(range(8))
CLEAN = 25  # logs of each world

NOISE = {"as it is": 1.0, "jittered": 1.0, "stated too small": 1 / 9, "stated too large": 9.0}


class Planted(NamedTuple):
    """A log with a mistake and the words that name it."""

    dataset: Dataset
    words: list[str]


def perturbed(log: Log, noise: str, rng: np.random.Generator) -> Log:
    jitter = 1e-6 * rng.standard_normal(log.z.shape) if noise == "jittered" else 0.0
    return replace(log, z=log.z + jitter, z_cov=NOISE[noise] * log.z_cov)


def places(log: Log, truth: Truth, change: Callable[[np.ndarray, np.ndarray], None]) -> Dataset:
    """The log with the true places of landmarks changed: of all in the map, the rows that are sighted are given."""
    assert truth.map is not None
    xy = truth.map.xy.copy()
    change(xy, np.flatnonzero(np.isin(truth.map.ids, log.ids)))
    return Dataset(log, truth._replace(map=Map(truth.map.ids, xy, None)))


def swapped(log: Log, truth: Truth, rng: np.random.Generator) -> Planted:
    chosen: list[int] = []

    def change(xy: np.ndarray, seen: np.ndarray) -> None:
        chosen.extend(rng.choice(seen, 2, replace=False).tolist())
        xy[chosen] = xy[chosen[::-1]]

    made = places(log, truth, change)
    assert truth.map is not None
    one, other = truth.map.ids[sorted(chosen)].tolist()
    return Planted(made, [f"landmarks {one} and {other} look swapped", f"landmarks {other} and {one} look swapped"])


def far(log: Log, truth: Truth, rng: np.random.Generator) -> Planted:
    chosen: list[int] = []

    def change(xy: np.ndarray, seen: np.ndarray) -> None:
        chosen.append(int(rng.choice(seen)))
        xy[chosen[0]] += 3 * np.ptp(xy, axis=0).max()

    made = places(log, truth, change)
    assert truth.map is not None
    return Planted(made, [f"the true place of landmark {truth.map.ids[chosen[0]]} is not where its sightings have it"])


def doubled(log: Log, truth: Truth, rng: np.random.Generator) -> Planted:
    assert truth.map is not None
    one, other = rng.choice(np.unique(log.ids), 2, replace=False).tolist()
    kept = truth.map.ids != other
    known = Map(truth.map.ids[kept], truth.map.xy[kept], None)
    twice = replace(log, ids=np.where(log.ids == other, one, log.ids))
    return Planted(Dataset(twice, truth._replace(map=known)), [f"id {one} is sighted at two places"])


MISTAKES = {"swapped": swapped, "far": far, "at two places": doubled}


def pathless(truth: Truth) -> Truth:
    return truth._replace(t=truth.t[:0], poses=truth.poses[:0])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_whatever_noise_is_stated(mistake: str, world: str, seed: int) -> None:
    for noise in NOISE if seed else ("as it is",):
        rng = np.random.default_rng([seed, 5])
        log, truth = load(world, seed)
        assert truth is not None
        (log, truth), words = MISTAKES[mistake](perturbed(log, noise, rng), truth, rng)
        assert truth is not None
        for known in (truth, pathless(truth)):
            found = elsewhere(log, known)
            said = [*found.places, *found.twice]
            assert len(said) == 1 or (mistake == "at two places" and said), (noise, said)
            assert any(one in two for one in words for two in said), (noise, said)


@pytest.mark.parametrize("seed", first_quick(range(CLEAN)))
@pytest.mark.parametrize("world", WORLDS)
def test_nothing_is_said_of_a_good_log(world: str, seed: int) -> None:
    log, truth = load(world, seed)
    assert truth is not None
    for noise in NOISE if seed else ("as it is",):
        noisy = perturbed(log, noise, np.random.default_rng(seed))
        for known in (truth, pathless(truth)):
            found = elsewhere(noisy, known)
            assert not found.places
            assert not found.twice


def test_three_that_are_permuted_are_named() -> None:
    log, truth = load("circle", 0)
    assert truth is not None

    def change(xy: np.ndarray, seen: np.ndarray) -> None:
        xy[seen[[2, 5, 9]]] = xy[seen[[5, 9, 2]]]

    (said,) = elsewhere(*places(log, truth, change)).places
    ids = truth.map.ids[[2, 5, 9]].tolist() if truth.map is not None else []
    assert all(str(one) in said.split(" look permuted")[0] for one in ids)


def test_a_landmark_that_moves_is_not_at_two_places() -> None:
    log, truth = load("circle", 1)
    assert truth is not None
    at = log.sighting_step / len(log)
    moving = log.ids == log.ids[0]
    z = log.z + np.where(moving, 3 * at, 0.0)[:, None] * [1.0, 0.0]
    assert elsewhere(replace(log, z=z), truth).twice == []


def test_the_swapped_tags_of_a_published_map_are_named(tmp_path: Path) -> None:
    """MBot: detections x right, y down, z ahead, mm; times in microseconds; its owner's map has 5 and 6 swapped."""
    folder = recorded.at_hand("mbot")
    tables = {"odometry": "log_output_odom.csv.gz", "detections": "log_output_apriltag.csv.gz"}
    for name, file in tables.items():
        rows = [line.split(",") for line in gzip.decompress((folder / file).read_bytes()).decode().splitlines()[1:]]
        if name == "odometry":
            lines = ["t,x,y,heading", *(f"{int(row[0]) / 1e6:.6f},{','.join(row[2:])}" for row in rows)]
        else:
            seen = [(int(row[0]) / 1e6, row[2], float(row[5]) / 1e3, -float(row[3]) / 1e3) for row in rows]
            lines = ["t,id,x,y", *(f"{t:.6f},{name},{ahead},{left}" for t, name, ahead, left in seen)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    files = ",".join(f"{name}={tmp_path / name}.csv" for name in tables)
    (said,) = remarks(load(f"csv[{files},landmarks={folder / 'landmarks.csv'}]"))
    assert said.startswith("the true places of landmarks 5 and 6 look swapped: exchanged, the error of the map falls")
    before, after = (float(word) for word in said.replace(" m", "").split(" falls from ")[1].split(" to "))
    assert before == pytest.approx(0.206, abs=0.005)
    assert after < 0.06

"""Logs with the mistakes that people make: each is named, and nothing is said of a log without."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mistaken_logs import MISTAKES, drawn, outcome
from slamduel.bench.contradiction.explain import contradiction
from slamduel.bench.contradiction.mistakes import MISTAKES as MISTAKES_TRIED
from slamduel.bench.contradiction.remark import contradictions, explained, remarks
from slamduel.core.factors import Dataset
from slamduel.datasets.registry import find

QUICK = ("bearings to the right", "motions in the world's frame", "headings clockwise from north", "one wheel stuck")
EMBEDDED = (
    pytest.param("aruco-room", marks=pytest.mark.slow),
    "bailey",
    "city",
    "linear",
    "matlab-report",
    "victoria-park",
)


@pytest.mark.parametrize(
    "mistake", [one if one in QUICK else pytest.param(one, marks=pytest.mark.slow) for one in MISTAKES]
)
@pytest.mark.parametrize("seed", [2000, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2001, 2002))])
def test_a_mistake_is_named(mistake: str, seed: int, tmp_path: Path):
    found = outcome(seed, mistake, tmp_path)
    assert not found.another
    if mistake != "a clock that is late":  # of which a small delay is within the noise
        assert found.named


@pytest.mark.parametrize("seeds", [range(3000, 3006), pytest.param(range(3006, 3100), marks=pytest.mark.slow)])
def test_nothing_is_said_of_a_good_log(seeds: range, tmp_path: Path):
    assert not [said for seed in seeds for said in remarks(drawn(seed, None, tmp_path)[0])]


@pytest.mark.parametrize("name", EMBEDDED)
def test_nothing_is_said_of_logs_that_come_along(name: str):
    source = find(name)
    assert not list(contradictions(source.make(source.options(), np.random.default_rng(0))))


def test_outliers_are_no_contradiction(tmp_path: Path):
    (log, _), _ = drawn(3000, None, tmp_path)
    z, rng = log.z.copy(), np.random.default_rng(0)
    wrong = rng.choice(len(z), len(z) // 15, replace=False)
    z[wrong] = np.column_stack((rng.uniform(1, 20, len(wrong)), rng.uniform(-3, 3, len(wrong))))
    assert not list(contradictions(Dataset(replace(log, z=z), None)))


def test_noise_that_is_stated_too_small_is_said_without_a_mistake(tmp_path: Path):
    (log, _), _ = drawn(3001, None, tmp_path)
    smaller = replace(log, z_cov=log.z_cov / 4, delta_cov=log.delta_cov / 4)
    (said,) = contradictions(Dataset(smaller, None))
    found = re.search(r"noise is ([\d.]+) times what is stated, ids", said)
    assert found
    assert 1.8 < float(found[1]) < 2.2


def test_a_log_without_too_many_measurements_is_left_alone(tmp_path: Path):
    (log, _), _ = drawn(3000, None, tmp_path)
    once = replace(log, ids=np.arange(len(log.ids)))
    assert contradiction(once) is None
    assert "too few" in explained("it", Dataset(once, None))


def test_every_mistake_is_tried_on_a_good_log_too(tmp_path: Path):
    dataset, _ = drawn(3000, None, tmp_path)
    first, *rest, noise = explained("drive", dataset).splitlines()
    assert "is noise" in noise
    j = [float(line.split()[0].replace(",", "")) for line in rest]
    assert re.match(r"drive: J is (0\.[89]|1\.[01])", first)
    assert len(j) == len(MISTAKES_TRIED) - 1
    assert min(j) == pytest.approx(j[0], rel=0.2)

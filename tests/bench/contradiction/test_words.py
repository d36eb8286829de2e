"""Faults are planted, and what is said names them, their number and what to do."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mistaken_logs import drawn
from slamduel.bench.contradiction.outliers import OFTEN
from slamduel.bench.contradiction.places import elsewhere
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Map, Truth

SEEDS = (3000, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3001, 3008)))


def seen_most(log: Log, number: int) -> list[int]:
    ids, count = np.unique(log.ids, return_counts=True)
    return sorted(ids[np.argsort(-count, kind="stable")[:number]].tolist())


def astray(log: Log, landmarks: list[int], seed: int, share: float = 0.6) -> Log:
    """The sightings of some landmarks, a share of them, are of places anywhere."""
    rng, z = np.random.default_rng(seed), log.z.copy()
    wrong = np.isin(log.ids, landmarks) & (rng.random(len(z)) < share)
    z[wrong] = np.column_stack((rng.uniform(1, 20, wrong.sum()), rng.uniform(-3, 3, wrong.sum())))
    return replace(log, z=z)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("number", [1, 2])
def test_landmarks_whose_sightings_do_not_fit_are_named(number: int, seed: int, tmp_path: Path) -> None:
    (log, _), _ = drawn(seed, None, tmp_path)
    landmarks = seen_most(log, number)
    said = [
        one for one in remarked(Dataset(astray(log, landmarks, seed), None)).outliers if "sightings that were" in one
    ]
    (said,) = said
    found = re.match(
        r"of landmarks? ([\d, and]+), ([\d.]+) % of the ([\d,]+) sightings that were looked at do not", said
    )
    assert found
    assert sorted(int(one) for one in re.findall(r"\d+", found[1])) == landmarks
    assert (
        float(found[2]) > 100 * OFTEN
    )  # 60 are wrong, and right ones do not fit a place that wrong ones have pulled away
    where = "it moves, or another landmark has its id" if number == 1 else "they move, or two landmarks have one id"
    assert said.endswith(f"do not fit the others, as where {where}")
    assert (" landmarks " in said) == (number > 1)


@pytest.mark.parametrize("seed", SEEDS)
def test_ids_that_are_wrong_throughout_are_a_contradiction_with_that_cause(seed: int, tmp_path: Path) -> None:
    (log, _), _ = drawn(seed, None, tmp_path)
    rng = np.random.default_rng(seed)
    (said,) = remarked(Dataset(replace(log, ids=rng.choice(np.unique(log.ids), len(log.ids))), None)).contradictions
    assert said.startswith("the measurements contradict one another: at the optimum J is ")
    assert "the sensor sits elsewhere or is late (bench noise tells), " in said
    assert "ids are wrong or landmarks move" in said
    assert said.endswith(
        "or a frame, a sign, a unit or a clock is wrong; bench validate --explain tries the usual mistakes"
    )
    assert "loop closures are false" not in said  # there are none


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 8))])
def test_false_loop_closures_are_a_cause_where_there_are_loops_alone(seed: int) -> None:
    log = load("patrol[steps=600,landmarks=0,loops=3]", seed).log
    assert len(log.loop_to)
    rng = np.random.default_rng(seed)
    delta = log.loop_delta + rng.uniform(3, 9, log.loop_delta.shape) * np.sign(
        rng.standard_normal(log.loop_delta.shape)
    )
    none = log.ids[:0]
    alone = Log.from_arrays(
        "loops", log.prior, log.t, log.delta, log.delta_cov, none, none, log.z[:0], log.z_cov[:0],
        loop_step=np.repeat(np.arange(len(log)), np.diff(log.loop_first)), loop_to=log.loop_to, loop_delta=delta,
        loop_cov=log.loop_cov,
    )  # fmt: skip
    (said,) = remarked(Dataset(alone, None)).contradictions
    assert "loop closures are false, or a frame" in said
    assert "ids are wrong" not in said


def test_several_landmarks_with_wrong_places_are_named_with_their_errors() -> None:
    log, truth = load("circle", 0)
    assert truth is not None
    assert truth.map is not None
    xy, seen = truth.map.xy.copy(), np.flatnonzero(np.isin(truth.map.ids, log.ids))
    rows = seen[[2, 9]]
    xy[rows] += [(60.0, 0.0), (0.0, 90.0)]
    known = truth._replace(map=Map(truth.map.ids, xy, None))
    for one in (known, Truth(known.t[:0], known.poses[:0], known.map, None, "truth")):
        (said,) = elsewhere(log, one).places
        found = re.match(
            r"the true places of landmarks ([\d, and]+) are not where their sightings have them: they are", said
        )
        assert found
        assert sorted(int(name) for name in re.findall(r"\d+", found[1])) == truth.map.ids[rows].tolist()
        sizes = re.search(
            r"they are ([\d.]+) to ([\d.]+) m off, where the other (\d+) are ([\d.]+) m off \(median\)", said
        )
        assert sizes
        least, most, others, typical = (float(size) for size in sizes.groups())
        assert least == pytest.approx(60, abs=1.5)
        assert most == pytest.approx(90, abs=1.5)
        assert others == len(seen) - 2
        assert typical < 1

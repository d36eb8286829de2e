"""Noise drawn anew: as stated, the same for a seed, another for each, around the same truth on the same graph."""

from dataclasses import replace
from functools import cache
from itertools import starmap

import numpy as np
import pytest
from scipy import stats

from chi2_at_truth import Squared, squared
from laps import laps
from partial_logs import partial_log
from random_logs import random_log
from recorded import at_hand
from refusals import refused
from slamduel.bench.plan.load import load
from slamduel.bench.plan.spec import dataset_variants
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.factors.check import problems
from slamduel.datasets import registry
from slamduel.datasets.cache import generator
from slamduel.datasets.false_loops import FALSE_NOTE, planted
from slamduel.datasets.on_demand.ready import made_ready
from slamduel.datasets.redrawn import DRAWN_NOTE, redrawn
from slamduel.datasets.truth import digest

KEPT = ("t", "delta_cov", "sighting_first", "ids", "z_cov", "loop_first", "loop_to", "loop_cov")
DRAWN = ("delta", "loop_delta", "z")


@cache
def world(kind: str) -> Dataset:
    if kind == "laps":
        return laps(np.random.default_rng(1))
    log, truth = random_log(np.random.default_rng(2), 300, 30)
    return Dataset(log, truth)


def anew(kind: str, seed: int) -> Dataset:
    return redrawn(world(kind), np.random.default_rng(seed))


def same(a: Log, b: Log, column: str) -> bool:
    return np.array_equal(getattr(a, column), getattr(b, column), equal_nan=True)


@pytest.mark.parametrize("kind", ["laps", "landmarks"])
def test_graph_covariances_and_truth_stay_and_all_measurements_are_others(kind: str) -> None:
    log, truth = world(kind)
    drawn, true = anew(kind, 5)
    assert list(problems(drawn)) == []
    assert true is truth
    assert all(same(log, drawn, column) for column in KEPT)
    for column in DRAWN:
        old, new = getattr(log, column), getattr(drawn, column)
        assert not (old == new).any()
    assert (log.prior.pose != drawn.prior.pose).all()
    assert DRAWN_NOTE in drawn.notes


def test_a_seed_draws_the_same_bits_and_another_seed_others() -> None:
    assert anew("laps", 3).log.digest == anew("laps", 3).log.digest
    assert len({anew("laps", seed).log.digest for seed in range(20)}) == 20


@pytest.mark.parametrize("kind", ["laps", "landmarks"])
def test_squared_errors_at_the_truth_are_chi_square_distributed(kind: str) -> None:
    """Of 30 draws; each kind of factor by a Kolmogorov-Smirnov test whose false alarms are one in 10,000."""
    draws = [squared(anew(kind, seed)) for seed in range(30)]
    for factors, freedom in zip(starmap(np.concatenate, _by_kind(draws)), (3, 3, 2), strict=True):
        if len(factors):
            assert stats.kstest(factors, stats.chi2(freedom).cdf).pvalue > 1e-4
    total = sum(one.mean * one.freedom for one in draws)
    freedom = sum(one.freedom for one in draws)
    assert abs(total - freedom) < 6 * np.sqrt(2 * freedom)


def _by_kind(draws: list[Squared]) -> list[tuple[list[np.ndarray]]]:
    return [(list(kind),) for kind in zip(*draws, strict=True)]


def test_errors_of_different_factors_are_independent() -> None:
    """Correlations of normalised errors between neighbours, over 200 draws, are those of white noise."""
    found = []
    for seed in range(200):
        log, truth = anew("laps", seed)
        assert truth is not None
        errors = log.delta[1:, 0] - world("laps").log.delta[1:, 0]
        found.append(errors / np.sqrt(log.delta_cov[1:, 0, 0]))
    white = np.array(found) - np.mean(found, axis=0)
    neighbours = (white[:, 1:] * white[:, :-1]).mean()
    assert abs(neighbours) < 6 / np.sqrt(white.size)


def test_false_loops_stay_as_they_are() -> None:
    faulty = planted(world("laps"), 0.2, np.random.default_rng(0))
    assert faulty.truth is not None
    false = faulty.truth.false_loops
    assert false is not None
    log, _ = redrawn(faulty, np.random.default_rng(1))
    stays = (log.loop_delta == faulty.log.loop_delta).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(stays), false)
    more = planted(faulty, 0.1, np.random.default_rng(2))
    assert more.truth is not None
    assert more.truth.false_loops is not None
    assert len(more.truth.false_loops) == len(false) + round(0.1 * len(log.loop_to))
    known = set(map(bytes, faulty.log.loop_delta[false]))
    assert known < set(map(bytes, more.log.loop_delta[more.truth.false_loops]))


def test_a_log_without_the_truth_of_every_factor_is_refused() -> None:
    log, truth = world("landmarks")
    assert truth is not None
    assert truth.map is not None
    rng = np.random.default_rng(0)
    refused("no true pose of step 0", redrawn, Dataset(log, None), rng)
    refused("no true pose of step 0", redrawn, Dataset(log, truth._replace(kind="reference")), rng)
    part = truth._replace(t=truth.t[:-1], poses=truth.poses[:-1])
    refused(f"no true pose of step {len(log) - 1}", redrawn, Dataset(log, part), rng)
    refused("whose true place is not known", redrawn, Dataset(log, truth._replace(map=None)), rng)
    far = replace(log, z_cov=1e6 * log.z_cov)
    refused("an error takes the range of sighting", redrawn, Dataset(far, truth), rng)


def test_the_option_draws_one_log_per_seed_and_without_it_there_is_one() -> None:
    (plain,) = dataset_variants("city10000-ambiguous[ambiguous=first]")
    (drawn,) = dataset_variants("city10000-ambiguous[ambiguous=first,draw=true]")
    assert (plain.numbered, drawn.numbered) == (False, True)
    assert (plain.seeds(range(4), random=False), drawn.seeds(range(4), random=False)) == (range(1), range(4))
    assert [str(one.log(3)) for one in (plain, drawn)] == [plain.label, f"{drawn.label}, seed 3"]
    logs = [load("city10000-ambiguous[ambiguous=first,draw=true]", seed) for seed in (0, 1, 1)]
    assert logs[0].log.digest != logs[1].log.digest
    assert logs[1].log.digest == logs[2].log.digest
    assert squared(logs[1]).mean == pytest.approx(1.0, abs=6 * np.sqrt(2 / squared(logs[1]).freedom))
    published = load("city10000-ambiguous[ambiguous=first]", 1)
    assert published.log.digest == load("city10000-ambiguous[ambiguous=first]", 0).log.digest
    assert digest_of(published) == digest_of(logs[0])
    expected = redrawn(published, generator("noise of city10000-ambiguous", 1))
    assert expected.log.digest == logs[1].log.digest


def digest_of(dataset: Dataset) -> str:
    assert isinstance(dataset.truth, Truth)
    return digest(dataset.truth)


@pytest.mark.parametrize("stem", ["manhattanOlson3500", "cityTrees10000"])
def test_a_drawn_graph_has_the_noise_that_the_published_one_states(stem: str) -> None:
    """Manhattan's own is 2.8 % above it, its drawn one is not."""
    name = {"manhattanOlson3500": "manhattan", "cityTrees10000": "city-trees10000"}[stem]
    path = f'path="{at_hand("posegraphs")}/{stem}.txt.gz"'
    for seed in range(3):
        drawn = load(f"{name}[{path},draw=true]", seed)
        found = squared(drawn)
        assert abs(found.mean - 1) < 6 * np.sqrt(2 / found.freedom)
        assert list(problems(drawn.log)) == []


def test_false_loops_are_planted_in_what_was_drawn() -> None:
    (variant,) = dataset_variants("w20000[noise=true,draw=true,false_loops=0.01]")
    log, truth = made_ready(variant.name, variant.source, variant.options, 4)
    assert truth is not None
    assert truth.false_loops is not None
    assert log.notes[FALSE_NOTE] == f"{len(truth.false_loops)} of {len(log.loop_to)}"
    assert len(truth.false_loops) == 68
    assert squared(Dataset(log, truth)).mean == pytest.approx(1.0, abs=0.02)


def test_a_name_and_its_options_tell_if_each_seed_is_another_log() -> None:
    assert [registry.seeded("w20000", given) for given in ("", "noise=true,draw=true")] == [False, True]
    assert [registry.drawable(name) for name in ("w20000", "victoria-park", "nobody's")] == [True, False, False]


def test_parts_alone_are_not_drawn() -> None:
    parts = Dataset(partial_log(), None)
    refused("draw=true: small has ranges or bearings alone", redrawn, parts, np.random.default_rng(0))

"""Growth exponents and slopes: those put in, through noise, spikes and a constant part, and none without grounds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from random_logs import random_log
from slamduel.bench.measure.cpu_time import growth_columns
from slamduel.bench.measure.growth import (
    LONG,
    MOST_ERROR,
    NO_GROWTH,
    growth,
    mapped,
    slope,
    slope_from,
    slope_mapping,
    whole_from,
)
from slamduel.core.factors import Log, Map, RangeBearing
from slamduel.core.partial import RANGE, PartialTable
from slamduel.core.se2 import Array, Ints

STEPS = 3000


def costs(rng: np.random.Generator, x: Ints, exponent: float, constant: float = 0.0, spikes: float = 1.0) -> Ints:
    """ns of each step: a constant share and a power of x, scattered by a quarter, 1 % of all steps `spikes` times."""
    mean = 1e5 * (constant + (x / x[-1]) ** exponent)
    scatter = rng.lognormal(0, 0.25, len(x)) * np.where(rng.random(len(x)) < 0.01, spikes, 1.0)
    return np.rint(mean * scatter).astype(np.int64)


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("constant", [0.0, 0.1])
def test_the_exponent_is_found_to_five_hundredths(exponent: float, constant: float) -> None:
    x = np.arange(1, STEPS + 1)
    for seed in range(5):
        found = growth(x, costs(np.random.default_rng(seed), x, exponent, constant))
        assert found.exponent == pytest.approx(exponent, abs=0.05)
        assert found.error < 0.1


def test_with_spikes_of_twenty_times_the_error_that_is_stated_holds() -> None:
    x = np.arange(1, STEPS + 1)
    off = list[float]()
    for exponent in (0.5, 1.0, 2.0):
        for seed in range(20):
            found = growth(x, costs(np.random.default_rng(100 + seed), x, exponent, 0.1, spikes=20))
            if found is not None:
                assert found.exponent == pytest.approx(exponent, abs=0.5)
                off.append(abs(found.exponent - exponent) / found.error)
    assert len(off) >= 40
    assert np.mean(np.array(off) < 2) >= 0.85  # 95 % of them, were errors normal: at most 51 of 60 in one case of 500


def test_a_constant_part_as_large_as_what_grows_is_told_apart() -> None:
    x = np.arange(1, STEPS + 1)
    for exponent in (1.0, 2.0):
        found = growth(x, costs(np.random.default_rng(1), x, exponent, 0.5))
        assert found.exponent == pytest.approx(exponent, abs=0.2)
        slope = np.polyfit(np.log(x), np.log(costs(np.random.default_rng(1), x, exponent, 0.5)), 1)[0]
        assert slope < 0.7 * exponent  # what a straight line through the logarithms makes of it


def test_rare_steps_that_grow_count_though_half_of_all_steps_cost_the_same() -> None:
    """As iSAM2's: where it closes a loop it pays for the whole past, elsewhere nothing."""
    rng = np.random.default_rng(2)
    x = np.arange(1, STEPS + 1)
    cost = np.where(np.arange(STEPS) % 4 == 0, costs(rng, x, 1.0), costs(rng, x, 0.0) // 1000)
    found = growth(x, cost)
    assert found.exponent == pytest.approx(1, abs=0.1)
    medians = [np.median(part) for part in np.array_split(cost, 10)]
    assert max(medians) < 2 * min(medians)


def test_a_disturbance_of_the_machine_changes_little() -> None:
    x = np.arange(1, STEPS + 1)
    cost = costs(np.random.default_rng(3), x, 1.0)
    cost[400:430] += 1_000_000  # ten times the most expensive step, thirty times over
    found = growth(x, cost)
    assert found is None or found.exponent == pytest.approx(1, abs=0.1)


def test_an_exact_power_is_found_exactly() -> None:
    x = np.arange(1, STEPS + 1)
    found = growth(x, 1000 * x**2)
    assert found.exponent == pytest.approx(2, abs=0.02)  # a bin's mean is not at its mean x
    assert growth(x, np.full(STEPS, 70)) == pytest.approx((0, 0), abs=0.01)


def test_against_a_map_that_grows_in_leaps() -> None:
    rng = np.random.default_rng(4)
    x = np.minimum(1 + np.cumsum(rng.random(STEPS) < 0.05), 100)
    found = growth(x, costs(rng, x, 2.0, 0.02))
    assert found.exponent == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize(
    ("x", "cost"),
    [
        (np.arange(1, 31), np.arange(1, 31)),  # few steps
        (np.full(500, 12), np.arange(500)),  # a map that does not grow
        (np.arange(100, 300), np.arange(100, 300)),  # over less than a factor of four
        (np.zeros(500, np.int64), np.arange(500)),  # no map at all
        (np.arange(1, 501), np.zeros(500, np.int64)),  # costs below the clock's own
        (np.arange(1, 501), np.random.default_rng(0).pareto(0.4, 500).astype(np.int64)),  # spikes alone
        (np.ones(1, np.int64), np.ones(1, np.int64)),
    ],
)
def test_without_grounds_for_a_fit_there_is_no_exponent(x: Ints, cost: Ints) -> None:
    assert growth(x, cost) is None


def test_an_error_that_says_nothing_is_not_stated() -> None:
    rng = np.random.default_rng(5)
    x = np.arange(1, 201)
    for spikes in (1.0, 100.0, 1000.0):
        found = [growth(x, costs(rng, x, 1.0, 1.0, spikes)) for _ in range(10)]
        assert all(one.error <= MOST_ERROR for one in found if one is not None)
    assert None in found


def counted(log: Log) -> list[int]:
    known = set[int]() if log.prior.map is None else set(log.prior.map.ids.tolist())
    sizes = list[int]()
    for step in log:
        known |= set(step.sightings.ids.tolist()) - {-1}
        sizes.append(len(known))
    return sizes


def test_the_size_of_the_map_is_what_was_sighted_or_given_by_then() -> None:
    log, truth = random_log(np.random.default_rng(6), 40, 12, radius=3.0)
    steps = list(log)
    steps[0] = steps[0]._replace(
        sightings=steps[0].sightings._replace(ids=np.full(len(steps[0].sightings.ids), -1, np.int64))
    )
    given: Array = truth.map.xy[:3]
    prior = log.prior._replace(map=Map(truth.map.ids[:3], given, None))
    for one in (log, Log.from_steps("some", log.prior, steps), Log.from_steps("given", prior, steps)):
        assert mapped(one).tolist() == counted(one)
    assert 0 < counted(log)[0] < counted(log)[-1]


def lasting(rng: np.random.Generator, steps: int, over: float) -> Array:
    """A factor of each step's cost that stays for some `over` steps, and one of its own."""
    kept = np.exp(-1 / over)
    stays: Any = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.normal(size=steps))
    return np.exp(0.25 * stays + rng.normal(0, 0.25, steps))


@pytest.mark.parametrize("exponent", [0.0, 0.7, 1.5])
@pytest.mark.parametrize("scatter", ["own", "lasting", "spikes"])
@pytest.mark.parametrize(("steps", "whole"), [(STEPS, None), (STEPS, 700), (20_000, 12_000)])
def test_the_interval_of_a_slope_covers_it_as_often_as_it_says(
    exponent: float, scatter: str, steps: int, whole: int | None
) -> None:
    number, covered, widths = np.arange(1, steps + 1), 0, list[float]()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        cost = costs(rng, number, exponent, spikes=20.0 if scatter == "spikes" else 1.0)
        if scatter == "lasting":
            cost = 1e5 * (number / steps) ** exponent * lasting(rng, steps, 20)
        found = slope(cost, slope_from(whole, steps))
        covered += found.low <= exponent <= found.high
        widths.append(found.high - found.low)
    assert 0.9 <= covered / 200 <= 0.99  # 95 % of 200, give or take some three standard deviations
    assert np.median(widths) < (0.7 if whole == 12_000 else 0.5)


def test_a_slope_is_exact_where_the_costs_are_and_wide_where_they_follow_no_power() -> None:
    k = np.arange(1.0, 20_001)
    power, bent = slope(1000 * k**0.7, 1000), slope(1e5 + 1000 * k, 1000)
    assert (power.exponent, power.high - power.low) == pytest.approx((0.7, 0), abs=1e-3)
    assert 0.7 < bent.low < bent.exponent < bent.high < 1
    assert bent.high - bent.low > 10 * (power.high - power.low)


def test_rare_steps_that_grow_make_a_slope() -> None:
    number = np.arange(1, 10_001)
    found = slope(np.where(number % 20 == 0, 1000.0 * number, 100.0), 500)
    assert found.low < 1 < found.high + 0.02
    assert found.exponent == pytest.approx(1, abs=0.05)


def test_short_logs_and_steps_that_cost_nothing_have_no_slope() -> None:
    assert slope(np.ones(LONG), 50) is not None
    assert slope(np.ones(LONG - 1), 50) is None
    assert slope(np.where(np.arange(LONG) < 200, 0, 5), 50) is None


def test_the_map_is_whole_when_all_but_one_in_a_hundred_are_known() -> None:
    sizes = np.concatenate((np.arange(1, 200), np.full(800, 199), [200]))
    assert sizes[whole_from(sizes)] == 198
    assert whole_from(np.array([3, 3, 4, 5, 5])) == 3
    assert whole_from(np.full(9, 7)) == 0  # a map that was given
    assert whole_from(np.zeros(9, np.int64)) is None
    assert [slope_from(whole, 1000) for whole in (None, 0, 60, 600, 601)] == [50, 50, 60, 600, 50]


def test_costs_of_steps_before_the_map_is_whole_have_a_slope_of_their_own() -> None:
    k = np.arange(1.0, 5001)
    cost = np.where(k <= 2000, k**0.8, 2000**0.8)
    assert slope_mapping(cost, 2000).exponent == pytest.approx(0.8, abs=1e-3)
    assert slope_mapping(cost, LONG - 1) is None  # too few
    assert slope_mapping(cost, 3001) is None  # too few afterwards
    assert slope_mapping(cost, None) is None


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("curve", "grows", "grew"),
    [
        ("level", False, False),
        ("linear", True, True),
        ("level once mapped", False, True),
        ("linear once mapped", True, False),
    ],
)
def test_growth_with_the_map_is_no_growth_with_time(seed: int, curve: str, grows: bool, grew: bool) -> None:
    """20,000 steps that cost a quarter more or less, some twenty times as much; 45 % until all is mapped."""
    steps, whole, rng = 20_000, 9_000, np.random.default_rng(seed)
    k = np.arange(1, steps + 1)
    size = {
        "level": np.full(steps, whole),
        "linear": k,
        "level once mapped": np.minimum(k, whole),
        "linear once mapped": np.maximum(k, whole),
    }[curve]
    mean = 50.0 * size / whole
    us = mean * rng.lognormal(0, 0.25, steps) * np.where(rng.random(steps) < 0.01, 20.0, 1.0)
    row = growth_columns(us, np.minimum(k // 90 + 1, 101))
    assert row["whole_from"] == pytest.approx(whole, abs=100)
    assert row["slope_from"] == row["whole_from"]
    for name, does in (("steps", grows), ("mapping", grew)):
        low, high = row[f"slope_{name}_low"], row[f"slope_{name}_high"]
        assert (low > NO_GROWTH) if does else (low < NO_GROWTH and high < 2 * NO_GROWTH)


def test_landmarks_of_ranges_alone_count() -> None:
    log, _ = random_log(np.random.default_rng(7), 40, 12, radius=3.0)
    ids, step, ranges = log.ids, log.sighting_step, np.ones(len(log.ids))
    parts = PartialTable.from_arrays(len(log), step, ids, np.full(len(ids), RANGE), ranges, ranges)
    none = RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    alone = Log.from_steps("ranges", log.prior, [one._replace(sightings=none) for one in log])
    for one in (alone, log):
        assert mapped(replace(one, partial=parts)).tolist() == counted(log)

"""Ranges alone that are too long by the true path and places, and single ones beyond any way."""

from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.ranges import beyond_reach, too_long
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.contradiction.units import wrong_units
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Systematic, Truth
from slamduel.core.partial import PartialTable
from slamduel.core.se2 import Array, summed
from slamduel.datasets.truth_remarks import of_truth
from tiers import first_quick

WORLD = "circle[ranges_only=1,steps=400]"
GOOD = (WORLD, "circle[ranges_only=1,steps=400,uwb_tail=0.3,uwb_tail_mean=5]", "circle[ranges_only=1,clutter=2]")


def with_ranges(dataset: Dataset, z: Array) -> Dataset:
    log = dataset.log
    table = log.partial
    assert table is not None
    return dataset._replace(
        log=replace(log, partial=PartialTable.from_arrays(len(log), table.step, table.ids, table.kind, z, table.var))
    )


def ranges(dataset: Dataset) -> Array:
    assert dataset.log.partial is not None
    return dataset.log.partial.z.copy()


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_a_scale_as_large_as_the_noise_is_said_with_its_size_and_what_corrects_it(seed: int) -> None:
    made = load(WORLD, seed=seed)
    z = ranges(made)
    log = made.log
    assert log.partial is not None
    scale = 3 * float(np.median(np.sqrt(log.partial.var) / z))  # three times the noise, of the median range
    longer = with_ranges(made, z * (1 + scale))
    (said,) = too_long(longer)
    assert "too long" in said
    assert "bench noise LOG --apply" in said
    assert "range_scale" in said
    found = float(said.split("ranges are ")[1].split(" ")[0]) / 100
    assert abs(found - scale) < 0.1 * scale  # the noise of the mean is a hundredth of the scale
    assert said in remarked(longer).contradictions
    stated = longer.log.prior._replace(systematic=Systematic(range_scale=scale))
    assert list(too_long(longer._replace(log=replace(longer.log, prior=stated)))) == []


def test_what_the_log_states_is_no_part_of_what_is_said() -> None:
    """The offset of this drawn log is certain, a quarter of the noise; its scale of 5 % is stated."""
    made = load("circle[ranges_only=1,range_scale=0.1,steps=800,odometry=0.01]", seed=1010)
    assert list(too_long(made)) == []
    both = made.log.prior._replace(systematic=Systematic())
    (said,) = too_long(made._replace(log=replace(made.log, prior=both)))
    assert "% too short" in said


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize("name", GOOD)
def test_right_ranges_have_no_remark(name: str, seed: int) -> None:
    made = load(name, seed=seed)
    assert list(too_long(made)) == []
    assert list(beyond_reach(*made)) == []
    assert list(beyond_reach(made.log, None)) == []
    assert list(wrong_units(*made)) == []


@pytest.mark.parametrize("truth", [True, False])
def test_one_range_that_no_way_has_is_named_by_its_landmark_and_time(truth: bool) -> None:
    made = load(WORLD, seed=3)
    log = made.log
    z = ranges(made)
    z[17] = 4000.0
    wrong = with_ranges(made, z)
    assert log.partial is not None
    (said,) = beyond_reach(wrong.log, made.truth if truth else None)
    assert said.startswith(f"1 of {len(z):,} ranges alone is longer than there is a way")
    assert f"to landmark {log.partial.ids[17]} at {log.t[log.partial.step[17]]:.10g} s" in said
    assert ("the true path" in said) == truth
    shown = remarked(wrong)
    assert said in shown.outliers or not truth
    assert not shown.mistaken


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_beacons_in_another_unit_than_the_others_are_counted(seed: int) -> None:
    made = load(WORLD, seed=seed)
    assert made.log.partial is not None
    odd = made.log.partial.ids % 2 == 1
    wrong = with_ranges(made, np.where(odd, 1000.0, 1.0) * ranges(made))
    (said,) = beyond_reach(*wrong)
    assert said.startswith(f"{odd.sum():,} of {len(odd):,} ranges alone are longer than there is a way")


@pytest.mark.parametrize("factor", [1000.0, 100.0])
def test_another_unit_is_told_on_a_circle_with_places_and_without(factor: float) -> None:
    made = load(WORLD, seed=1)
    log = made.log
    steps = np.arange(len(log.t))
    delta = log.delta.copy()
    delta[1:] = [0.16, 0.0, 0.16 / 3]
    assert log.partial is not None
    path = summed(np.zeros(3), delta[1:])
    places = np.array([[-3.0, -2.0], [9.0, -2.0], [9.0, 8.0], [-3.0, 8.0]])
    ids = np.tile(np.arange(4), len(steps))
    step = np.repeat(steps, 4)
    noise = np.random.default_rng(5).normal(0, 0.1, len(ids))
    away = np.hypot(*(places[ids] - path[step, :2]).T)
    z, var = factor * (away + noise), np.full(len(ids), 0.01)
    table = PartialTable.from_arrays(len(log), step, ids, np.zeros(len(ids), np.int64), z, var)
    round_and_round = replace(log, delta=delta, partial=table)
    unit = "millimetres" if factor == 1000 else "centimetres"
    (said,) = wrong_units(round_and_round)
    assert said.endswith(f"ranges are in {unit}")
    assert made.truth is not None
    assert made.truth.map is not None
    known = made.truth.map._replace(ids=np.arange(4), xy=places)
    (said,) = wrong_units(round_and_round, Truth(log.t, path, known, None, "truth"))
    assert "the true path and known places" in said
    assert said.endswith(f"ranges are in {unit}")
    right = PartialTable.from_arrays(len(log), step, ids, np.zeros(len(ids), np.int64), z / factor, var)
    assert list(wrong_units(replace(round_and_round, partial=right))) == []


def test_an_id_of_ranges_alone_without_a_place_is_a_remark() -> None:
    made = load(WORLD, seed=2)
    assert made.truth is not None
    assert made.truth.map is not None
    assert made.log.partial is not None
    lost = int(made.log.partial.ids[0])
    kept = made.truth.map.ids != lost
    known = made.truth.map._replace(ids=made.truth.map.ids[kept], xy=made.truth.map.xy[kept])
    said = [one for one in of_truth(made._replace(truth=made.truth._replace(map=known))) if "no known place" in one]
    assert len(said) == 1
    assert f"(landmarks.csv), {lost}, with " in said[0]
    assert not [one for one in of_truth(made) if "no known place" in one]

"""Ranges alone of other landmarks, and bearings alone that count otherwise, by the true path and known places."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.parts import far_ranges, other_bearings, other_ids
from slamduel.bench.contradiction.ranges import out_of_time
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.plan.load import load
from slamduel.bench.systematic.late_parts import late
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, Ints, wrap
from slamduel.core.truth.errors import rows_of, sighted_from
from tiers import first_quick

RANGES, BEARINGS = "circle[ranges_only=1,steps=400]", "circle[bearings_only=1,steps=400]"
GOOD = (
    RANGES,
    BEARINGS,
    "circle[ranges_only=1,steps=400,uwb_tail=0.3,uwb_tail_mean=5]",
    "circle[ranges_only=0.5,bearings_only=0.5,steps=400,clutter=2]",
    "circle[ranges_only=1,steps=400,range_scale=0.1]",
)


def changed(dataset: Dataset, kind: int, *, ids: Ints | None = None, z: Array | None = None) -> Dataset:
    """The log with other ids or numbers of the partial sightings of one kind."""
    table = dataset.log.partial
    assert table is not None
    mine = table.kind == kind
    ids = table.ids if ids is None else np.where(mine, ids, table.ids)
    z = table.z if z is None else np.where(mine, z, table.z)
    partial = PartialTable.from_arrays(len(dataset.log), table.step, ids, table.kind, z, table.var)
    return dataset._replace(log=replace(dataset.log, partial=partial))


def parts(dataset: Dataset) -> PartialTable:
    assert dataset.log.partial is not None
    return dataset.log.partial


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_renumbered_ids_of_ranges_are_said_with_the_place_that_fits(seed: int) -> None:
    made = load(RANGES, seed=seed)
    ids = parts(made).ids
    names = np.unique(ids[ids != UNKNOWN])
    renumbered = np.where(ids == UNKNOWN, UNKNOWN, names[::-1][np.searchsorted(names, ids)])
    wrong = changed(made, RANGE, ids=renumbered)
    (said,) = other_ids(wrong)
    pairs = [tuple(map(int, pair)) for pair in re.findall(r"(\d+) that of (\d+)", said)]
    other = dict(zip(names.tolist(), names[::-1].tolist(), strict=True))
    assert len(pairs) >= 6
    assert all(other[one] == found for one, found in pairs)
    found = remarked(wrong)
    assert said in found.contradictions
    assert found.mistaken  # so that no noise is advised
    assert not any("times their stated noise" in one for one in found.contradictions)


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_two_exchanged_ids_of_ranges_are_the_only_ones_named(seed: int) -> None:
    made = load(RANGES, seed=seed)
    names, times = np.unique(parts(made).ids, return_counts=True)
    one, other = names[np.argsort(-times)[:2]].tolist()
    ids = parts(made).ids
    swapped = np.where(ids == one, other, np.where(ids == other, one, ids))
    (said,) = other_ids(changed(made, RANGE, ids=swapped))
    assert " 2 of " in said
    assert f"{one} that of {other}" in said
    assert f"{other} that of {one}" in said


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda z: -z, "positive to the other side"),
        (np.deg2rad, "in radians were converted from degrees"),
        (lambda z: wrap(z + 0.5), "degrees too far left, as where the sensor"),
        (lambda z: wrap(z - np.pi / 2), "degrees too far right, as where the sensor"),
    ],
)
def test_bearings_that_count_otherwise_are_said_with_the_reason(
    seed: int, wrong: Callable[[Array], Array], words: str
) -> None:
    made = load(BEARINGS, seed=seed)
    other = changed(made, BEARING, z=wrong(parts(made).z))
    (said,) = other_bearings(other)
    assert words in said
    found = remarked(other)
    assert said in found.contradictions
    assert found.mistaken


def test_what_nothing_explains_is_far_from_the_stated_noise() -> None:
    made = load("circle[ranges_only=0.5,bearings_only=0.5,steps=400]")
    draw = np.random.default_rng(0).permutation(len(parts(made).z))
    shuffled = parts(made).z.copy()
    for kind in (RANGE, BEARING):
        mine = np.flatnonzero(parts(made).kind == kind)
        shuffled[mine] = shuffled[draw[np.isin(draw, mine)]]
    wrong = changed(changed(made, RANGE, z=shuffled), BEARING, z=shuffled)
    assert list(other_ids(wrong)) == []
    for (said,), noun in ((far_ranges(wrong), "ranges"), (other_bearings(wrong), "bearings")):
        assert said.startswith(f"{noun} alone are typically ")
        assert said.endswith("what is usual does not explain it")
        assert said in remarked(wrong).contradictions


@pytest.mark.parametrize("seed", first_quick(range(8), 1))
@pytest.mark.parametrize("name", GOOD)
def test_right_parts_have_no_remark(name: str, seed: int) -> None:
    made = load(name, seed=seed)
    assert [*other_ids(made), *far_ranges(made), *other_bearings(made)] == []


def test_without_a_true_path_or_places_nothing_is_said() -> None:
    made = load(BEARINGS)
    wrong = changed(made, BEARING, z=-parts(made).z)
    truth = wrong.truth
    assert truth is not None
    for less in (None, truth._replace(map=None), truth._replace(kind="reference")):
        assert list(other_bearings(wrong._replace(truth=less))) == []


def late_by(dataset: Dataset, delay: float) -> Dataset:
    """The log with ranges and bearings alone as they were so many seconds before, each with its own error."""
    log, truth = dataset
    table = parts(dataset)
    assert truth is not None
    assert truth.map is not None
    place = rows_of(truth.map.ids, table.ids)
    columns = *truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])
    then, now = (
        sighted_from(
            np.stack([np.interp(log.t[table.step] - by, truth.t, column) for column in columns], axis=-1),
            truth.map.xy[np.maximum(place, 0)],
        )
        for by in (delay, 0.0)
    )
    is_range = table.kind == RANGE
    z = table.z + np.where(place < 0, 0.0, np.where(is_range, (then - now)[:, 0], (then - now)[:, 1]))
    z = np.where(is_range, np.maximum(z, 1e-3), wrap(z))
    return changed(changed(dataset, RANGE, z=z), BEARING, z=z)


WORLDS = {"circle[steps=400": False, "bailey[": True}
"""Whether the odometry tells whose clock it is: at an even speed and turn it does not."""


@pytest.mark.parametrize("seed", first_quick(range(8)))
@pytest.mark.parametrize(("world", "told"), WORLDS.items())
@pytest.mark.parametrize(("noun", "kind"), [("ranges", RANGE), ("bearings", BEARING)])
def test_a_delay_of_ranges_or_bearings_alone_is_found_and_said_where_it_matters(
    world: str, told: bool, noun: str, kind: int, seed: int
) -> None:
    """Five standard errors, and a hundredth of a step: straight lines between true poses are that far off.

    Nothing is said of a log in time, and of one that is late by more than its noise in one sentence.
    """
    made = load(f"{world}{',' if world[-1] != '[' else ''}{noun}_only=1]", seed=seed)
    step = float(np.median(np.diff(made.log.t)))
    for delay in (0.0, 0.3, 1.0, 3.0):
        dataset = late_by(made, delay) if delay else made
        found = late([dataset], kind)
        assert found is not None
        assert found.certain == (delay > 0)
        half = (found.delay.high - found.delay.low) / 2
        assert found.delay.value == pytest.approx(delay, abs=2.5 * half + step / 100)
        said = list(out_of_time(dataset, kind))
        assert len(said) == (found.size >= 1)
        assert len(said) <= (delay > 0)
        if delay == 3.0:
            (one,) = said
            assert f"{noun} alone are " in one
            assert re.search(r"(2\.9|3\.0)\d* ± 0\.\d+ s late", one)
            assert ("or the true path as early" in one) != told
            assert "option sensor_delay=" in one
            assert [one] == remarked(dataset, thorough=False).contradictions


def test_a_true_path_of_another_clock_is_not_taken_for_late_bearings() -> None:
    """Ranges, bearings and odometry agree that it is the true path which is early."""
    made = load("bailey[bearings_only=1]")
    truth = made.truth
    assert truth is not None
    columns = *truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])
    then = np.stack([np.interp(truth.t + 1.0, truth.t, column) for column in columns], axis=-1)
    early = made._replace(truth=truth._replace(poses=then))
    (said,) = out_of_time(early, BEARING)
    assert re.search(r"the true path is (0\.99|1\.0)\d* ± 0\.\d+ s early by bearings alone and by the odometry", said)


@pytest.mark.parametrize("log", [1, 2])
def test_renumbered_beacons_are_said_along_a_path_of_gps(log: int) -> None:
    """Plaza's truth is RTK GPS: its errors do not make ranges fit another beacon. As it is, nothing is said."""
    made = load(f"plaza[log={log}]")
    assert remarked(made).all == []
    ids = parts(made).ids
    names = np.unique(ids[ids != UNKNOWN])
    for other in (names[::-1], np.roll(names, 1), names[[1, 0, 2, 3]]):
        renumbered = np.where(ids == UNKNOWN, UNKNOWN, other[np.searchsorted(names, ids)])
        (said,) = remarked(changed(made, RANGE, ids=renumbered)).contradictions
        pairs = {(int(one), int(place)) for one, place in re.findall(r"(\d+) that of (\d+)", said)}
        moved = names != other
        assert pairs == set(zip(other[moved].tolist(), names[moved].tolist(), strict=True))


@pytest.mark.parametrize("log", [15, 16])
def test_without_any_truth_beacons_of_an_underwater_vehicle_have_no_remark(log: int) -> None:
    made = load(f"goats[log={log}]")
    assert made.truth is None
    assert [*other_ids(made), *far_ranges(made), *out_of_time(made, RANGE)] == []


def by_gps(dataset: Dataset, seed: int) -> Dataset:
    """The log with a true path whose own errors are a standard deviation of 3 cm and 0.01 rad."""
    truth = dataset.truth
    assert truth is not None
    off = np.random.default_rng(seed).normal(size=truth.poses.shape) * [0.03, 0.03, 0.01]
    return dataset._replace(truth=truth._replace(poses=truth.poses + off, words="GPS"))


@pytest.mark.parametrize("seed", first_quick(range(8)))
@pytest.mark.parametrize("world", [BEARINGS, "bailey[bearings_only=1]"])
def test_bearings_along_a_path_of_gps_are_judged_by_what_is_usual_alone(world: str, seed: int) -> None:
    made = by_gps(load(world, seed=seed), seed)
    assert [*other_bearings(made), *out_of_time(made, BEARING)] == []
    z = parts(made).z
    (said,) = other_bearings(changed(made, BEARING, z=-z))
    assert "positive to the other side" in said
    (said,) = other_bearings(changed(made, BEARING, z=wrap(z + 0.5)))
    assert "degrees too far left" in said
    shuffled = changed(made, BEARING, z=np.random.default_rng(seed).permutation(z))
    assert list(other_bearings(shuffled)) == []  # it may be the GPS
    assert len(list(other_bearings(shuffled._replace(truth=load(world, seed=seed).truth)))) == 1

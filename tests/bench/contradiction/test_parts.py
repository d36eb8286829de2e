"""Ranges alone of other landmarks, and bearings alone that count otherwise, by the true path and known places."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.contradiction.parts import far_ranges, other_bearings, other_ids
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, Ints, wrap
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

"""Ranges and bearings alone on demand: of the same sightings, with the same errors, and the rest stays."""

import numpy as np
import pytest

from refusals import refused
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN, Dataset, Systematic
from slamduel.core.factors.check import problems
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.truth.check import check_truth
from slamduel.core.truth.errors import sighted_from
from slamduel.datasets import archive, registry
from slamduel.datasets.on_demand.fixes import WorldFixes
from slamduel.datasets.on_demand.gyro import WorldGyro
from slamduel.datasets.on_demand.parts import PARTS_NOTE, Parts
from slamduel.datasets.on_demand.slip import WheelSlip

CIRCLE = "circle[steps=300"


def made(options: str = "", seed: int = 1) -> Dataset:
    dataset = load(f"{CIRCLE}{options}]", seed)
    assert list(problems(dataset.log)) == []
    assert dataset.truth is not None
    check_truth(dataset.log, dataset.truth, "circle")
    return dataset


def partial(dataset: Dataset) -> PartialTable:
    assert dataset.log.partial is not None
    return dataset.log.partial


def rows(dataset: Dataset, kind: int) -> set[tuple[int, int, float, float]]:
    """Step, id, measurement and variance of those of a kind."""
    table = partial(dataset)
    of = table.kind == kind
    return set(zip(*(c[of].tolist() for c in (table.step, table.ids, table.z, table.var)), strict=True))


def test_every_simulated_world_has_them() -> None:
    worlds = {name for name in registry.BUILTIN if issubclass(registry.find(name).options, Parts)}
    assert worlds == {
        "aruco-robot", "aruco-room", "bailey", "circle", "city", "depth-room", "linear", "matlab-report",
        "patrol", "world",
    }  # fmt: skip
    fixed = {name for name in registry.BUILTIN if issubclass(registry.find(name).options, WorldFixes)}
    assert fixed == {*worlds, "laser-floor"}
    for further in (WorldGyro, WheelSlip):
        assert {name for name in registry.BUILTIN if issubclass(registry.find(name).options, further)} == fixed


@pytest.mark.parametrize(("option", "kind", "column"), [("ranges_only", RANGE, 0), ("bearings_only", BEARING, 1)])
def test_all_sightings_become_a_part_of_what_they_were(option: str, kind: int, column: int) -> None:
    before, after = made().log, made(f",{option}=1")
    log = after.log
    assert len(log.ids) == 0
    table = partial(after)
    assert set(table.kind.tolist()) == {kind}
    np.testing.assert_array_equal(table.step, before.sighting_step)
    np.testing.assert_array_equal(table.ids, before.ids)
    np.testing.assert_array_equal(table.z, before.z[:, column])
    np.testing.assert_array_equal(table.var, before.z_cov[:, column, column])
    for name in ("t", "delta", "delta_cov"):
        np.testing.assert_array_equal(getattr(log, name), getattr(before, name))
    np.testing.assert_array_equal(log.prior.pose, before.prior.pose)


def test_a_larger_share_has_those_of_a_smaller_one_and_the_rest_stays_whole() -> None:
    before, few, more = made().log, made(",ranges_only=0.2"), made(",ranges_only=0.5,bearings_only=0.3")
    assert rows(few, RANGE) < rows(more, RANGE)
    assert rows(made(",bearings_only=0.3"), BEARING) == rows(more, BEARING)
    assert len(more.log.ids) + len(partial(more)) == len(before.ids)
    assert abs(len(rows(few, RANGE)) - 0.2 * len(before.ids)) < 4 * np.sqrt(0.16 * len(before.ids))
    whole = set(zip(before.sighting_step.tolist(), map(tuple, before.z.tolist()), strict=True))
    assert set(zip(more.log.sighting_step.tolist(), map(tuple, more.log.z.tolist()), strict=True)) < whole
    assert more.log.notes[PARTS_NOTE] == {"ranges": len(rows(more, RANGE)), "bearings": len(rows(more, BEARING))}
    step, kind = partial(more).step, partial(more).kind
    assert (np.diff(kind)[np.diff(step) == 0] >= 0).all()  # as in files


def test_hidden_and_false_ones_keep_their_true_ids() -> None:
    dataset = made(",ranges_only=0.6,ids=0.5,clutter=0.3")
    log, truth = dataset
    assert truth is not None
    assert truth.assigned_partial is not None
    table = partial(dataset)
    hidden, true = table.ids == UNKNOWN, truth.assigned_partial
    assert 0 < hidden.sum() < len(table)
    assert (true[~hidden] == table.ids[~hidden]).all()
    assert (true == UNKNOWN).any()  # the false ones
    again = archive.unpacked(archive.packed(dataset))
    assert again.truth is not None
    np.testing.assert_array_equal(again.truth.assigned_partial, true)
    unhidden = made(",ids=0.5,clutter=0.3")
    assert unhidden.truth is not None
    assert unhidden.truth.assigned is not None
    assert truth.assigned is not None
    assert sorted([*true.tolist(), *truth.assigned.tolist()]) == sorted(unhidden.truth.assigned.tolist())
    assert (log.ids == UNKNOWN).sum() + hidden.sum() == (unhidden.log.ids == UNKNOWN).sum()


def test_late_ranges_are_too_long_by_an_exponential() -> None:
    plain, late = made(",ranges_only=1"), made(",ranges_only=1,uwb_tail=0.3,uwb_tail_mean=2")
    longer = partial(late).z - partial(plain).z
    far = longer > 0
    assert (longer >= 0).all()
    n = len(longer)
    assert abs(far.sum() - 0.3 * n) < 4 * np.sqrt(0.21 * n)
    assert late.log.notes[PARTS_NOTE]["too long"] == far.sum()
    m = far.sum()
    assert abs(longer[far].mean() - 2) < 4 * 2 / np.sqrt(m)
    assert abs((longer[far] > 2).mean() - np.exp(-1)) < 4 * 0.5 / np.sqrt(m)


def test_constant_errors_are_drawn_as_stated() -> None:
    scales = list[float]()
    for seed in range(5):
        plain, off = made(",ranges_only=1", seed), made(",ranges_only=1,range_scale=0.1,range_offset=0.5", seed)
        assert off.log.prior.systematic == Systematic(0.1, 0.5)
        scale, offset = np.polyfit(partial(plain).z, partial(off).z, 1)
        np.testing.assert_allclose(scale * partial(plain).z + offset, partial(off).z, atol=1e-9)
        scales += [(scale - 1) / 0.1, offset / 0.5]
    assert len(set(scales)) == 10
    assert 0.3 < np.sqrt(np.mean(np.square(scales))) < 2.0


def test_their_errors_are_as_stated() -> None:
    dataset = made(",ranges_only=0.5,bearings_only=0.5")
    truth, table = dataset.truth, partial(dataset)
    assert truth is not None
    assert truth.map is not None
    right = sighted_from(truth.poses[table.step], truth.map.xy[np.searchsorted(truth.map.ids, table.ids)])
    off = table.z - np.where(table.kind == RANGE, right[:, 0], right[:, 1])
    off = np.where(table.kind == BEARING, np.arctan2(np.sin(off), np.cos(off)), off)
    assert abs((off**2 / table.var).mean() - 1) < 4 * np.sqrt(2 / len(table))


def test_too_many_are_refused() -> None:
    refused(
        "ranges_only=0.7 and bearings_only=0.5 are 1.2 together, expected at most 1",
        made,
        ",ranges_only=0.7,bearings_only=0.5",
    )

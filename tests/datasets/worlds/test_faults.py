"""Faults: each does what it says, to the amount it says, and nothing else."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2, f, kstest, poisson

from drawn_errors import errors, known, seen
from refusals import refused
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.core.factors.check import problems
from slamduel.datasets.cache import generator
from slamduel.datasets.formats import log_folder
from slamduel.datasets.worlds.circle import Options, circle
from slamduel.datasets.worlds.faults import TRACK, Faults, with_faults

SENSORS = ("ids", "z", "z_cov", "sighting_first")
MOTIONS = ("t", "delta", "delta_cov")
RARE = 1e-5
"""How often a test of a count or of a distribution may fail a right one."""


@pytest.fixture(scope="module")
def clean() -> Dataset:
    return circle(Options(), generator("circle", 0))


def after(clean: Dataset, draw: np.random.Generator | None = None, **faults: Any) -> Dataset:
    made = with_faults(clean, Faults(**faults), draw or np.random.default_rng(0))
    assert not list(problems(made.log))
    assert made.log.notes["faults"].items() >= faults.items()
    truth, _ = known(made)
    assert truth.assigned is None or truth.assigned.shape == made.log.ids.shape
    return made


def same(one: Dataset, other: Dataset, *columns: str) -> None:
    for name in columns:
        np.testing.assert_array_equal(getattr(one.log, name), getattr(other.log, name))


def test_by_default_nothing_happens(clean: Dataset) -> None:
    rng = np.random.default_rng(0)
    assert with_faults(clean, Faults(), rng) is clean
    assert with_faults(clean, Options(steps=7), rng) is clean
    assert rng.uniform() == np.random.default_rng(0).uniform()
    assert "faults" not in clean.log.notes


def test_a_world_s_options_are_these_and_its_own(clean: Dataset) -> None:
    options = read_options(Options, [("sensor_scale", "2"), ("tails", "none")], "dataset circle")
    made = circle(options, generator("circle", 0))
    same(made, clean, "ids", "z_cov", "sighting_first", *MOTIONS)
    np.testing.assert_allclose(errors(made).sightings, 2 * errors(clean).sightings, atol=1e-9)
    refused("option missing=2 is out of range", read_options, Options, [("missing", "2")], "dataset circle")


def test_errors_of_sightings_are_so_many_times_as_large_as_stated(clean: Dataset) -> None:
    made = after(clean, sensor_scale=3.0)
    same(made, clean, "ids", "z_cov", "sighting_first", *MOTIONS)
    np.testing.assert_allclose(errors(made).sightings, 3 * errors(clean).sightings, atol=1e-9)
    assert kstest(errors(made).sightings_squared / 9, chi2(2).cdf).pvalue > RARE
    np.testing.assert_allclose(errors(after(clean, sensor_scale=0.0)).sightings, 0, atol=1e-12)


def test_errors_of_odometry_are_so_many_times_as_large_as_stated(clean: Dataset) -> None:
    made = after(clean, odometry_scale=2.0)
    same(made, clean, "t", "delta_cov", *SENSORS)
    np.testing.assert_allclose(errors(made).motions, 2 * errors(clean).motions, atol=1e-9)
    assert kstest(errors(made).motions_squared / 4, chi2(3).cdf).pvalue > RARE


@pytest.mark.parametrize("dof", [3.0, 8.0])
def test_tails_are_student_s_with_the_covariance_that_is_stated(clean: Dataset, dof: float) -> None:
    """A t of covariance C has squared distances d nu / (nu - 2) / k in the F distribution of k and nu."""
    found = errors(after(clean, tails=dof))
    for squared, k in ((found.sightings_squared, 2), (found.motions_squared, 3)):
        assert kstest(squared * dof / (dof - 2) / k, f(k, dof).cdf).pvalue > RARE
        assert kstest(squared, chi2(k).cdf).pvalue < RARE


def test_an_error_that_leaves_no_range_is_a_lost_sighting(clean: Dataset) -> None:
    made = after(clean, sensor_scale=30.0)
    lost = made.log.notes["faults"]["sightings lost"]
    truth, landmarks = known(clean)
    right = seen(truth.poses[clean.log.sighting_step], landmarks.xy[clean.log.ids])[:, 0]
    assert lost == (right + 30 * errors(clean).sightings[:, 0] <= 0).sum() == len(clean.log.ids) - len(made.log.ids) > 0


def test_slips_come_so_often_a_metre_and_look_like_a_wheel_s(clean: Dataset) -> None:
    made = after(clean, slip=0.2)
    same(made, clean, "t", "delta_cov", *SENSORS)
    way = np.hypot(*np.diff(known(clean)[0].poses[:, :2], axis=0).T).sum()
    slips = made.log.notes["faults"]["slips"]
    assert RARE < poisson.cdf(slips, 0.2 * way) < 1 - RARE
    off = (errors(made).motions - errors(clean).motions)[(made.log.delta[1:] != clean.log.delta[1:]).any(axis=1)]
    assert 0.8 * slips < len(off) <= slips
    once = np.isclose(abs(off[:, 2]), abs(off[:, 0]) * 2 / TRACK)
    assert once.mean() > 0.8  # two in a step are rare
    metres = 2 * abs(off[once, 0])
    assert metres.min() > 0.01 - 1e-9
    assert metres.max() < 0.2 + 1e-9
    np.testing.assert_allclose(off[:, 1], 0, atol=1e-12)


def test_a_share_of_the_sightings_is_lost_and_a_larger_one_loses_more_of_the_same(clean: Dataset) -> None:
    few, many = after(clean, missing=0.1), after(clean, missing=0.4)
    for made, share in ((few, 0.1), (many, 0.4)):
        same(made, clean, *MOTIONS)
        lost = len(clean.log.ids) - len(made.log.ids)
        assert RARE < binom.cdf(lost, len(clean.log.ids), share) < 1 - RARE
        assert lost == made.log.notes["faults"]["sightings lost"]
    rows = [set(zip(log.sighting_step, log.ids, log.z[:, 0], strict=True)) for log, _ in (many, few, clean)]
    assert rows[0] < rows[1] < rows[2]
    assert len(after(clean, missing=1.0).log.ids) == 0


def test_a_gap_is_a_stretch_in_the_middle(clean: Dataset) -> None:
    made = after(clean, gap=0.2, clutter=1.0)
    inside = (made.log.sighting_step >= 1000) & (made.log.sighting_step < 1500)
    assert not inside.any()
    outside = (clean.log.sighting_step < 1000) | (clean.log.sighting_step >= 1500)
    assert np.count_nonzero(made.log.ids != UNKNOWN) == outside.sum()
    assert len(after(clean, gap=1.0).log.ids) == 0


def test_wrong_ids_leave_the_true_ones_with_the_truth(clean: Dataset) -> None:
    made = after(clean, wrong_ids=0.1)
    same(made, clean, "z", "z_cov", "sighting_first", *MOTIONS)
    np.testing.assert_array_equal(known(made)[0].assigned, clean.log.ids)
    assert abs((made.log.ids != clean.log.ids).sum() - 0.1 * len(clean.log.ids)) < 1


@pytest.mark.parametrize("ids", ["unknown", "nobody"])
def test_clutter_is_of_nothing_and_anywhere_in_view(clean: Dataset, ids: str) -> None:
    naming: dict[str, Any] = {} if ids == "unknown" else {"clutter_ids": ids}
    made = after(clean, clutter=0.5, **naming)
    same(made, clean, *MOTIONS)
    false = ~np.isin(made.log.ids, clean.log.ids)
    assert false.sum() == made.log.notes["faults"]["false sightings"]
    assert RARE < poisson.cdf(false.sum(), 0.5 * len(clean.log)) < 1 - RARE
    np.testing.assert_array_equal(known(made)[0].assigned, np.where(false, UNKNOWN, made.log.ids))
    if ids == "unknown":
        assert (made.log.ids[false] == UNKNOWN).all()
    else:
        assert len(np.unique(made.log.ids[false])) == false.sum()
    true = sorted(zip(made.log.sighting_step[~false], made.log.ids[~false], made.log.z[~false, 1], strict=True))
    assert true == sorted(zip(clean.log.sighting_step, clean.log.ids, clean.log.z[:, 1], strict=True))
    (near, right), (far, left) = clean.log.z.min(axis=0), clean.log.z.max(axis=0)
    r, bearing = made.log.z[false].T
    assert kstest((r**2 - near**2) / (far**2 - near**2), "uniform").pvalue > RARE
    assert kstest((bearing - right) / (left - right), "uniform").pvalue > RARE
    # Its covariance is a neighbour's in range: 0.1 m across, of a range that is off by no more than its own noise.
    np.testing.assert_allclose(r * np.sqrt(made.log.z_cov[false, 1, 1]), 0.1, rtol=0.3)


def test_jitter_takes_a_step_s_sightings_at_another_moment() -> None:
    """A moment a step, found again by least squares from sightings that are otherwise all but exact."""
    sd = 0.05
    made = circle(Options(sighting=1e-4, jitter=sd, landmarks=40), generator("circle", 0))
    exact = circle(Options(sighting=1e-4, landmarks=40), generator("circle", 0))
    truth, landmarks = known(exact)
    step, xy, h = exact.log.sighting_step, landmarks.xy[exact.log.ids], 1e-3
    ahead, behind = truth.poses.copy(), truth.poses.copy()
    velocity = 0.25 * np.stack((np.cos(truth.poses[:, 2]), np.sin(truth.poses[:, 2])), axis=-1)
    ahead[:, :2], behind[:, :2] = ahead[:, :2] + h * velocity, behind[:, :2] - h * velocity
    ahead[:, 2], behind[:, 2] = ahead[:, 2] + h * 0.025, behind[:, 2] - h * 0.025
    slope = seen(ahead[step], xy) - seen(behind[step], xy)
    slope[:, 1] = (slope[:, 1] + np.pi) % (2 * np.pi) - np.pi
    slope /= 2 * h
    off = made.log.z - exact.log.z
    off[:, 1] = (off[:, 1] + np.pi) % (2 * np.pi) - np.pi
    top = np.bincount(step, (slope * off).sum(axis=1), len(exact.log))
    bottom = np.bincount(step, (slope**2).sum(axis=1), len(exact.log))
    sighted = bottom > 0
    moments = top[sighted] / bottom[sighted]
    assert RARE < chi2.cdf((moments**2).sum() / sd**2, sighted.sum()) < 1 - RARE
    left = off - slope * (top / np.where(sighted, bottom, 1))[step][:, None]
    # What is left: the second order of a range, and the arc that between two steps is taken to be straight.
    assert np.abs(left).max() < (0.25 * np.abs(moments).max()) ** 2 / (2 * 2.0) + 0.25 * 0.025 / 8


def test_one_fault_changes_nothing_of_another(clean: Dataset) -> None:
    scaled, fewer = after(clean, sensor_scale=2.0), after(clean, missing=0.3)
    both = after(clean, sensor_scale=2.0, missing=0.3)
    same(both, fewer, "ids", "sighting_first", "z_cov")
    rows = {
        (k, name): z for k, name, z in zip(scaled.log.sighting_step, scaled.log.ids, scaled.log.z[:, 0], strict=True)
    }
    kept = zip(both.log.sighting_step, both.log.ids, strict=True)
    np.testing.assert_array_equal(both.log.z[:, 0], [rows[one] for one in kept])
    wrong, wrong_and_fewer = after(clean, wrong_ids=0.2), after(clean, wrong_ids=0.2, missing=0.3)
    names = {(k, r): name for k, r, name in zip(wrong.log.sighting_step, wrong.log.z[:, 0], wrong.log.ids, strict=True)}
    kept = zip(wrong_and_fewer.log.sighting_step, wrong_and_fewer.log.z[:, 0], strict=True)
    np.testing.assert_array_equal(wrong_and_fewer.log.ids, [names[one] for one in kept])


ALL: dict[str, Any] = {
    "sensor_scale": 2.0, "odometry_scale": 2.0, "tails": 4.0, "slip": 0.1, "missing": 0.2, "gap": 0.1,
    "wrong_ids": 0.05, "clutter": 0.5, "jitter": 0.1,
}  # fmt: skip


def test_all_of_them_at_once_are_the_same_log_for_one_seed_and_another_for_another(clean: Dataset) -> None:
    one, again, other = (after(clean, np.random.default_rng(seed), **ALL) for seed in (1, 1, 2))
    assert one.log.digest == again.log.digest != other.log.digest
    for name in ("z", "delta", "ids", "sighting_first"):
        assert not getattr(one.log, name).flags.writeable


def test_the_log_goes_to_its_folder_and_back(clean: Dataset, tmp_path: Path) -> None:
    made = after(clean, **ALL)
    log_folder.write(tmp_path / "log", made.log, made.truth)
    found = log_folder.read(tmp_path / "log")
    assert found.log.digest == made.log.digest
    np.testing.assert_array_equal(known(found)[0].assigned, known(made)[0].assigned)
    assert found.log.notes["faults"] == made.log.notes["faults"]


def test_without_the_truth_there_is_no_error_to_scale(clean: Dataset) -> None:
    truth, _ = known(clean)
    for unknown in (None, truth._replace(map=None), truth._replace(t=truth.t[1:], poses=truth.poses[1:])):
        with pytest.raises(ValueError, match="true pose of every step"):
            with_faults(Dataset(clean.log, unknown), Faults(missing=0.1), np.random.default_rng(0))


def test_a_log_without_sightings_stays_without(clean: Dataset) -> None:
    blind = replace(clean.log, ids=clean.log.ids[:0], z=clean.log.z[:0], z_cov=clean.log.z_cov[:0],
                    sighting_first=np.zeros(len(clean.log) + 1, np.int64))  # fmt: skip
    made = after(Dataset(blind, clean.truth), **ALL)
    assert len(made.log.ids) == 0


def test_a_sighting_without_a_range_is_lost_even_where_nothing_was_asked_for() -> None:
    """And clutter is drawn from the ranges that there are."""
    blurred = Options(sighting=5.0)
    made = circle(blurred, generator("circle", 0))
    assert not list(problems(made.log))
    lost = made.log.notes["faults"]["sightings lost"]
    assert lost > 100
    assert len(made.log.ids) + lost == len(circle(Options(), generator("circle", 0)).log.ids)
    cluttered = circle(replace(blurred, clutter=1.0), generator("circle", 0))
    false = cluttered.log.z[cluttered.log.ids == UNKNOWN, 0]
    assert false.min() < np.median(made.log.z[:, 0]) / 2
    assert false.max() <= made.log.z[:, 0].max()

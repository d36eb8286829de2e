"""Errors of sensor and wheels that stay are a remark where they are as large as noise as stated, and else none."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from planted_errors import drive
from slamduel.bench.contradiction import constant
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.logs.facts import facts
from slamduel.bench.logs.numbers import described
from slamduel.bench.plan.load import load
from slamduel.bench.systematic.weight import weight
from slamduel.bench.workers.batch import facts_of
from slamduel.core.factors import Dataset, Map
from slamduel.core.se2 import Array, compose
from slamduel.datasets.noise.systematic import Systematic
from tiers import first_quick

CORRECTS = "and no noise; `bench noise LOG --apply FOLDER` corrects it"

LARGE: dict[str, tuple[Systematic, str]] = {
    "ahead": (Systematic(x=0.2), "the sensor sits 0.20"),
    "late": (Systematic(delay=0.1), "the sensor's clock is "),
    "turned": (Systematic(yaw=-0.1), "the sensor looks 5.7"),
    "long ranges": (Systematic(range_offset=0.1), " m too long"),
    "another base": (Systematic(turn_scale=0.05), "the odometry's turns are "),
    "two": (Systematic(y=-0.2, wheel_scale=0.06), "m to the right of the robot's origin, and the odometry's way is "),
}


@pytest.mark.parametrize("case", LARGE)
@pytest.mark.parametrize("thorough", [True, False])
def test_errors_as_large_as_the_noise_are_a_remark_and_no_noise(case: str, thorough: bool) -> None:
    errors, words = LARGE[case]
    found = remarked(drive(errors, 3), thorough=thorough)
    (said,) = found.all
    assert said.startswith("by the true path ")
    assert words in said
    assert said.endswith(CORRECTS)
    assert found.mistaken


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_errors_that_are_small_to_the_noise_or_none_are_no_remark(seed: int) -> None:
    for errors in (Systematic(), Systematic(x=0.02), Systematic(yaw=0.005, turn_scale=0.01)):
        assert remarked(drive(errors, seed)).all == []


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_jitter_makes_no_difference(seed: int) -> None:
    """A sensor ahead by 2.1 times the noise, and one at its place."""
    for x, count in ((0.1, 1), (0.0, 0)):
        log, truth = drive(Systematic(x=x), 1)
        z = log.z + 1e-6 * np.random.default_rng(seed).standard_normal(log.z.shape)
        assert len(remarked(Dataset(replace(log, z=z), truth)).all) == count


def late(poses: Array) -> Array:
    """The poses of half a second before."""
    return np.concatenate((np.repeat(poses[:1], 5, axis=0), poses[:-5]))


def ahead(poses: Array) -> Array:
    return compose(poses, np.array([0.3, 0.0, 0.0]))


@pytest.mark.parametrize("moved", [late, ahead])
@pytest.mark.parametrize("seed", first_quick(range(3)))
def test_a_truth_of_another_place_or_time_does_not_accuse_the_sensor(
    moved: Callable[[Array], Array], seed: int
) -> None:
    log, truth = drive(Systematic(), seed)
    assert truth is not None
    found = remarked(Dataset(log, truth._replace(poses=moved(truth.poses))))
    assert found.constant is None
    assert all("the truth" in said or "the true path" in said for said in found.all)
    assert found.all


def test_wrong_ids_and_a_truth_that_stands_still_are_no_errors_of_the_sensor() -> None:
    log, truth = drive(Systematic(), 4)
    assert truth is not None
    stands = truth.poses.copy()
    stands[len(stands) // 2 :] = stands[len(stands) // 2]
    half = np.repeat(np.arange(len(log)), np.diff(log.sighting_first)) > len(log) // 2
    names = np.unique(log.ids)
    others = np.where(half, np.roll(names, 5)[np.searchsorted(names, log.ids)], log.ids)
    for dataset in (Dataset(log, truth._replace(poses=stands)), Dataset(replace(log, ids=others), truth)):
        assert remarked(dataset).constant is None


def test_a_log_as_stated_is_not_fitted_in_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def fitted(_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(constant, "fitted", fitted)
    assert remarked(load("circle"), thorough=False).all == []
    with pytest.raises(AssertionError):
        remarked(drive(Systematic(x=0.2)), thorough=False)


def test_known_places_tell_as_well_but_not_in_a_run() -> None:
    alone = without_path(drive(Systematic(x=0.3, yaw=0.05), 2, seconds=90), 0.0)
    said = remarked(alone).contradictions
    assert said[0].startswith("by the known places of landmarks the sensor sits 0.")
    assert said[0].endswith(CORRECTS)
    assert remarked(alone, thorough=False).constant is None


def without_path(dataset: Dataset, off: float) -> Dataset:
    """Its landmarks' places known, each `off` by so many m, in x and in y."""
    log, truth = dataset
    assert truth is not None
    assert truth.map is not None
    xy = truth.map.xy + off * np.random.default_rng(0).standard_normal(truth.map.xy.shape)
    return Dataset(log, truth._replace(t=truth.t[:0], poses=truth.poses[:0], map=Map(truth.map.ids, xy, None)))


@pytest.mark.parametrize(("off", "told"), [(0.001, True), (0.3, False)])
def test_places_that_are_not_precise_tell_no_scale(off: float, told: bool) -> None:
    """Ranges 5 % long: 14 places within some 10 m tell that if they are right to a millimetre, not to 0.3 m."""
    found = remarked(without_path(drive(Systematic(range_scale=0.05), 1), off))
    assert any("by the known places of landmarks ranges are " in said for said in found.all) == told
    assert not any("by the known places" in said for said in found.all) or told


def test_of_many_landmarks_known_places_are_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(constant, "MOST", 10)
    assert remarked(without_path(drive(Systematic(x=0.3), 2), 0.0)).constant is None


def test_a_run_keeps_the_remark_and_blames_no_noise() -> None:
    found = facts_of(drive(Systematic(x=0.2)))
    assert found.mistaken
    assert found.remarks[0].endswith(CORRECTS)


def test_the_weight_is_that_worked_out_by_hand() -> None:
    """Ranges 0.06 m too long with a standard deviation of 0.03 m, and turns 5 % too large."""
    log, _ = drive(Systematic(), 0)
    assert weight(log, Systematic(range_offset=0.06)).sightings == pytest.approx(2 / np.sqrt(2), rel=1e-6)
    assert weight(log, Systematic(range_offset=0.06)).motions == 0
    turned = np.abs(np.add.reduceat(log.delta[1:, 2], np.arange(0, len(log) - 1, 30))) * 0.05 / 1.05
    expected = np.median(turned) / (0.002 * np.sqrt(30)) / np.sqrt(3)
    assert weight(log, Systematic(turn_scale=0.05)).motions == pytest.approx(expected, rel=0.05)


def words_of(dataset: Dataset) -> dict[str, str]:
    subject = described("planted", dataset, solve=False)
    return dict(facts(subject.numbers, "truth", mistaken=subject.remarks.mistaken))


def test_show_says_what_stays_and_the_noise_that_is_left() -> None:
    said = words_of(drive(Systematic(x=0.2, delay=0.1), 1))
    stays = said["errors that stay"]
    assert stays.startswith("The sensor sits 0.2")
    assert stays.endswith("ms late · bench noise LOG --apply FOLDER corrects them")
    assert "corrected for errors that stay, typical error as stated (" in said["sightings against truth"]
    assert "range_sd=0.03" in said["sightings against truth"]
    assert said["odometry against truth"].startswith("typical error as stated")


def test_show_says_so_of_wheels_and_leaves_sightings() -> None:
    said = words_of(drive(Systematic(drift=0.1), 1))
    assert said["errors that stay"].startswith("The odometry turns ")
    assert said["odometry against truth"].startswith("corrected for errors that stay, ")
    assert not said["sightings against truth"].startswith("corrected")


def test_show_says_nothing_of_errors_that_explain_little() -> None:
    small = drive(Systematic(x=0.01), 0)
    assert remarked(small).constant is not None
    assert "errors that stay" not in words_of(small)


def test_a_truth_of_the_start_alone_is_none_to_compare_with() -> None:
    log, truth = drive(Systematic(x=0.2), 0, seconds=30)
    assert truth is not None
    one = truth._replace(t=truth.t[:1], poses=truth.poses[:1], map=None)
    assert remarked(Dataset(log, one)).constant is None

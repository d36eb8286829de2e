"""Planted outliers: what the log and its truth say of them, and which backends live with them."""

import numpy as np
import pytest

from driven import aligned_error
from random_logs import random_log
from room_drives import room_drive
from slamduel.backends.api import Diverged
from slamduel.bench.plan.spec import backend_variants, read_options
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.factors.check import check
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.aruco_room import Options, aruco_room
from slamduel.datasets.worlds.outliers import swapped
from tiers import first_quick

SEED = 0
SHARE = 0.05
DRAWS = 5


@pytest.fixture(scope="module")
def clean() -> Dataset:
    return room_drive(SEED)[0]


def truth_of(made: Dataset) -> Truth:
    assert made.truth is not None
    return made.truth


@pytest.fixture(scope="module")
def planted(clean: Dataset) -> list[Dataset]:
    """The same drive, which need not be rendered again, with other outliers in each."""
    return [swapped(clean.log, truth_of(clean), SHARE, np.random.default_rng(draw)) for draw in range(DRAWS)]


def wander() -> tuple[Log, Truth]:
    made = random_log(np.random.default_rng(1), 200, 12)
    return made.log, truth_of(made)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.5])
def test_so_many_sightings_have_another_landmark_s_id(share: float) -> None:
    log, truth = wander()
    made = swapped(log, truth, share, np.random.default_rng(2))
    check(made.log, "with outliers")  # an id at most once a step, among others
    wrong = made.log.ids != log.ids
    assert abs(wrong.sum() - share * len(log.ids)) <= 0.5
    assert set(made.log.ids) <= set(log.ids)
    assert made.log.notes["outliers"] == f"{wrong.sum()} of {len(log.ids)} sightings have another landmark's id"
    np.testing.assert_array_equal(truth_of(made).assigned, log.ids)
    for name in ("t", "delta", "delta_cov", "z", "z_cov", "sighting_first"):
        assert getattr(made.log, name) is getattr(log, name)


def test_outliers_are_spread_over_the_log_and_the_landmarks() -> None:
    log, truth = wander()
    wrong = np.concatenate([
        np.flatnonzero(swapped(log, truth, 0.1, np.random.default_rng(seed)).log.ids != log.ids) for seed in range(40)
    ])  # fmt: skip
    thirds = np.histogram(wrong, 3, (0, len(log.ids)))[0] / len(wrong)
    np.testing.assert_allclose(thirds, 1 / 3, atol=4 * np.sqrt(2 / 9 / len(wrong)))  # 4 sd of an independent draw
    assert set(log.ids[wrong]) == set(log.ids)


def test_where_everything_is_in_sight_nothing_can_be_swapped() -> None:
    log, truth = wander()
    first = log.head(1)
    made = swapped(first, truth, 1.0, np.random.default_rng(0))
    np.testing.assert_array_equal(made.log.ids, first.ids)
    assert made.log.notes["outliers"].startswith("0 of ")


def test_the_drive_s_option_plants_them_into_the_same_log() -> None:
    plain, made = (
        aruco_room(Options(seconds=1.0, frame_rate=4.0, outliers=share), generator("aruco-room", 3))
        for share in (0.0, 0.2)
    )
    assert "outliers" not in plain.log.notes
    assert truth_of(plain).assigned is None
    expected = swapped(plain.log, truth_of(plain), 0.2, generator("aruco-room", 3).spawn(5)[4])
    assert made.log.digest == expected.log.digest != plain.log.digest
    assert made.log.notes == expected.log.notes
    with pytest.raises(InputError, match=r"option outliers=0\.9 is out of range"):
        read_options(Options, [("outliers", "0.9")], "dataset aruco-room")


def error(backend: str, log: Log, truth: Truth) -> float:
    """ATE, m, of the final path, where there is one, else of the online path; infinite where it gives up."""
    (variant,) = backend_variants(backend)
    made = variant.builder.make(log.prior, variant.options, np.random.default_rng(0))
    try:
        online = [made.step(step) for step in log]
        solution = made.finish()
    except Diverged:
        return float("inf")
    path = np.array(online) if solution is None else solution.path
    return aligned_error(path, truth.poses)


def ratios(backend: str, clean: Dataset, planted: list[Dataset]) -> list[float]:
    """Error with outliers over that without, for every draw of them."""
    plain = error(backend, clean.log, truth_of(clean))
    return [error(backend, made.log, truth_of(made)) / plain for made in planted]


@pytest.mark.parametrize(
    "backend", first_quick(["ekf[gate=0.999]", "graph[gnc=true]", "graph[loss=cauchy]", "graph[loss=geman-mcclure]"], 2)
)
def test_gated_and_robust_backends_stay_within_twice_their_clean_error(
    backend: str, clean: Dataset, planted: list[Dataset]
) -> None:
    """In the middle of the draws: on a drive this short a marker that is first taken for another can cost more."""
    assert np.median(ratios(backend, clean, planted)) < 2


@pytest.mark.parametrize("backend", ["ekf", "graph"])
def test_plain_backends_fail_with_every_draw(backend: str, clean: Dataset, planted: list[Dataset]) -> None:
    assert min(ratios(backend, clean, planted)) > 2

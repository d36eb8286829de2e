"""Landmarks that do not fit a known map: exchanged ones, and single ones far off; the numbers of a cell stay."""

import numpy as np
import pytest

from slamduel.backends import registry as backends
from slamduel.bench.measure.accuracy import own_map_rmse
from slamduel.bench.measure.cell import Job, Result, run_on
from slamduel.bench.measure.misplaced import laid, misplaced, put_right, told
from slamduel.bench.plan.load import load
from slamduel.core.factors import Map, Truth
from slamduel.core.se2 import Array, act

N = 12


def maps(seed: int = 0, noise: float = 0.02) -> tuple[Map, Map]:
    """An estimate in a frame of its own, and the known map."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 5, (N, 2))
    moved = act(np.array([[3.0, -2.0, 0.7]]), xy + rng.normal(0, noise, xy.shape))
    return Map(np.arange(N), moved, None), Map(np.arange(N), xy, None)


def with_rows(known: Map, rows: list[int], others: list[int]) -> Map:
    xy = known.xy.copy()
    xy[rows] = known.xy[others]
    return known._replace(xy=xy)


def test_points_are_laid_on_others_where_most_of_them_fit() -> None:
    found, known = maps(noise=0.0)
    wrong = with_rows(known, [0, 1, 2, 3, 4], [4, 3, 0, 1, 2])
    assert laid(found.xy, wrong.xy)[5:] == pytest.approx(known.xy[5:], abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_two_that_are_exchanged_are_found_with_the_error_before_and_after(seed: int) -> None:
    found, known = maps(seed)
    wrong = with_rows(known, [2, 7], [7, 2])
    exchanged, astray = misplaced(found, wrong)
    assert astray is None
    assert exchanged is not None
    assert exchanged.ids == ((2, 7),)
    assert exchanged.before == own_map_rmse(found, wrong)
    assert exchanged.after == own_map_rmse(found, known)
    assert (put_right(wrong, exchanged).xy == known.xy).all()


def test_a_cycle_is_named_in_its_order_beside_another() -> None:
    found, known = maps(3)
    wrong = with_rows(known, [1, 4, 6, 8, 9], [4, 6, 1, 9, 8])
    exchanged, _ = misplaced(found, wrong)
    assert exchanged is not None
    assert {frozenset(cycle) for cycle in exchanged.ids} == {frozenset((1, 4, 6)), frozenset((8, 9))}
    assert (put_right(wrong, exchanged).xy == known.xy).all()


def test_one_far_off_is_named_with_what_the_others_have() -> None:
    found, known = maps(1)
    known.xy[5] += [18.0, 0.0]
    exchanged, astray = misplaced(found, known)
    assert exchanged is None
    assert astray is not None
    assert astray.ids == (5,)
    assert astray.errors[0] == pytest.approx(18.0, abs=0.1)
    assert astray.others == N - 1
    assert 0 < astray.typical < astray.most < 0.1


def test_an_error_that_a_single_sighting_explains_is_not_far_off() -> None:
    found, known = maps(1)
    known.xy[5] += [1.5, 0.0]
    assert misplaced(found, known).astray is not None
    assert misplaced(found, known, np.where(np.arange(N) == 5, 0.5, 0.02)).astray is None


@pytest.mark.parametrize("change", ["all elsewhere", "noise", "too few", "not finite", "one place"])
def test_nothing_is_said_of_a_map_that_fits_nowhere(change: str) -> None:
    found, known = maps(2)
    rng = np.random.default_rng(5)
    xy: dict[str, Array] = {
        "all elsewhere": rng.uniform(0, 5, (N, 2)),
        "noise": known.xy + rng.normal(0, 2, (N, 2)),
        "too few": known.xy,
        "not finite": np.full((N, 2), np.nan),
        "one place": np.zeros((N, 2)),
    }
    few = slice(4 if change == "too few" else N)
    with np.errstate(all="ignore"):
        assert misplaced(Map(found.ids[few], xy[change][few], None), known) == (None, None)


def scored(backend: str, truth: Truth) -> Result:
    log, _ = load("circle", 0)
    job = Job(backend, backend, backends.find(backend).options(), 0, 8_000)
    return run_on(job, lambda: log, lambda: truth)


@pytest.mark.parametrize("backend", ["ekf", "smoother"])
def test_a_cell_says_what_its_error_is_with_two_places_exchanged_and_keeps_its_numbers(backend: str) -> None:
    _, truth = load("circle", 0)
    assert truth is not None
    assert truth.map is not None
    clean = scored(backend, truth)
    assert "exchanged" not in clean.reason
    assert "off in the map" not in clean.reason
    wrong = scored(backend, truth._replace(map=with_rows(truth.map, [2, 9], [9, 2])))
    column = "final_map_rmse_m" if "final_map_rmse_m" in wrong.row else "map_rmse_m"
    assert wrong.row[column] > 5
    assert (
        f"the map's error is {clean.row[column]:.3g} m, not {wrong.row[column]:.3g} m, with the true places of "
        f"landmarks {truth.map.ids[2]}, {truth.map.ids[9]} exchanged"
    ) in wrong.reason


def test_the_best_sighting_tells_how_well_a_landmark_is_seen() -> None:
    log, _ = load("circle", 0)
    ids = np.append(np.unique(log.ids), 1_000)
    sd = told(log, ids)
    one = log.ids == ids[3]
    own = np.maximum(log.z_cov[one, 0, 0], log.z[one, 0] ** 2 * log.z_cov[one, 1, 1])
    assert sd[3] == np.sqrt(own.min())
    assert sd[-1] == 0

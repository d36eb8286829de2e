"""Correlative search, against trying every pose, and its pyramid, against maxima over squares."""

from itertools import product

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import distance_transform_edt

from slamduel.core.se2 import Array
from slamduel.frontend.laser._search import (
    ANYWHERE,
    FULL,
    LEVELS,
    Bytes,
    Search,
    branch_and_bound,
    coarser,
    correlated,
    likelihoods,
)
from slamduel.frontend.laser.submap import stamp
from slamduel.frontend.maps._grid import HIT, THROUGH, Mask

CELL = 0.05


def pyramid(field: Bytes) -> tuple[Bytes, ...]:
    levels = [field]
    for level in range(1, LEVELS):
        levels.append(coarser(levels[-1], 1 << (level - 1)))
    return tuple(levels)


def field_of(wall: Mask, sd: float) -> Bytes:
    cells = np.zeros((*wall.shape, 4), np.float32)
    cells[wall, HIT] = 1
    return likelihoods(cells, (0, wall.shape[0], 0, wall.shape[1]), 0.25, stamp(CELL, sd))


def room(rng: np.random.Generator, side: int = 80) -> Bytes:
    """A field with some straight walls."""
    wall = np.zeros((side, side), np.bool_)
    for _ in range(6):
        at, first, last = rng.integers(side), *sorted(rng.integers(side, size=2))
        if rng.random() < 0.5:
            wall[at, first : last + 1] = True
        else:
            wall[first : last + 1, at] = True
    return field_of(wall, 0.1)


def brute_force(
    field: Bytes, origin: Array, points: Array, centre: Array, window: float, turn: float, step: float
) -> float:
    """The best score of all poses of a window: cells are moved, as whole cells, so that rounding is the same."""
    half, turns, best = int(np.ceil(window / CELL)), int(np.ceil(turn / step)), 0
    padded = np.pad(field, 200)
    for a in range(-turns, turns + 1):
        c, s = np.cos(centre[2] + a * step), np.sin(centre[2] + a * step)
        i = np.floor((centre[0] + c * points[:, 0] - s * points[:, 1] - origin[0]) / CELL).astype(int) + 200
        j = np.floor((centre[1] + s * points[:, 0] + c * points[:, 1] - origin[1]) / CELL).astype(int) + 200
        sums = np.zeros((2 * half + 1, 2 * half + 1), np.int64)
        for u, v in zip(i, j, strict=True):
            sums += padded[u - half : u + half + 1, v - half : v + half + 1]
        best = max(best, int(sums.max()))
    return best / FULL / len(points)


def thinned(points: Array) -> Array:
    """The same points as every other row of an array, as of a scan: kernels are compiled for one kind."""
    return np.repeat(points, 2, axis=0)[::2]


@pytest.mark.parametrize("block", range(10))
def test_branch_and_bound_finds_the_best_pose_of_all(block: int) -> None:
    """In 1,000 random rooms; some windows are wider than the coarsest squares, some have several groups of headings."""
    for seed in range(100 * block, 100 * block + 100):
        rng = np.random.default_rng(seed)
        field = room(rng)
        origin, centre = rng.uniform(-2, 0, 2), np.array([*rng.uniform(0, 2, 2), rng.uniform(-3, 3)])
        points = thinned(rng.uniform(-1.5, 1.5, (rng.integers(5, 25), 2)))
        window = 2.0 if seed % 10 == 0 else rng.uniform(0.1, 0.8)
        turn, step = 0.6 if seed % 10 == 1 else 0.06, 0.03
        search = Search(points, centre, window, turn, step)
        pose, found, _ = branch_and_bound(pyramid(field), origin, CELL, search, 0.0, ANYWHERE)
        assert found == brute_force(field, origin, points, centre, window, turn, step)
        if found:
            off = np.abs(pose - centre)
            assert max(off[:2]) < window + CELL
            assert off[2] < turn + 1e-9


def test_what_is_not_above_the_least_score_is_not_found() -> None:
    rng = np.random.default_rng(0)
    field, points = room(rng), thinned(rng.uniform(-1, 1, (20, 2)))
    centre, origin = np.array([1.0, 1.0, 0.0]), np.zeros(2)
    search = Search(points, centre, 0.5, 0.1, 0.05)
    best = branch_and_bound(pyramid(field), origin, CELL, search, 0.0, ANYWHERE)[1]
    assert branch_and_bound(pyramid(field), origin, CELL, search, best - 1e-6, ANYWHERE)[1] == best
    pose, found, _ = branch_and_bound(pyramid(field), origin, CELL, search, best + 1e-6, ANYWHERE)
    assert found == 0
    assert (pose == centre).all()


def test_a_level_is_the_maximum_over_squares() -> None:
    rng = np.random.default_rng(1)
    field = rng.integers(0, 256, (23, 31)).astype(np.uint8)
    for level, found in enumerate(pyramid(field)):
        width = 1 << level
        expected = sliding_window_view(np.pad(field, width - 1), (width, width)).max(axis=(2, 3))
        assert (found == expected).all()


@pytest.mark.parametrize(("cell", "sd"), [(0.05, 0.1), (0.05, 0.08), (0.02, 0.1), (0.3, 0.1)])
def test_the_field_is_a_gaussian_of_the_distance_to_the_nearest_wall(cell: float, sd: float) -> None:
    rng = np.random.default_rng(4)
    cells = np.zeros((60, 90, 4), np.float32)
    cells[..., :2] = rng.integers(1, 5, (60, 90, 2)) * (rng.random((60, 90, 1)) < 0.02)
    top, bottom, left, right = box = (7, 55, 0, 81)
    wall = (cells[..., HIT] > 0) & (cells[..., HIT] >= 0.25 * (cells[..., HIT] + cells[..., THROUGH]))
    distance = cell * np.asarray(distance_transform_edt(~wall[top:bottom, left:right]))
    expected = FULL * np.exp(-0.5 * (distance / sd) ** 2)
    found = likelihoods(cells, box, 0.25, stamp(cell, sd))
    assert wall.sum() > 50
    assert np.abs(found - expected).max() <= 0.5 + 255 * 1e-5  # rounded to a byte, from single precision
    nothing = likelihoods(np.zeros_like(cells), box, 0.25, stamp(cell, sd))
    assert nothing.shape == found.shape
    assert not nothing.any()


def test_the_small_search_finds_what_trying_every_pose_does() -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        field, origin = room(rng), rng.uniform(-1, 1, 2)
        points = thinned(rng.uniform(-1.5, 1.5, (int(rng.integers(1, 90)), 2)))
        centre = np.append(origin + rng.uniform(1, 3, 2), rng.uniform(-3, 3))
        tried = list[tuple[float, Array]]()
        for turn, p, q in product(range(-7, 8), range(-4, 5), range(-4, 5)):
            pose = np.add(centre, (p * 0.08, q * 0.08, turn * 0.03))
            c, s = np.cos(pose[2]), np.sin(pose[2])
            at = np.floor((points @ np.array([[c, s], [-s, c]]) + pose[:2] - origin) / CELL).astype(int)
            at = at[((at >= 0) & (at < field.shape)).all(axis=1)]
            far = (p * p + q * q) * (0.08 / 0.6) ** 2 + (turn * 0.03 / 0.5) ** 2
            tried.append((field[tuple(at.T)].sum(dtype=np.int64) * np.exp(-0.5 * far), pose))
        found = correlated(field, origin, CELL, Search(points, centre, 0.3, 0.2, 0.03), 0.08, 0.6, 0.5)
        best = max(score for score, _ in tried)
        mine = min(tried, key=lambda one: np.abs(one[1] - found).max())
        assert np.abs(mine[1] - found).max() < 1e-9
        assert mine[0] > best - 2 * FULL  # a point on a cell's edge may be in the next one


def test_the_small_search_prefers_what_is_near_to_what_is_as_good() -> None:
    """A corridor: along it every place is as good as any other."""
    wall = np.zeros((200, 60), np.bool_)
    wall[:, [10, 50]] = True
    field = field_of(wall, 0.08)
    x = np.linspace(-2, 2, 41)
    points = thinned(np.concatenate((np.stack((x, np.full(41, 1.0)), -1), np.stack((x, np.full(41, -1.0)), -1))))
    true = np.array([5.025, 1.525, 0.0])
    search = Search(points, np.add(true, (0.0, 0.16, 0.09)), 0.3, 0.35, 0.03)
    found = correlated(field, np.zeros(2), CELL, search, 0.08, 0.6, 0.6)
    assert np.abs(found - true).max() < 0.05

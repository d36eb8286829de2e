"""Scan matching: on a room drawn by hand, against numerical derivatives, and where it has to know nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from slamduel.core.se2 import Array, act, between, compose, inverse
from slamduel.frontend.laser._matching import Hold, Lines, line, match, nearest, normal_equations, spread
from slamduel.frontend.laser.loops import cov_by_points
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.maps._grid import (
    HIT,
    Cells,
    Grid,
    insert,
    one_a_cell,
    seen_through,
    thinned,
    walls,
    walls_within,
)

CELL, SHARE, SD = 0.05, 0.25, 0.03
ORIGIN = np.array([-5.0, -4.0])
NOTHING = np.zeros((3, 3))
HERE = np.zeros(2)


def room(width: float = 4.0, height: float = 3.0, spacing: float = 0.03) -> Array:
    """Points on the walls of a room around the origin, with a niche so that it has no symmetry."""
    x, y = np.arange(-width / 2, width / 2, spacing), np.arange(-height / 2, height / 2, spacing)
    left, right = np.full(len(y), -width / 2), np.full(len(y), width / 2)
    right[: len(y) // 3] -= 0.5
    sides = [(x, np.full(len(x), -height / 2)), (x, np.full(len(x), height / 2)), (left, y), (right, y)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def lines_of(points: Array) -> Lines:
    """Of points that were not compared with any yet."""
    return Lines(np.full((len(points), 2), -1), np.empty((len(points), 6)))


def drawn(points: Array, poses: list[Array]) -> Grid:
    """A grid with the points as seen from each pose."""
    cells = np.zeros((200, 160, 4), np.float32)
    for pose in poses:
        insert(cells, ORIGIN, CELL, pose, HERE, act(inverse(pose), points))
    return Grid(cells, ORIGIN, CELL, SHARE)


POSES = [np.array([0.1 * k, 0.05 * k, 0.2 * k]) for k in range(-3, 4)]


def box_of(cells: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    i, j = np.nonzero(cells)
    return int(i.min()), int(i.max()) + 1, int(j.min()), int(j.max()) + 1


@pytest.mark.parametrize("seed", range(20))
def test_the_boxes_of_hits_and_walls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells: Cells = np.zeros((200, 160, 4), np.float32)
    hit = insert(cells, ORIGIN, CELL, np.zeros(3), HERE, rng.uniform(-6, 6, (40, 2)))  # some of them outside
    assert hit == box_of(cells[:, :, HIT] > 0)
    assert walls_within(cells, hit, SHARE) == box_of(walls(cells, SHARE))
    cells[rng.random((200, 160)) < 0.5, HIT] = 0
    assert walls_within(cells, hit, SHARE) == box_of(walls(cells, SHARE))
    cells[:, :, HIT] = 0
    first, last, _, _ = walls_within(cells, hit, SHARE)
    assert first >= last


@pytest.mark.parametrize("seed", range(20))
def test_a_scan_is_put_where_it_was_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    submap = drawn(room(), POSES)
    true = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
    scan = act(inverse(true), room(spacing=0.05)) + rng.normal(0, 0.01, (len(room(spacing=0.05)), 2))
    start = compose(true, np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.05, 0.05)]))
    pose, information, explained = match(submap, scan, start, Hold(start, NOTHING), SD, 6, 25)
    off = between(true, pose)
    assert np.hypot(off[0], off[1]) < 0.006
    assert abs(off[2]) < 0.004
    assert explained > 0.95
    assert (np.linalg.eigvalsh(information) > 0).all()


def test_the_gradient_is_that_of_the_cost() -> None:
    """Of the points that are on lines, with the associations held: by central differences of r² / variance."""
    submap, scan = drawn(room(), POSES), room(spacing=0.11)
    pose = np.array([0.02, -0.015, 0.01])
    H, g = np.empty((3, 3)), np.empty(3)
    normal_equations(submap, scan, pose, 10.0, 4, 0.04, True, lines_of(scan), H, g)  # so wide that the loss is 1
    again, lines = (np.empty((3, 3)), np.empty(3)), lines_of(scan)
    normal_equations(submap, scan, np.add(pose, (0.05, 0.1, 0.03)), 10.0, 4, 0.04, True, lines, *again)
    assert (again[0] != H).any()
    normal_equations(submap, scan, pose, 10.0, 4, 0.04, True, lines, *again)
    assert (again[0] == H).all()  # lines from another pose
    assert (again[1] == g).all()
    held = []
    for x, y in act(pose, scan) - ORIGIN:
        i, j, d2 = nearest(submap.cells, CELL, SHARE, x, y, 4)
        held.append(line(submap.cells, CELL, SHARE, i, j) if i >= 0 and d2 <= 0.04 else None)

    def cost(at: Array) -> float:
        total = 0.0
        for point, one in zip(act(at, scan) - ORIGIN, held, strict=True):
            if one is None:
                continue
            mx, my, nx, ny, along, across = one
            if along > 9e-4 and across < 0.1 * along:
                total += (nx * (point[0] - mx) + ny * (point[1] - my)) ** 2 / (100.0 + 0.25 * across) / 2
        return total

    numerical = [(cost(pose + 1e-5 * e) - cost(pose - 1e-5 * e)) / 2e-5 for e in np.eye(3)]
    corners = np.linalg.norm(H) * 0.02  # a few points near corners belong to no line
    assert np.abs(g - numerical).max() < corners


def test_along_a_corridor_the_points_say_nothing_and_the_prior_decides() -> None:
    x = np.arange(-4, 4, 0.03)
    corridor = np.concatenate((np.stack((x, np.full(len(x), 1.0)), -1), np.stack((x, np.full(len(x), -1.0)), -1)))
    submap = drawn(corridor, [np.array([0.1 * k, 0.0, 0.0]) for k in range(-3, 4)])
    scan = corridor[np.abs(corridor[:, 0]) < 2]
    prior = np.array([0.2, 0.05, 0.02])
    hold = Hold(prior, np.diag([100.0, 100.0, 100.0]))
    pose, information, _ = match(submap, scan, prior, hold, SD, 6, 25)
    assert abs(pose[0] - 0.2) < 0.01
    assert np.abs(pose[1:]).max() < 0.005
    assert information[0, 0] < 0.02 * information[1, 1]


def noisy(points: Array, rng: np.random.Generator, sd: float) -> Array:
    """Points with errors along their beams."""
    return points * (1 + sd * rng.standard_normal(len(points)) / np.hypot(*points.T))[:, None]


@pytest.mark.parametrize("sd", [0.004, 0.008, 0.016])
def test_a_match_errs_as_its_points_do(sd: float) -> None:
    """On a map of 49 noisy scans, 12 matches from each of 20 places; by the least and the most that chance leaves."""
    rng = np.random.default_rng(0)
    cells, walls_seen = np.zeros((200, 160, 4), np.float32), room(spacing=0.05)
    for _ in range(7):
        for pose in POSES:
            insert(cells, ORIGIN, CELL, pose, HERE, noisy(act(inverse(pose), walls_seen), rng, sd))
    submap, squares, apart = Grid(cells, ORIGIN, CELL, SHARE), list[float](), list[Array]()
    for _ in range(20):
        true = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
        for _ in range(12):
            scan = noisy(act(inverse(true), walls_seen), rng, sd)
            pose, _, _ = match(submap, scan, true, Hold(true, NOTHING), SD, 6, 25)
            slope, scatter = spread(submap, scan, pose, SD)
            inverse_slope = np.linalg.inv(slope)
            off = pose - true
            squares.append(float(off @ np.linalg.inv(inverse_slope @ scatter @ inverse_slope) @ off / 3))
            apart.append(np.sqrt(np.diag(inverse_slope @ scatter @ inverse_slope)))
    # 720 squares have a mean within 0.89 and 1.11; the map's own errors and walls that look alike add, cells take away
    assert 0.5 < np.mean(squares) < 2
    assert 0.2 * sd < np.mean(apart, axis=0)[0] * np.sqrt(len(walls_seen)) < 4 * sd


@pytest.mark.parametrize("seed", range(5))
def test_the_spread_of_a_match_by_another_program(seed: int) -> None:
    """The slope by differences of the score, held by NumPy's eigenvalues; the scatter point by point."""
    rng = np.random.default_rng(seed)
    submap = drawn(room(), POSES)
    true = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
    scan = noisy(act(inverse(true), room(spacing=0.07)), rng, 0.01)
    pose, H, _ = match(submap, scan, true, Hold(true, NOTHING), SD, 6, 25)
    slope, scatter = spread(submap, scan, pose, SD)
    at_match = normal(submap, scan, pose)[0]
    columns = [(normal(submap, scan, pose + e)[1] - normal(submap, scan, pose - e)[1]) / (2 * e.sum()) for e in STRIDES]
    L = np.linalg.cholesky(at_match + 1e-3 * np.eye(3))
    inner = np.linalg.solve(L, np.linalg.solve(L, (np.array(columns) + np.array(columns).T) / 2).T)
    values, vectors = np.linalg.eigh(inner)
    expected = L @ (vectors * np.clip(values, 0.1, 1.0)) @ vectors.T @ L.T
    np.testing.assert_allclose(slope, expected, rtol=1e-6, atol=1e-6 * np.abs(H).max())

    sums = {True: [0.63, 0.0, np.zeros((3, 3))], False: [0.63, 0.0, np.zeros((3, 3))]}
    for (x, y), turned in zip(act(pose, scan) - ORIGIN, act(pose, scan) - pose[:2], strict=True):
        i, j, d2 = nearest(submap.cells, CELL, SHARE, x, y, 2)
        if i < 0 or d2 > 0.12**2:
            continue
        mx, my, nx, ny, along, across = line(submap.cells, CELL, SHARE, i, j)
        on_line = along > 9e-4 and across < 0.1 * along
        lever = np.array([[1, 0, -turned[1]], [0, 1, turned[0]]])
        off, by, variance = np.array([x - mx, y - my]) @ (nx, ny), np.array([[nx, ny]]) @ lever, SD**2 + 0.25 * across
        if not on_line:
            hits = submap.cells[i, j, HIT]
            mean = CELL * np.array([i, j]) + submap.cells[i, j, 2:] / hits
            off, by, variance = np.array([x, y]) - mean, lever, SD**2 + 0.04**2
        e = float((np.atleast_1d(off) ** 2).sum()) / variance
        w = 1 / (1 + e / 4)
        parts = sums[bool(on_line)]
        parts[0] += w**4 * e
        parts[1] += len(by) * w * w
        parts[2] = parts[2] + w * w / variance * by.T @ by
    own = sum(square / max(weight, 1e-9) * part for square, weight, part in sums.values())
    np.testing.assert_allclose(scatter, own, rtol=1e-6, atol=1e-9 * np.abs(H).max())


STRIDES = np.diag([0.006, 0.006, 0.002])


def normal(submap: Grid, scan: Array, pose: Array) -> tuple[Array, Array]:
    H, g = np.empty((3, 3)), np.empty(3)
    normal_equations(submap, scan, pose, SD, 2, 0.12**2, True, lines_of(scan), H, g)
    return H, g


def test_along_a_corridor_a_match_stays_unsure() -> None:
    """Points at its ends are too few to be sure by, and those on its walls tell nothing along it."""
    x = np.arange(-4, 4, 0.03)
    corridor = np.concatenate((np.stack((x, np.full(len(x), 1.0)), -1), np.stack((x, np.full(len(x), -1.0)), -1)))
    submap = drawn(corridor, [np.array([0.1 * k, 0.0, 0.0]) for k in range(-3, 4)])
    scan = noisy(corridor[np.abs(corridor[:, 0]) < 2], np.random.default_rng(0), 0.01)
    slope, scatter = spread(submap, scan, np.zeros(3), SD)
    sd = np.sqrt(np.diag(cov_by_points(slope, scatter, Settings())))
    assert sd[0] > 0.1
    assert sd[1] < 0.003
    assert sd[2] < 0.003


def test_the_nearest_wall_is_the_nearest_of_all() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        cells = np.zeros((30, 30, 4), np.float32)
        for i, j in rng.integers(0, 30, (rng.integers(1, 60), 2)):
            cells[i, j] = (1, 0, *rng.uniform(0, CELL, 2))
        x, y = rng.uniform(0, 30 * CELL, 2)
        at = np.argwhere(cells[:, :, 0] > 0)
        means = CELL * at + cells[at[:, 0], at[:, 1], 2:]
        near = np.abs(at - np.floor(np.array([x, y]) / CELL)).max(axis=1) <= 5
        i, j, d2 = nearest(cells, CELL, SHARE, x, y, 5)
        if not near.any():
            assert (i, j) == (-1, -1)
            continue
        squared = ((means - (x, y)) ** 2).sum(axis=1)
        assert abs(d2 - squared[near].min()) < 1e-12


def test_a_cell_knows_the_mean_of_its_hits_and_what_passed_through() -> None:
    cells = np.zeros((200, 160, 4), np.float32)
    points = np.array([[1.013, 0.024], [1.027, 0.044]])
    insert(cells, ORIGIN, CELL, np.zeros(3), HERE, points)
    hit = np.argwhere(cells[:, :, 0] > 0)
    assert hit.tolist() == [[120, 80]]
    assert cells[120, 80, 0] == 2
    mean = ORIGIN + CELL * hit[0] + cells[120, 80, 2:] / 2
    assert np.abs(mean - points.mean(axis=0)).max() < 1e-7
    assert cells[100:118, 80, 1].min() == 2  # the way there
    assert cells[120:, :, 1].max() == 0
    wall = walls(cells, SHARE)
    assert wall.sum() == 1


def test_a_scan_behind_walls_is_seen_through_them_and_one_in_the_open_ends_in_free_space() -> None:
    submap = drawn(room(), POSES)
    here, scan = np.zeros(3), room(spacing=0.05)
    through, free = seen_through(submap, here, HERE, scan, 0.25)
    assert through < 0.02
    assert free < 0.02
    through, _ = seen_through(submap, here, HERE, 1.4 * scan, 0.25)
    assert through > 0.8
    _, free = seen_through(submap, here, HERE, 0.5 * scan, 0.25)
    assert free > 0.8


@pytest.mark.parametrize("beams", [201, 401, 801])
@pytest.mark.parametrize("seed", range(8))
def test_the_noise_of_a_point_has_no_part_in_its_choice(seed: int, beams: int) -> None:
    """Of a corridor's walls, seen by a scanner between them, the points that are kept err to neither side.

    Nor do those of the wall at its end.
    """
    rng = np.random.default_rng(seed)
    angles = np.linspace(-1.57, 1.57, beams)
    true = np.minimum(1.1 / np.maximum(np.abs(np.sin(angles)), 1e-9), 6.0 / np.cos(angles))
    beside = true < 1.11 / np.abs(np.sin(angles))
    beside &= true * np.cos(angles) < 5.99
    off, ahead = list[float](), list[float]()
    for _ in range(400):
        noise = 0.015 * rng.standard_normal(len(true))
        points = (true + noise)[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        kept = thinned(points, 0.04)
        assert 0.15 * len(kept) < kept.sum() < 0.9 * len(kept)
        off += (noise * np.sin(angles))[kept & beside].tolist()  # to the left, of either wall
        ahead += noise[kept & ~beside].tolist()
    for one in (off, ahead):
        assert abs(np.mean(one)) < 5 * np.std(one) / np.sqrt(len(one))  # chosen by their own noise: more than 15


def test_points_are_thinned() -> None:
    points = np.stack((np.arange(0, 1, 0.01), np.zeros(100)), axis=-1)
    assert thinned(points, 0.04)[0]
    assert not thinned(points[:0], 0.04).any()
    kept = points[thinned(points, 0.04)]
    assert np.diff(kept[1:, 0]).min() >= 0.04 - 1e-12  # the first one aside
    assert len(kept) >= 20
    rng = np.random.default_rng(5)
    cloud = rng.uniform(-3, 3, (5000, 2))
    few = one_a_cell(cloud, 0.1)
    cells = {tuple(cell) for cell in np.floor(cloud / 0.1).astype(int).tolist()}
    assert len(few) == len(cells)
    assert {tuple(cell) for cell in np.floor(few / 0.1).astype(int).tolist()} == cells

"""The walk on a grid behind a simulated pose graph: exact, whatever the direction of its edges, or refused."""

from pathlib import Path

import numpy as np
import pytest

from refusals import refused_at
from slamduel.core.se2 import Array, between, wrap
from slamduel.core.table import Table
from slamduel.datasets.graphs.grid_walk import MEASURED, nearest, standing, walked

FILE = Path("graph.txt")


def square(count: int = 400) -> Array:
    """(n, 3) a walk round squares of 5 m, each of which begins 1 m further on."""
    poses = [np.zeros(3)]
    for k in range(1, count):
        x, y, heading = poses[-1]
        turn = np.pi / 2 if k % 6 == 5 else 0.0
        poses.append(np.array([x + np.cos(heading), y + np.sin(heading), heading + turn]))
    found = np.array(poses)
    return np.column_stack((np.rint(found[:, :2]), wrap(found[:, 2])))


def edges_of(poses: Array, noise: float = 0.0, seed: int = 0) -> Table:
    """All motions, some of them backwards, and as many loops, in the order of the later pose."""
    rng, n = np.random.default_rng(seed), len(poses)
    pairs = [(k - 1, k) if rng.random() < 0.7 else (k, k - 1) for k in range(1, n)]
    pairs += [tuple(rng.choice(n, 2, replace=False).tolist()) for _ in range(n)]
    pairs.sort(key=max)
    first, last = np.array(pairs).T
    motion = between(poses[first], poses[last])
    motion += noise * rng.standard_normal(motion.shape)
    rows = np.column_stack((10.0 * first, 10.0 * last, motion[:, :2], wrap(motion[:, 2])))
    return Table(FILE, ("from", "to", "dx", "dy", "dtheta"), rows, np.arange(1, len(rows) + 1))


@pytest.mark.parametrize(("noise", "within"), [(0.0, 1e-4), (1e-6, 1e-4), (0.08, MEASURED)])
def test_the_walk_is_exact_though_the_rows_are_not(noise: float, within: float) -> None:
    poses = square()
    walk = walked(edges_of(poses, noise), within)
    np.testing.assert_array_equal(walk.poses[:, :2], poses[:, :2])
    np.testing.assert_allclose(wrap(walk.poses[:, 2] - poses[:, 2]), 0, atol=1e-12)
    assert walk.ids.tolist() == list(range(0, 10 * len(poses), 10))
    assert np.abs(walk.poses[:, 2]).max() <= np.pi


def test_a_row_off_the_grid_a_contradiction_and_a_missing_motion_are_refused() -> None:
    edges = edges_of(square(40))
    loop = int(np.flatnonzero(np.abs(np.diff(edges.rows[:, :2], axis=1)[:, 0]) > 10)[3])
    off, wrong = edges.rows.copy(), edges.rows.copy()
    off[loop, 2] += 0.01
    wrong[loop, 3] += 1.0
    refused_at(FILE, f"line {loop + 1}: the motion is", walked, edges._replace(rows=off))
    refused_at(FILE, f"line {loop + 1}: pose", walked, edges._replace(rows=wrong))
    joins = np.sort(edges.rows[:, :2], axis=1)
    kept = np.flatnonzero((joins != [100, 110]).any(axis=1))
    refused_at(FILE, "no edge connects pose 100 to pose 110", walked, edges.take(kept))


def test_landmarks_are_where_every_sighting_has_them() -> None:
    walk = walked(edges_of(square(40)))
    places = np.array([[2.5, -3.5], [7.0, 1.5]])
    step, which = np.repeat(np.arange(40), 2), np.tile([0, 1], 40)
    x, y = (places[which] - walk.poses[step, :2]).T
    c, s = np.cos(walk.poses[step, 2]), np.sin(walk.poses[step, 2])
    rows = np.column_stack((walk.ids[step], 7 + which, np.round(c * x + s * y, 6), np.round(c * y - s * x, 6))).astype(
        np.float64
    )
    sightings = Table(FILE, ("pose", "id", "x", "y"), rows, np.arange(1, 81))
    known = standing(walk, sightings)
    assert known.ids.tolist() == [7, 8]
    np.testing.assert_array_equal(known.xy, places)
    moved = rows.copy()
    moved[50, 2] += 0.5
    refused_at(FILE, "line 51: landmark 7 is elsewhere", standing, walk, sightings._replace(rows=moved))


def test_the_nearest_poses_of_the_grid() -> None:
    poses = square(100)
    near = nearest(poses + 0.01 * np.random.default_rng(0).standard_normal(poses.shape))
    np.testing.assert_array_equal(near[:, :2], poses[:, :2])
    np.testing.assert_allclose(wrap(near[:, 2] - poses[:, 2]), 0, atol=1e-12)

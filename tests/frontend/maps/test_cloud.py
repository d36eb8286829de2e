"""Clouds of a depth camera: points on the surfaces that were seen, one of each cube, with their colours."""

from collections import defaultdict

import numpy as np
import pytest
from numpy.typing import NDArray

import depth_clouds as room
from slamduel.core.se2 import Array, act, compose
from slamduel.frontend.maps import cloud as clouds
from slamduel.frontend.maps.cloud import Cloud, cloud_of, merged, placed, thinned


def by_cube(points: Array, size: float) -> dict[tuple[int, ...], list[int]]:
    """Rows of points (n, 3) by the cube that they are in."""
    found = defaultdict[tuple[int, ...], list[int]](list)
    for row, point in enumerate(points):
        found[tuple(np.floor(point / size).astype(int).tolist())].append(row)
    return found


def test_a_cube_has_the_mean_of_its_points() -> None:
    rng = np.random.default_rng(0)
    points, colours = rng.normal(0, 1.5, (3000, 3)), rng.integers(0, 256, (3000, 3)).astype(np.uint8)
    weights = rng.integers(1, 5, 3000).astype(float)
    found = thinned(Cloud(points, colours, weights), 0.4)
    cubes = by_cube(points, 0.4)
    assert len(found.points) == len(cubes) < 2000
    for row, members in enumerate(cubes.values()):  # in the order of their first points
        w = weights[members]
        np.testing.assert_allclose(found.points[row], w @ points[members] / w.sum(), atol=1e-12)
        np.testing.assert_allclose(found.colours[row], w @ colours[members] / w.sum(), atol=0.5 + 1e-9)
        assert found.weights[row] == w.sum()


def test_points_lie_on_what_was_seen_and_have_its_colour() -> None:
    depth, colours = room.seen(room.PATH[20])
    found = cloud_of(room.CAMERA, room.CAMERA.mounting, depth, colours, (0.4, 2.8))
    assert len(found.points) > 800
    x, y = placed(room.spooled([found]), 0, room.PATH[20]).points[:, :2].T
    z = found.points[:, 2]
    red, green, _ = found.colours.T
    walls, floor = red == room.WALLS[0], green == room.FLOOR[1]
    assert walls.sum() > 100
    assert floor.sum() > 300
    # the mean of points on one plane lies on it; a point is kept to 5 mm
    assert np.abs(z[floor]).max() < 1e-6
    assert np.minimum(np.abs(np.abs(x[walls]) - room.HALF[0]), np.abs(np.abs(y[walls]) - room.HALF[1])).max() < 0.006
    cubes = by_cube(found.points, clouds.VOXEL)
    assert max(map(len, cubes.values())) == 1
    assert z.max() < 2.5


def test_pixels_beside_an_edge_and_beyond_the_limits_are_left_out() -> None:
    depth = np.full((240, 320), 2.0, np.float32)
    depth[:, 161:] = 1.0  # a surface in front of another one; its edge is between two pixels that are looked at
    depth[:100] = 0.0
    grey: NDArray[np.uint8] = np.full((240, 320), 77, np.uint8)
    found = cloud_of(room.CAMERA, np.eye(4), depth, grey, (0.4, 2.8))
    assert set(np.unique(found.points[:, 2])) == {1.0, 2.0}
    pixel = room.CAMERA.project(found.points)
    assert not ((pixel[:, 0] > 159.9) & (pixel[:, 0] < 161.1)).any()
    assert pixel[:, 1].min() > 100.5
    assert (found.colours == 77).all()
    assert (cloud_of(room.CAMERA, np.eye(4), depth, grey, (0.4, 1.5)).points[:, 2] == 1.0).all()
    assert len(cloud_of(room.CAMERA, np.eye(4), np.zeros_like(depth), grey, (0.4, 2.8)).points) == 0


def test_a_drive_is_the_same_cloud_however_many_are_thinned_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = room.room_clouds()
    whole = merged(found, room.PATH, 0.1)
    monkeypatch.setattr(clouds, "TOGETHER", 5)
    parts = merged(found, room.PATH, 0.1)
    assert whole.weights.sum() == parts.weights.sum() == len(found.points)
    order, again = (np.lexsort(np.floor(one.points / 0.1).T) for one in (whole, parts))
    np.testing.assert_allclose(whole.points[order], parts.points[again], atol=1e-9)
    cubes = [placed(found, k, pose).points for k, pose in enumerate(room.PATH)]
    assert len(whole.points) == len(by_cube(np.concatenate(cubes), 0.1))


def test_clouds_are_drawn_along_any_path() -> None:
    found, motion = room.room_clouds(), np.array([4.0, -2.0, 1.1])
    for k in (0, 20):
        moved = placed(found, k, compose(motion, room.PATH[k])).points
        there = placed(found, k, room.PATH[k]).points
        np.testing.assert_allclose(moved[:, :2], act(motion, there[:, :2]), atol=1e-12)
        np.testing.assert_array_equal(moved[:, 2], there[:, 2])

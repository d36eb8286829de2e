"""The comparison of surfaces, on planes that are known."""

import numpy as np
import pytest

from depth_scenes import CAMERA, on_planes
from slamduel.core.se2 import Array
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.depth.surfaces import Surfaces

ROOM = np.array([[0.0, 0, 1, 0], [-1, 0.2, 0, -3.0], [0, -1, 0, -1.5], [0, 1, 0, -1.5]])  # floor and three walls
NEARER = np.array([*ROOM, [-1.0, 0, 0, -1.8]])  # and a wall across it


def ahead(metres: float) -> Array:
    """(4, 4) T_world_camera of a robot that many metres on."""
    T = np.eye(4)
    T[0, 3] = metres
    return T @ CAMERA.mounting


def agreed(one: Array, first_at: float, other: Array, second_at: float, believed: float) -> bool:
    """Tells if the surfaces agree for a motion that is believed to be so many metres."""
    surfaces = Surfaces(CAMERA, Settings())
    first, second = (
        surfaces.coarse(on_planes(CAMERA, ahead(at), planes).astype(np.float32))
        for planes, at in ((one, first_at), (other, second_at))
    )
    T = np.linalg.inv(ahead(0.0)) @ ahead(believed)
    return surfaces.agree(first, second, T[:3, :3], T[:3, 3])


def test_the_same_room_from_two_places_agrees() -> None:
    assert agreed(ROOM, 0.0, ROOM, 0.4, 0.4)


@pytest.mark.parametrize("believed", [-0.6, 1.4])
def test_a_motion_that_moves_the_walls_is_contradicted(believed: float) -> None:
    assert not agreed(ROOM, 0.0, ROOM, 0.4, believed)


def test_a_wall_that_the_other_frame_sees_through_is_a_contradiction_in_either_order() -> None:
    assert not agreed(ROOM, 0.0, NEARER, 0.0, 0.0)
    assert not agreed(NEARER, 0.0, ROOM, 0.0, 0.0)


def test_frames_that_share_nothing_do_not_agree() -> None:
    surfaces = Surfaces(CAMERA, Settings())
    view = surfaces.coarse(on_planes(CAMERA, ahead(0.0), ROOM).astype(np.float32))
    back = np.diag([-1.0, 1.0, -1.0])  # looks the other way
    assert not surfaces.agree(view, view, back, np.zeros(3))
    assert not surfaces.agree(view, np.zeros_like(view), np.eye(3), np.zeros(3))
    assert surfaces.agree(view, view, np.eye(3), np.zeros(3))


def test_coarse_depths_are_those_of_their_rays() -> None:
    surfaces = Surfaces(CAMERA, Settings())
    depth = on_planes(CAMERA, CAMERA.mounting, np.array([[0.0, 0, 1, 0]]))
    coarse = surfaces.coarse(depth.astype(np.float32))
    step = 8 / 289.0
    left, top = CAMERA.rays[..., 0].min(), CAMERA.rays[..., 1].min()
    rows, columns = np.nonzero(coarse)
    rays = np.column_stack((left + step * columns, top + step * rows, np.ones(len(rows))))
    exact = -CAMERA.mounting[2, 3] / (rays @ CAMERA.mounting[2, :3])
    assert len(rows) > 500
    # the nearest pixel is up to half a pixel off: by 1/2 / 288 in the ray, times the depth's slope, z^2 / 0.7 m
    assert (np.abs(coarse[rows, columns] - exact) < 0.55 / 288 * exact**2 / 0.7 * 1.1).all()

"""A building in pictures: walls and people are where the scanner has them, and hide what is behind them."""

import numpy as np
import pytest

from slamduel.core.se2 import Array, act, compose
from slamduel.datasets.rendering._background import meet_all
from slamduel.datasets.rendering._casting import cast
from slamduel.datasets.rendering.cameras import CAMERAS, MOUNTING
from slamduel.datasets.rendering.disturbances import raised
from slamduel.datasets.rendering.people import NOBODY, standing_on_floor, upright
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import Marker, Room
from slamduel.datasets.rendering.room_scans import scanned
from slamduel.datasets.rendering.sheet import PAPER
from slamduel.datasets.rendering.surfaces import DENSITY, Surfaces

CAMERA = CAMERAS["pinhole"]
FLOOR = 130  # grey level of everything that is painted
FAR = np.array([[-10.0, -9, 10, -9], [10, -9, 10, 9], [10, 9, -10, 9], [-10, 9, -10, -9]])


def building(*walls: tuple[float, float, float, float], markers: tuple[Marker, ...] = ()) -> Renderer:
    """Its outer walls are 20 m by 18 m around the origin."""
    room = Room(20.0, 18.0, 2.5, 0.16, markers, walls=np.array([*FAR.tolist(), *walls]))
    plain = Surfaces(np.full((int(18 * DENSITY) + 400, int(76 * DENSITY)), FLOOR, np.uint8), int(18 * DENSITY))
    return Renderer(room, CAMERA, "4X4_50", plain, blur=0.0, vignetting=0.0)


def facing(x: float, y: float, up: float = 0.5) -> Marker:
    """A marker that looks along -x."""
    return Marker(3, np.array([[0.0, 0, -1, x], [-1, 0, 0, y], [0, 1, 0, up], [0, 0, 0, 1]]))


def seen(renderer: Renderer, people: Array = NOBODY) -> Array:
    """The picture from the origin, along x."""
    return renderer.scene(raised(np.zeros((1, 3)))[0] @ MOUNTING, people).astype(float)


def white(picture: Array) -> int:
    """How many pixels are of a marker's paper."""
    return int((np.abs(picture - PAPER) < 2).sum())


def test_what_is_behind_a_wall_or_a_person_is_hidden() -> None:
    free = building(markers=(facing(3.0, 0.0),))
    assert white(seen(free)) > 100
    assert white(seen(building((2.0, -1.0, 2.0, 1.0), markers=(facing(3.0, 0.0),)))) == 0
    assert white(seen(building((4.0, -1.0, 4.0, 1.0), markers=(facing(3.0, 0.0),)))) == white(seen(free))
    before, behind = (np.array([[x, 0.0, 0.3, 0.0, 1.7, 60.0]]) for x in (2.0, 4.0))
    assert white(seen(free, before)) == 0
    assert white(seen(free, behind)) == white(seen(free))
    half = np.array([[2.0, 0.3, 0.3, 0.0, 1.7, 60.0]])
    assert 0.2 * white(seen(free)) < white(seen(free, half)) < 0.8 * white(seen(free))


@pytest.mark.parametrize("seed", range(4))
def test_rays_meet_what_the_scanner_meets(seed: int) -> None:
    """Along the floor as far as `cast` says; a slanted ray ends on the floor or the wall, whichever is nearer."""
    rng = np.random.default_rng(seed)
    walls = np.concatenate((FAR, rng.uniform(-8, 8, (12, 4))))
    people = np.array([[*rng.uniform(-6, 6, 2), rng.uniform(0.1, 0.5), 0.0, 2.0, 90.0] for _ in range(5)])
    people = people[np.hypot(*people[:, :2].T) > 0.6]
    angles = rng.uniform(-np.pi, np.pi, 500)
    flat = np.stack((np.cos(angles), np.sin(angles)), axis=-1).astype(np.float32)
    slope = np.where(np.arange(500) % 2, 0.0, rng.uniform(-0.6, 0.0, 500)).astype(np.float32)
    rays, eye = np.vstack((flat.T, slope)), np.array([0.0, 0.0, 0.75])
    at, reach, grey = np.empty((3, 500), np.float32), np.empty(500, np.float32), np.empty(500, np.float32)
    size = 10.0, 9.0, 20.5, 160.0
    meet_all(rays, eye, np.column_stack((walls, np.zeros(len(walls)))), people, size, at, reach, grey)
    level = cast(walls, people[:, :3].copy(), 0.0, 0.0, flat.astype(float), 100.0)
    with np.errstate(divide="ignore"):
        expected = np.minimum(level, np.where(slope < 0, -0.75 / np.minimum(slope, -1e-12), np.inf))
    np.testing.assert_allclose(reach, expected, rtol=2e-5)
    np.testing.assert_allclose(at[2], 0.75 + reach * slope, atol=1e-5)
    on_wall = cast(walls, np.zeros((0, 3)), 0.0, 0.0, flat.astype(float), 100.0)
    np.testing.assert_array_equal(grey >= 0, (level < on_wall - 1e-9) & (level <= expected))
    onto_floor = (at[2] < 1e-6) & (slope < 0)
    assert onto_floor.sum() > 20
    np.testing.assert_allclose(at[0, onto_floor], 160 * (reach * flat[:, 0] + 10)[onto_floor] - 0.5, rtol=1e-4)


def test_legs_are_in_pictures_and_scans_at_one_place() -> None:
    """Where the scanner's beams end on a leg, the picture has the grey of trousers."""
    made = building()
    legs = np.array([[3.0, 0.2, 0.09], [3.1, 0.4, 0.09]])
    people = upright(legs, np.array([0]))
    np.testing.assert_array_equal(standing_on_floor(people), legs)
    still = scanned(
        made.room, lambda t: np.zeros((len(t), 3)), lambda t: people, np.arange(3.0), np.random.default_rng(0)
    )
    near = still.ranges[0] < 5.0
    assert near.sum() > 3
    points = act(
        compose(np.zeros(3), still.scanner.pose), still.ranges[0][near, None] * _along(still.scanner.angles[near])
    )
    assert (np.abs(np.hypot(*(points[:, None] - legs[:, :2]).transpose(2, 0, 1)).min(axis=1) - 0.09) < 0.08).all()
    picture = seen(made, people)
    inside = np.vstack([[x, y, 0.4] for x, y, _ in legs])
    pixels = CAMERA.project((inside - MOUNTING[:3, 3]) @ MOUNTING[:3, :3])
    for u, v in np.round(pixels).astype(int).tolist():
        assert picture[v, u] < 80 < FLOOR


def _along(angles: Array) -> Array:
    return np.stack((np.cos(angles), np.sin(angles)), axis=-1)

"""A printed sheet against points that are followed one by one: ink that spreads, paper that curls, gloss."""

import numpy as np
import pytest
from numpy.typing import NDArray

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.lens import Singles
from slamduel.datasets.rendering.marker_shots import SIDE, Studio
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import Marker, Room
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.datasets.rendering.sheet import INK, PAPER, SHINE, Print, Sheet, printed_sheets
from slamduel.datasets.rendering.surfaces import Surfaces
from slamduel.frontend.markers.aruco import Detector
from slamduel.frontend.markers.markers import Markers, find

ID, MODULES = 11, 6
EYE = np.array([0.4, -0.2, 1.5])
BLACK = {ID: np.zeros((4, 4), bool)}


def sheet(prints: Print, black: bool = False) -> Sheet:
    return printed_sheets("4X4_50", [ID], SIDE, BLACK if black else {}, prints)[ID]


def is_black(x: Array, y: Array) -> NDArray[np.bool_]:
    """Of points of the perfect print, m from its middle, to the right and up."""
    bits = np.asarray(find("4X4_50").generateImageMarker(ID, MODULES)) > 0
    column, row = (np.floor(MODULES * (0.5 + place / SIDE)).astype(int) for place in (x, -y))
    inside = (column >= 0) & (column < MODULES) & (row >= 0) & (row < MODULES)
    return inside & ~bits[np.clip(row, 0, 5), np.clip(column, 0, 5)]


def modules(made: Sheet, x: Array, y: Array) -> tuple[Singles, Singles]:
    """Columns and rows, in single precision and two dimensions, of points of the plane."""
    column, row, _ = made.to_sheet @ np.stack((x, y, np.ones_like(x)))
    return column.astype(np.float32)[None], row.astype(np.float32)[None]


def points(count: int = 20_000) -> tuple[Array, Array]:
    x, y = np.random.default_rng(1).uniform(-0.7 * SIDE, 0.7 * SIDE, (2, count))
    return x, y


@pytest.mark.parametrize("ink", [0.005, 0.02, -0.002, -0.02])
def test_ink_moves_every_edge_of_black(ink: float) -> None:
    """Black are the points with black within so much to the left or right and up or down; the others if it shrinks."""
    x, y = points()
    reach = abs(ink) * SIDE * np.array([-1.0, 0.0, 1.0])
    around = np.array([is_black(x + dx, y + dy) for dx in reach for dy in reach])
    made = sheet(Print(ink=ink))
    grey, hit = np.moveaxis(made.grey(*modules(made, x, y), EYE)[0], -1, 0)
    expected = around.any(axis=0) if ink > 0 else around.all(axis=0)
    assert (expected != is_black(x, y)).any()
    differs = (np.where(expected, INK, PAPER) != grey) & (hit > 0)
    assert differs.mean() < 1e-3  # single precision puts a few points on the other side of an edge
    np.testing.assert_array_equal(hit > 0, np.maximum(np.abs(x), np.abs(y)) < SIDE * 8 / 12)


@pytest.mark.parametrize("ink", [0.0, 0.005, -0.002])
def test_the_area_of_a_black_square_is_that_of_its_spread_side(ink: float) -> None:
    made = sheet(Print(ink=ink), black=True)
    fine = np.linspace(-0.6 * SIDE, 0.6 * SIDE, 2401)
    x, y = np.meshgrid(fine, fine)
    column, row = (place.astype(np.float32) for place in np.tensordot(made.to_sheet, (x, y, np.ones_like(x)), 1)[:2])
    area = (made.grey(column, row, EYE)[..., 0] == INK).mean() * (2401 / 2400 * 1.2) ** 2
    assert area == pytest.approx((1 + 2 * ink) ** 2, abs=4 * 1.2 / 2400)


@pytest.mark.parametrize("curl", [0.003, 0.02, -0.003, -0.02])
def test_bent_paper_is_met_where_its_points_are(curl: float) -> None:
    """Points of the paper are rolled onto the cylinder, and the ray to each is followed to the plane."""
    along, y = points(5000)
    half = SIDE * 8 / 12
    k = 2 * curl / half**2
    place = np.stack((np.sin(k * along) / k, y, (1 - np.cos(k * along)) / k))
    assert place[2].max() == pytest.approx(max(curl, 0) * (0.7 / (8 / 12)) ** 2, rel=0.02, abs=1e-5)
    share = EYE[2] / (EYE[2] - place[2])
    x_met, y_met = (EYE[i] + share * (place[i] - EYE[i]) for i in range(2))
    made = sheet(Print(curl=curl))
    grey, hit = np.moveaxis(made.grey(*modules(made, x_met, y_met), EYE)[0], -1, 0)
    there = np.maximum(np.abs(along), np.abs(y)) < half
    assert (there != (hit > 0)).mean() < 1e-3
    assert ((np.where(is_black(along, y), INK, PAPER) != grey) & there).mean() < 2e-3


def test_a_bent_sheet_is_whole_in_the_frame() -> None:
    """Against a frame with the part of the image that may show it taken far too large."""
    pose = np.array([[0, 0, -1.0, 0.5], [-1, 0, 0, 0.02], [0, 1, 0, 0.75], [0, 0, 0, 1.0]])
    room = Room(60.0, 60.0, 50.0, SIDE, (Marker(ID, pose),))
    plain = Surfaces(np.full((20, 20), 9, np.uint8), 10)
    camera = CAMERAS["pinhole"]
    made = Renderer(room, camera, "4X4_50", plain, blur=0.0, sensor=Sensor(0.0), prints=Print(curl=0.02))
    at = np.array([[0, 0, 1.0, 0], [-1, 0, 0, 0], [0, -1, 0, 0.75], [0, 0, 0, 1]])
    seen = made.scene(at)
    bent, k = sheet(Print(curl=0.02)), 2 * 0.02 / (SIDE * 8 / 12) ** 2
    edge = SIDE * 8 / 12
    SIGNS = (-1, 1)
    ends = np.array([[s * np.sin(k * edge) / k, t * edge, (1 - np.cos(k * edge)) / k] for s in SIGNS for t in SIGNS])
    corners = ends @ pose[:3, :3].T + pose[:3, 3] - at[:3, 3]
    pixels = camera.project(corners @ at[:3, :3])
    rows, columns = np.nonzero(seen > 20)
    assert [columns.min(), rows.min()] == pytest.approx(pixels.min(axis=0), abs=2)
    assert [columns.max(), rows.max()] == pytest.approx(pixels.max(axis=0), abs=2)
    assert bent.outline[:, 2].max() == 0.02


@pytest.mark.parametrize("curl", [0.0, 0.004])
def test_a_highlight_is_where_the_paper_mirrors_the_lamp(curl: float) -> None:
    made, lamp = sheet(Print(gloss=80.0, curl=curl)), np.array([-0.5, 0.3, 1.2])
    x, y = np.random.default_rng(2).uniform(-0.08, 0.08, (2, 30))
    column, row = modules(made, x, y)
    found = made.highlight(np.stack((column, row)), EYE, lamp)[0]
    for k in range(30):
        here = np.array([x[k], y[k], 0.0])
        to_eye, to_lamp = ((end - here) / np.linalg.norm(end - here) for end in (EYE, lamp))
        normal = np.array([-2 * curl / (SIDE * 8 / 12) ** 2 * x[k], 0.0, 1.0])
        normal[2] = np.sqrt(1 - normal[0] ** 2)
        half = (to_eye + to_lamp) / np.linalg.norm(to_eye + to_lamp)
        assert found[k] == pytest.approx(80 * (normal @ half) ** SHINE, rel=1e-3)
    behind = made.highlight(np.stack((column, row)), EYE, np.array([0.0, 0.0, -1.0]))
    assert (behind == 0).all()


def test_every_sensor_and_print_sees_the_same_markers() -> None:
    ideal = Studio(CAMERAS["pinhole"], samples=4)
    expected = ideal.place(1.0, np.random.default_rng(3))
    detector = Detector(Markers("4X4_50", SIDE), CAMERAS["pinhole"], "subpix")
    for sensor, prints in (
        (Sensor(tone="srgb", mosaic="edge-aware", sharpen=0.8, jpeg=85), Print()),
        (Sensor(photon=0.05, aberration=0.001, mosaic="bilinear"), Print()),
        (Sensor(), Print(ink=0.005, curl=0.003, gloss=60.0)),
    ):
        shot = Studio(CAMERAS["pinhole"], samples=4, sensor=sensor, prints=prints).place(1.0, np.random.default_rng(3))
        assert shot.id == expected.id
        np.testing.assert_array_equal(shot.pose, expected.pose)
        assert (shot.image != expected.image).any()
        assert [sighting.id for sighting in detector.detect(shot.image)[0]] == [expected.id]

"""A map from above, as a picture: the walls are where the beams ended, and a large map has larger pixels."""

import numpy as np

from slamduel.bench.drawing.map_picture import CELL, MOST, MapPicture, map_picture
from slamduel.core.beside import Scans
from slamduel.core.relations import Anchors
from slamduel.core.se2 import Array
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.maps.occupancy import occupancy
from square_room import square_room


def beside(recording: LaserRecording) -> Scans:
    """Its scans, each at a step of its own."""
    n, origin = len(recording.t), np.zeros((len(recording.t), 3))
    at = Anchors(np.arange(n), origin, origin, np.zeros(n))
    return Scans(at, recording.ranges.astype(np.float32), recording.scanner.angles, recording.scanner.pose)


def drawn(recording: LaserRecording, path: Array) -> MapPicture:
    return map_picture(occupancy(beside(recording), path, CELL, MOST), path)


def test_walls_are_where_the_beams_ended() -> None:
    recording = square_room()
    assert recording.odometry is not None
    picture = drawn(recording, recording.odometry)
    assert picture.cell == 0.05
    assert picture.bar == 1.0
    dark = np.argwhere(picture.image[:-12].max(axis=2) < 40)  # without the bar
    height = picture.image.shape[0] - 12
    x = picture.corner[0] + picture.cell * (dark[:, 1] + 0.5)
    y = picture.corner[1] + picture.cell * (height - 1 - dark[:, 0] + 0.5)
    off = np.minimum(np.abs(np.abs(x) - 2), np.abs(np.abs(y) - 1))
    assert len(dark) > 2 * (4 + 2) / 0.05 * 0.9
    assert off.max() < 0.05 + 1e-9
    assert (np.abs(x) < 2.06).all()
    assert (np.abs(y) < 1.06).all()
    moved = drawn(recording, recording.odometry + np.array([1000.0, 0, 0]))
    np.testing.assert_allclose(moved.corner, picture.corner + np.array([1000.0, 0.0]), atol=0.051)


def test_a_large_map_has_larger_pixels() -> None:
    recording = square_room()
    far = recording.odometry.copy()
    far[4:, 0] += 400.0
    picture = drawn(recording, far)
    assert max(picture.image.shape) <= 1600
    assert picture.cell > 0.2

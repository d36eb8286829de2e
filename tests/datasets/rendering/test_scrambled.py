"""Bits that are no marker's: no detector reads an id in them, and one that is asked finds the square."""

import cv2
import numpy as np

from slamduel.core.factors import UNKNOWN
from slamduel.datasets.rendering.sheet import LEAST_APART, scrambled
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Detector
from slamduel.frontend.markers.markers import Markers, find

CAMERA = Camera(640, 480, (576.0, 574.0), (320.0, 240.0), (0.0,) * 5, mounting(0.1, 0.0, 0.7, 0.3))
WORDS = find("4X4_50")


def sheet(bits: np.ndarray, module: int = 20) -> np.ndarray:
    """Bits in their black border on white paper."""
    drawn = np.where(np.pad(bits, 1), 255, 0).astype(np.uint8)
    return np.pad(np.kron(drawn, np.ones((module, module), np.uint8)), module, constant_values=255)


def test_no_pattern_is_near_a_marker() -> None:
    made = scrambled(WORDS, range(30), np.random.default_rng(0))
    assert list(made) == list(range(30))
    for bits in made.values():
        for name in range(50):
            word = np.asarray(WORDS.generateImageMarker(name, 6))[1:-1, 1:-1] > 0
            assert min((np.rot90(word, turns) != bits).sum() for turns in range(4)) >= LEAST_APART


def test_a_detector_finds_them_only_where_asked_and_beside_markers_that_it_reads() -> None:
    bits = scrambled(WORDS, [0], np.random.default_rng(1))[0]
    word = np.asarray(WORDS.generateImageMarker(7, 6))[1:-1, 1:-1] > 0
    image = np.full((480, 640), 255, np.uint8)
    image[100:260, 60:220], image[180:340, 400:560] = sheet(bits), sheet(word)
    # As a camera does: without blur, an edge is only known to be within a pixel.
    image = cv2.GaussianBlur(image, (0, 0), 0.7).astype(np.uint8)
    plain, asked = (Detector(Markers("4X4_50", 0.16), CAMERA, unread=unread) for unread in (False, True))
    assert [one.id for one in plain.detect(image)[0]] == [7]
    unread, read = asked.detect(image)[0]
    assert (unread.id, read.id) == (UNKNOWN, 7)
    # 120 px of 0.16 m: both are as far away, and the corners are where they are drawn.
    distance = 0.16 / 120 * np.linalg.norm([139.5 - 320, 179.5 - 240, 575])
    assert abs(np.linalg.norm(unread.pose[:3, 3]) / distance - 1) < 0.01
    np.testing.assert_allclose(np.sort(unread.corners[:, 0]), [79.5, 79.5, 199.5, 199.5], atol=0.1)
    np.testing.assert_allclose(np.sort(unread.corners[:, 1]), [119.5, 119.5, 239.5, 239.5], atol=0.1)
    assert (unread.corner_cov.diagonal() < 0.1).all()

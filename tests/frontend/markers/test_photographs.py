"""Photographs of AprilTags, all of them of id 0, on cubes in the sun: sharpened and compressed, some of them narrow."""

import cv2
import numpy as np
import pytest

from recorded import at_hand
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.markers.aruco import TWICE, Detector
from slamduel.frontend.markers.markers import Markers

FORWARD = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("photograph", "least"),
    [("33369213973_9d9bb4cc96_c", 11), ("34085369442_304b6bafd9_c", 16), ("34139872896_defdb2f8d9_c", 10)],
)
def test_tags_of_one_id_are_found_and_none_is_kept(photograph: str, least: int) -> None:
    """Of no other of the 587 ids is any found; what the camera's lens is hardly matters for that."""
    grey = np.asarray(cv2.imread(str(at_hand("apriltag") / f"{photograph}.jpg"), cv2.IMREAD_GRAYSCALE), np.uint8)
    height, width = grey.shape
    camera = Camera(width, height, (width, width), (width / 2, height / 2), (0.0,) * 5, FORWARD)
    found, rejected = Detector(Markers("APRILTAG_36h11", 0.1), camera).detect(grey)
    assert found == []
    assert rejected[TWICE] >= least

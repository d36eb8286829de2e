"""A camera's response in calibration files: it comes back, other readers pass over it, bad values are sentences."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML

from refusals import refused
from slamduel.frontend.camera.calibration import read, write_camera_info, write_opencv
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.response import Measured, Response

RESPONSE = Response(
    Measured(20 / 9, 1e-5), Measured(-0.1, 0.02), Measured(2 / 3, 0.01), Measured(4.1, 0.2), Measured(-0.01, 1e-3)
)
CAMERA = Camera(640, 480, (500.0, 501.0), (320.5, 240.5), (-0.2, 0.1, 0.0, 0.0, 0.0), np.eye(4), response=RESPONSE)


@pytest.mark.parametrize("name", ["a.yaml", "a.xml", "a.json", "info.yaml"])
@pytest.mark.parametrize("noise", [True, False], ids=["noise", "no noise"])
def test_the_response_comes_back(tmp_path: Path, name: str, noise: bool) -> None:
    response = RESPONSE if noise else replace(RESPONSE, noise=None, noise_by_grey=None)
    write = write_camera_info if name.startswith("info") else write_opencv
    write(tmp_path / name, replace(CAMERA, response=response))
    assert read(tmp_path / name, np.eye(4)).response == response
    write(tmp_path / name, replace(CAMERA, response=None))
    assert "response" not in (tmp_path / name).read_text()
    assert read(tmp_path / name, np.eye(4)).response is None


def test_other_readers_find_what_they_know(tmp_path: Path) -> None:
    """OpenCV's own, and plain YAML as ROS reads it."""
    write_opencv(tmp_path / "a.yaml", CAMERA)
    storage = cv2.FileStorage(str(tmp_path / "a.yaml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), CAMERA.matrix)
    assert storage.getNode("camera_response").getNode("gamma").real() == RESPONSE.gamma.value
    write_camera_info(tmp_path / "info.yaml", CAMERA)
    found = YAML(typ="safe", pure=True).load((tmp_path / "info.yaml").read_text())
    assert found["camera_matrix"]["data"] == CAMERA.matrix.ravel().tolist()
    assert found["camera_response"]["noise_by_grey_sd"] == 1e-3
    assert found["camera_response"]["gamma_sd"] == 1e-5


def test_the_notes_of_a_log_have_it_if_it_is_known() -> None:
    assert CAMERA.settings["response"] == RESPONSE.entries
    assert "response" not in replace(CAMERA, response=None).settings
    assert RESPONSE.entries["blur_sd"] == 0.01


def test_the_variance_is_a_line() -> None:
    assert RESPONSE.variance(100.0) == pytest.approx(3.1)
    assert replace(RESPONSE, noise=None).variance(100.0) is None


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("gamma:", "gama:", "found no gamma, expected a number from 0.3 to 5"),
        ("gamma_sd:", "sd:", "found no gamma_sd, expected a number, 0 or more"),
        ("gamma: 2.22", "gamma: 9.22", r"gamma: found 9\.2\d*, expected a number from 0.3 to 5"),
        ("gamma_sd: 1", "gamma_sd: -1", "gamma_sd: found -1.*, expected a number, 0 or more"),
        ("sharpening: -0.1", "sharpening: much", "sharpening: found 'much', expected a number from -1 to 5"),
        ("blur: 0.6", "blur: .nan #", "blur: found nan, expected a number from 0.05 to 50"),
        ("noise_by_grey_sd:", "other:", "found no noise_by_grey_sd, expected a number"),
        ("noise: 4.1", "noise: -4.1", "noise: found the variance -4.1 at grey level 0, expected 0 or more"),
        ("noise_by_grey: -0.01", "noise_by_grey: -0.1", "noise: found the variance -21.4 at grey level 255"),
        ("camera_response:", "camera_response: 3\nother:", "found '3', expected gamma, sharpening"),
    ],
)
def test_a_bad_response_is_a_sentence(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    path = tmp_path / "info.yaml"
    write_camera_info(path, CAMERA)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    refused(f"^{path}: camera_response: {sentence}", read, path, np.eye(4))

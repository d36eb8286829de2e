"""A camera's response from pictures of a board: what they were rendered with comes out, to its stated errors."""

import re
from functools import cache

import numpy as np
import pytest

from charuco_views import poses, sensed
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.frontend.boards import response_fit
from slamduel.frontend.boards.board import Board, find_corners
from slamduel.frontend.boards.charuco import Calibration, calibrate
from slamduel.frontend.boards.response_fit import FEWEST_PICTURES, BoardResponse, Pictures, pooled
from slamduel.frontend.boards.view import View
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.response import Measured
from slamduel.frontend.markers.aruco import Image

BOARD = Board(columns=5, rows=4, square=0.05, marker=0.028, dictionary="4X4_50")
CAMERA = Camera(480, 360, (440.0, 439.0), (241.0, 177.0), (-0.1, 0.02, 0.0, 0.0, 0.0), np.eye(4))
SIZE = (CAMERA.width, CAMERA.height)

_Shared = response_fit._Shared  # pyright: ignore[reportPrivateUsage]
DRAWN = 0.02
"""What the drawing's samples, a quarter of a pixel, put in: px of blur, and amounts of sharpening and tone."""


IDEAL = (Sensor(), 0.7, 0.0)
"""A camera without effects, the px of its blur, and no ink."""


@cache
def views(sensor: Sensor, blur: float, ink: float) -> tuple[Calibration, list[Image]]:
    rng = np.random.default_rng(1)
    images = sensed(CAMERA, poses(6, rng, distance=0.36, board=BOARD), sensor, rng, BOARD, blur, ink)
    found = [find_corners(BOARD, str(k), image) for k, image in enumerate(images)]
    return calibrate([view for view in found if isinstance(view, View)], SIZE, "5"), images


def response(sensor: Sensor, blur: float, ink: float) -> BoardResponse | str:
    found, images = views(sensor, blur, ink)
    pictures = Pictures(BOARD, found.camera)
    for fit in found.fits:
        pictures.add(fit, images[int(fit.view.name)])
    return pictures.result()


@cache
def ideal() -> BoardResponse:
    found = response(*IDEAL)
    assert isinstance(found, BoardResponse)
    return found


def is_right(found: Measured, true: float, allowance: float = 0.0) -> bool:
    return abs(found.value - true) < 4 * found.sd + allowance


@pytest.mark.slow
def test_an_ideal_camera() -> None:
    """The noise of rounding has the variance 1/12."""
    found = ideal()
    assert is_right(found.response.gamma, 1.0, DRAWN)
    assert is_right(found.response.sharpening, 0.0, DRAWN)
    assert is_right(found.response.blur, 0.7, DRAWN)
    assert is_right(found.ink, 0.0, 1e-5)
    assert found.response.gamma.sd < 0.05
    assert found.response.sharpening.sd < 0.05
    assert found.response.noise is not None
    assert found.response.noise_by_grey is not None
    assert is_right(found.response.noise, 4 + 1 / 12)
    assert is_right(found.response.noise_by_grey, 0.0)
    assert found.response.noise.sd < 0.5
    assert found.pictures == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensor", "blur", "ink"),
    [
        (Sensor(tone=1.8), 0.8, 0.0),
        (Sensor(tone=2.2), 0.6, 0.0),
        (Sensor(sharpen=0.8), 0.7, 0.0),
        (Sensor(), 0.7, 0.05 / 240),
        (Sensor(tone=2.2, sharpen=0.5), 0.7, 0.0),
        (Sensor(grain=1.0, photon=0.02), 1.0, 0.0),
    ],
    ids=["gamma 1.8", "gamma 2.2", "sharp", "ink", "gamma and sharp", "photons"],
)
def test_what_a_camera_does_is_found(sensor: Sensor, blur: float, ink: float) -> None:
    """A tenth of the ink is allowed for corners, where two edges meet, both moved; and as much of a gamma above 1."""
    found = response(sensor, blur, ink)
    assert isinstance(found, BoardResponse)
    gamma = 1.0 if isinstance(sensor.tone, str) else sensor.tone
    assert is_right(found.response.gamma, gamma, DRAWN + 0.1 * (gamma - 1))
    assert is_right(found.response.sharpening, sensor.sharpen, DRAWN + 0.05 * (gamma - 1))
    assert is_right(found.response.blur, blur, DRAWN)
    assert is_right(found.ink, ink, 1e-5 + 0.1 * ink)
    if gamma == 1.0 and not sensor.sharpen:
        assert found.response.noise is not None
        assert found.response.noise_by_grey is not None
        assert is_right(found.response.noise, sensor.grain**2 + 1 / 12)
        assert is_right(found.response.noise_by_grey, sensor.photon)


def test_too_few_pictures_and_overexposed_ones_are_told() -> None:
    found, images = views(*IDEAL)
    for bright, count, sentence in (
        (1.0, FEWEST_PICTURES - 1, f"usable markers in {FEWEST_PICTURES - 1} pictures, expected at least 12 in 4"),
        (1.3, 4, "found 0 usable markers in 0 pictures, expected at least 12 in 4: .* are overexposed"),
    ):
        pictures = Pictures(BOARD, found.camera)
        for fit in found.fits[:count]:
            image = images[int(fit.view.name)]
            pictures.add(fit, np.asarray(np.minimum(bright * image.astype(float), 255), np.uint8))
        told = pictures.result()
        assert isinstance(told, str)
        assert re.search(sentence, told)


def test_markers_that_nearly_touch_black_squares_are_told() -> None:
    found, images = views(*IDEAL)
    tight = Board(columns=5, rows=4, square=0.05, marker=0.045, dictionary="4X4_50")
    pictures = Pictures(tight, found.camera)
    for fit in found.fits:
        pictures.add(fit, images[int(fit.view.name)])
    told = pictures.result()
    assert isinstance(told, str)
    assert "are too small for the white around them" in told


def test_pictures_add_up_and_their_errors_are_as_stated() -> None:
    """Of random quadratic losses: errors over standard errors have mean square 1, and a bad picture hardly counts.

    With n pictures the jackknife's variance has n - 1 degrees of freedom, and the error over it is Student's t, of
    variance (n - 1) / (n - 3); six standard deviations of its mean square over the draws are allowed.
    """
    rng = np.random.default_rng(2)
    true, n, draws = np.array([0.01, 0.5, 0.3]), 12, 200
    ratios, pictures = list[float](), list[_Shared]()
    for _ in range(draws):
        pictures = list[_Shared]()
        for _ in range(n):
            root = rng.normal(size=(3, 8))
            normal = root @ root.T
            pictures.append(_Shared(normal, normal @ true + root @ rng.normal(size=8)))
        common, sd = pooled(pictures)
        ratios += list((common - true) ** 2 / sd**2)
    assert np.mean(ratios) == pytest.approx((n - 1) / (n - 3), abs=6 * 2.2 / np.sqrt(draws))
    pictures[3] = _Shared(pictures[3].normal, pictures[3].right + pictures[3].normal @ np.array([0, 60.0, 0]))
    plain = np.linalg.solve(sum(p.normal for p in pictures), sum(p.right for p in pictures))
    assert abs(pooled(pictures)[0][1] - true[1]) < 0.3 * abs(plain[1] - true[1])

"""ChArUco calibration: cameras that are known come out again, within what is said of how well they are known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from charuco_views import BOARD, corners, photographs, poses
from recorded import at_hand
from refusals import refused
from slamduel.frontend.boards.board import Board, find_corners, read_board
from slamduel.frontend.boards.charuco import calibrate
from slamduel.frontend.boards.view import View
from slamduel.frontend.camera.camera import Camera

SIZE = (400, 300)
FOURTEEN = (0.72, 0.07, -5e-4, 3e-4, 9e-4, 1.05, 0.23, 0.0027, 0.0012, -4e-4, -9e-4, 3e-4, 0.011, -0.008)
CAMERAS = {
    "5": Camera(*SIZE, (330, 328), (203, 147), (-0.2, 0.06, 0.001, -0.0008, 0.0), np.eye(4)),
    "8": Camera(*SIZE, (240, 239), (203, 147), (0.76, 0.07, 0.0004, -0.0003, 0.0011, 1.1, 0.24, 0.0031), np.eye(4)),
    "14": Camera(*SIZE, (270, 269), (203, 147), FOURTEEN, np.eye(4)),
    "fisheye": Camera(*SIZE, (180, 179), (203, 147), (-0.0121, 0.0043, -0.0021, 0.0003), np.eye(4), "fisheye"),
}
"""400x300, the images of the tests."""


def views(model: str, count: int = 10, noise: float = 0.1, tilt: float = 35) -> list[View]:
    camera, rng = CAMERAS[model], np.random.default_rng(1)
    placed = poses(count, rng, tilt, distance=0.42 * camera.focal[0] / 330)
    return [corners(camera, pose, f"view {k}", noise, rng) for k, pose in enumerate(placed)]


@pytest.mark.slow
@pytest.mark.parametrize("model", CAMERAS)
def test_rendered_views_give_the_camera_again(model: str) -> None:
    """Focal lengths to 0.5 %: four of the standard deviations that ten such views leave, 0.1 % or so."""
    camera, rng = CAMERAS[model], np.random.default_rng(1)
    images = photographs(camera, poses(10, rng, distance=0.42 * camera.focal[0] / 330))
    found = [find_corners(BOARD, str(k), image) for k, image in enumerate(images)]
    used = [view for view in found if isinstance(view, View)]
    assert len(used) == len(images)
    calibration = calibrate(used, SIZE, model)
    assert calibration.rms < 0.3
    np.testing.assert_allclose(calibration.camera.focal, camera.focal, rtol=0.005)
    assert len(calibration.camera.distortion) == len(camera.distortion)
    assert calibration.camera.model == camera.model
    # The coefficients trade against each other; what counts is where rays go, wherever corners were seen.
    seen = np.vstack([view.corners for view in used])
    off = calibration.camera.undistort(seen) - camera.undistort(seen)
    if model != "14":  # a tilted sensor trades against the centre, which turns the camera
        assert np.sqrt((off**2).mean()) * camera.focal[0] < 1
    assert not any(fit.bad for fit in calibration.fits)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["5", "fisheye"])
def test_the_stated_standard_deviations_are_true(model: str) -> None:
    """Over 16 draws of the corners' noise errors over stated sd have the mean square 1, within four of its own sd."""
    camera, rng = CAMERAS[model], np.random.default_rng(2)
    placed = poses(8, rng, distance=0.42 * camera.focal[0] / 330)
    squares = np.zeros(4)
    draws = 16
    for _ in range(draws):
        found = calibrate([corners(camera, pose, "", 0.1, rng) for pose in placed], SIZE, model)
        errors = np.array([*found.camera.focal, *found.camera.centre]) - [*camera.focal, *camera.centre]
        squares += (errors / found.sd[:4]) ** 2 / draws
    assert (squares < 1 + 4 * np.sqrt(2 / draws)).all()
    assert squares.mean() > 0.4


def test_standard_deviations_are_opencvs() -> None:
    used = views("5")
    points, seen = ([np.asarray(getattr(view, part), np.float32) for view in used] for part in ("points", "corners"))
    opencv = cv2.calibrateCameraExtended(points, seen, SIZE, np.zeros((3, 3)), np.zeros(5))
    found = calibrate(used, SIZE, "5")
    assert found.rms == pytest.approx(opencv[0], rel=1e-4)
    np.testing.assert_allclose(found.sd, np.ravel(opencv[5])[:9], rtol=1e-2)
    np.testing.assert_allclose([fit.error for fit in found.fits], np.ravel(opencv[7]), rtol=1e-4)


def test_too_few_views_are_refused() -> None:
    refused("found 3 usable views of the board, expected at least 4", calibrate, views("5", 3), SIZE, "5")


def test_views_from_one_side_are_refused() -> None:
    """However many: a plane that is only shifted says little of the focal length."""
    said = r"too similar: the board turns by at most [0-3]\.[0-9] degrees"
    refused(said, calibrate, views("5", 20, tilt=0.5), SIZE, "5")


def test_a_lens_too_rich_for_its_views_is_refused() -> None:
    refused("do not determine the lens model 14: the focal", calibrate, views("14", 4, noise=1.2, tilt=15), SIZE, "14")


def test_a_bad_view_is_named_and_kept() -> None:
    used = views("5")
    shifted = np.random.default_rng(5).normal(0, 1, used[3].corners.shape)
    found = calibrate([*used[:3], used[3]._replace(corners=used[3].corners + shifted), *used[4:]], SIZE, "5")
    assert [fit.view.name for fit in found.fits if fit.bad] == ["view 3"]
    assert any(remark.startswith("view 3 fits badly") for remark in found.remarks)


def test_corners_in_the_middle_only_are_remarked_on() -> None:
    used = views("5", noise=0.02)
    middle = [
        View(v.name, v.ids[near], v.corners[near], v.points[near])
        for v in used
        if (near := (np.abs(v.corners - [200, 150]) < [90, 70]).all(axis=1)).sum() >= 8
    ]
    found = calibrate(middle, SIZE, "5")
    assert found.coverage < 0.35
    assert any("of the image only: add views with the board near its edges" in remark for remark in found.remarks)


def test_views_without_the_board_say_why() -> None:
    image = photographs(CAMERAS["5"], poses(1, np.random.default_rng(1)))[0]
    assert find_corners(BOARD, "", np.full_like(image, 128)) == "no marker of 4X4_50"
    assert find_corners(replace(BOARD, dictionary="6X6_250"), "", image) == "no marker of 6X6_250"
    assert find_corners(replace(BOARD, legacy=True), "", image) == "only fits a board with legacy=false"
    turned = replace(BOARD, columns=BOARD.rows, rows=BOARD.columns)
    said = f"only fits a board with columns={BOARD.columns},rows={BOARD.rows}"
    assert str(find_corners(turned, "", image)).startswith(said)
    assert "corners, fewer than 8" in str(find_corners(BOARD, "", image[90:190, 120:220]))


def test_boards_from_the_command_line() -> None:
    text = "charuco[columns=8, rows=6,square=0.05,marker=0.03,dictionary=4X4_50,legacy=True]"
    assert read_board(text) == Board(8, 6, 0.05, 0.03, "4X4_50", legacy=True)
    assert read_board("charuco") == Board()
    own = read_board("charuco[dictionary=custom[count=30,size=4,seed=0],rows=5]")
    assert isinstance(own, Board)
    assert own.dictionary.startswith("custom[count")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("chess[columns=5]", "found 'chess.columns=5.', expected charuco"),
        ("charuco[columns=5", "found 'charuco.columns=5', expected charuco"),
        ("charuco[columns]", "found 'columns', expected one of columns, rows"),
        ("charuco[width=5]", "found 'width=5', expected one of columns, rows"),
        ("charuco[columns=5.5]", "columns: found '5.5', expected a whole number"),
        ("charuco[square=wide]", "square: found 'wide', expected a length in m"),
        ("charuco[legacy=maybe]", "legacy: found 'maybe', expected true or false"),
        ("charuco[columns=1]", "board: found 1 x 7 squares, expected at least 2 x 2"),
        ("charuco[columns=30,rows=30]", "at most as many as the 250 markers of 6X6_250 fill"),
        ("charuco[marker=0.05]", "board: found markers of 0.05 m in squares of 0.04 m, expected them smaller"),
        ("charuco[square=nan]", "board: found markers of 0.02 m in squares of nan m"),
        ("charuco[dictionary=9X9]", "marker dictionary: .*'9X9'"),
    ],
)
def test_what_is_no_board_is_refused(text: str, message: str) -> None:
    refused(f"^--board: .*{message}", read_board, text)


def test_real_views_give_the_published_focal_length() -> None:
    board = read_board("charuco[columns=5,rows=7,square=0.04,marker=0.02,dictionary=6X6_250]")
    assert isinstance(board, Board)
    found = []
    for name in ("img_00.jpg", "img_01.jpg", "img_02.jpg", "img_03.jpg"):  # choriginal.jpg is img_01.jpg again
        image = cv2.imread(str(at_hand("aruco") / name), cv2.IMREAD_GRAYSCALE)
        view = find_corners(board, name, np.asarray(image, np.uint8))
        assert isinstance(view, View)
        assert len(view.ids) == 24
        found.append(view)
    calibration = calibrate(found, (640, 480), "5")
    np.testing.assert_allclose(calibration.camera.focal, (452.51, 456.77), rtol=0.02)
    assert calibration.rms < 0.25
    assert any("the focal length is known to 3.5 % only" in remark for remark in calibration.remarks)

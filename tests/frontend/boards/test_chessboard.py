"""Chessboards: their corners in rendered pictures of every kind, and the boards that pictures show instead."""

import cv2
import numpy as np
import pytest

from charuco_views import BOARD, Squares, photographs, poses
from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.boards.board import Board, read_board
from slamduel.frontend.boards.charuco import calibrate
from slamduel.frontend.boards.chessboard import Chessboard
from slamduel.frontend.boards.other_board import other_board
from slamduel.frontend.boards.view import View
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.markers.aruco import Image
from tiers import first_quick

CAMERA = Camera(400, 300, (330, 328), (203, 147), (-0.2, 0.06, 0.001, -0.0008, 0.0), np.eye(4))
SQUARES = Squares(9, 7, 0.03)
CHESSBOARD = Chessboard(8, 6, 0.03)
EMPTY: Image = np.full((300, 400), 110, np.uint8)


def course(count: int, rng: np.random.Generator) -> tuple[list[Image], list[Array], list[bool | None]]:
    """Pictures as students take them, the true corners (n, 2), px, and if all of the board is in the picture.

    None: of its outer squares a part is not, and it may be found or not.

    In every kind of light, some blurred, one in eight without the board, one in ten with a part of it outside.
    """
    placed = poses(count, rng, board=SQUARES, distance=0.44)
    for k, pose in enumerate(placed):
        if k % 10 == 9:
            pose[0, 3] += 0.24
    images, truth, wholes = list[Image](), list[Array](), list[bool | None]()
    row, column = np.divmod(np.arange(48), 8)
    points = 0.03 * np.column_stack((column + 1, row + 1, np.zeros(48)))
    outline = 0.03 * np.array([[0.0, 0, 0], [9, 0, 0], [9, 7, 0], [0, 7, 0]])
    y, x = np.mgrid[-1:1:300j, -1:1:400j]
    for k, (pose, taken) in enumerate(zip(placed, photographs(CAMERA, placed, SQUARES), strict=True)):
        seen = CAMERA.project(points @ pose[:3, :3].T + pose[:3, 3])
        rim = CAMERA.project(outline @ pose[:3, :3].T + pose[:3, 3])
        all_of_it, inner = (bool(((one > 4) & (one < [395, 295])).all()) for one in (rim, seen))
        light = 20 + rng.uniform(0.25, 0.9) * (EMPTY if k % 8 == 5 else taken).astype(float)
        light *= 1 - rng.uniform(0, 0.4) * (x**2 + y**2)
        blurred = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.3, 1.2))
        images.append(np.clip(blurred + rng.normal(0, 3, light.shape), 0, 255).astype(np.uint8))
        truth.append(seen)
        wholes.append(False if k % 8 == 5 or not inner else True if all_of_it else None)
    return images, truth, wholes


def check_course(count: int, seed: int) -> None:
    images, truth, wholes = course(count, np.random.default_rng(seed))
    found = [CHESSBOARD.find(str(k), image) for k, image in enumerate(images)]
    errors = list[float]()
    for seen, true, whole in zip(found, truth, wholes, strict=True):
        assert whole is None or isinstance(seen, View) == whole
        if isinstance(seen, View):
            turned = (np.linalg.norm(seen.corners - corners, axis=1) for corners in (true, true[::-1]))
            errors.append(float(min(np.sqrt((off**2).mean()) for off in turned)))
    assert len(errors) >= 0.5 * count
    assert wholes.count(None) < 0.3 * count
    assert max(errors) < 0.5
    assert np.median(errors) < 0.15
    used = [view for view in found if isinstance(view, View)]
    calibration = calibrate(used, (400, 300), "5")
    assert np.abs(np.array(calibration.camera.focal) - CAMERA.focal).max() < 4 * calibration.sd[:2].max() + 0.5
    assert not any(fit.bad for fit in calibration.fits)


@pytest.mark.parametrize("seed", first_quick([1, 2, 3]))
def test_41_pictures_of_a_course_give_the_camera(seed: int) -> None:
    check_course(41, seed)


@pytest.mark.parametrize("turn", [0, 90, 180])
def test_corners_are_right_handed_however_the_board_is_held(turn: int) -> None:
    """Seen from the front, the columns go to the right of the rows; so the board's pose has it in front, not behind."""
    pose = poses(1, np.random.default_rng(0), board=SQUARES, distance=0.45)[0]
    middle = pose[:3, :3] @ np.array([0.135, 0.105, 0]) + pose[:3, 3]
    pose[:3, :3] = cv2.Rodrigues(np.array([0, 0, np.radians(turn)]))[0] @ pose[:3, :3]
    pose[:3, 3] = middle - pose[:3, :3] @ np.array([0.135, 0.105, 0])
    seen = CHESSBOARD.find("a", photographs(CAMERA, [pose], SQUARES)[0])
    assert isinstance(seen, View)
    grid = seen.corners.reshape(6, 8, 2)
    right, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    assert right[0] * down[1] - right[1] * down[0] > 0
    assert np.linalg.norm(right) > np.linalg.norm(down)


def test_a_board_is_parsed() -> None:
    assert read_board("chessboard[columns=7,rows=9,square=0.02]") == Chessboard(7, 9, 0.02)
    assert read_board(" chessboard ") == Chessboard()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("checkers", "found 'checkers', expected charuco"),
        ("chessboard[marker=0.02]", "found 'marker=0.02', expected one of columns, rows, square"),
        ("chessboard[columns=2]", "found 2 x 6 inner corners, expected 3 to 60 along each side"),
        ("chessboard[square=25]", "square: "),
        ("chessboard[rows=x]", "rows: found 'x', expected a whole number"),
    ],
)
def test_a_board_that_is_none_is_refused(text: str, message: str) -> None:
    refused(f"^--board: .*{message}", read_board, text)


def pictures_of(board: Board | Squares, count: int = 3) -> list[Image]:
    distance = 0.45 * max(board.columns * board.square / 0.32, 1)
    return photographs(CAMERA, poses(count, np.random.default_rng(3), 20, distance, board), board)


@pytest.mark.parametrize(
    ("shown", "asked", "sentence"),
    [
        (SQUARES, BOARD, "found a chessboard of 8 x 6 inner corners in 3 of 4 pictures"),
        (SQUARES, Chessboard(9, 7), "found a chessboard of 8 x 6 inner corners in 3 of 4 pictures"),
        (BOARD, CHESSBOARD, "found markers of the dictionary 4X4_50, as of a ChArUco board, in 3 of 4 pictures"),
        (BOARD, Board(8, 6, 0.04, 0.03, "5X5_50"), "found markers of the dictionary 4X4_50, as of a ChArUco board"),
        (BOARD, Board(4, 3, 0.04, 0.03, "4X4_50"), "found a ChArUco board of 47 squares at least in 3 of 4 pictures"),
    ],
)
def test_pictures_of_another_board_say_which(shown: Board | Squares, asked: Board | Chessboard, sentence: str) -> None:
    said = other_board([*pictures_of(shown), EMPTY], asked)
    assert said is not None
    assert said.startswith(sentence)


def test_pictures_of_the_same_board_or_of_none_say_nothing() -> None:
    assert other_board(pictures_of(SQUARES), Chessboard(6, 8, 0.03)) is None
    assert other_board(pictures_of(BOARD), BOARD) is None
    assert other_board([EMPTY], CHESSBOARD) is None
    assert other_board([], CHESSBOARD) is None

"""bench calibrate: from pictures to a calibration file, or a sentence that says why not."""

import os
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from charuco_views import Squares, photographs, poses, sensed
from command import run
from slamduel.bench.commands import calibrate
from slamduel.core.errors import InputError
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.frontend.boards.board import Board
from slamduel.frontend.camera.calibration import read
from slamduel.frontend.camera.camera import Camera

BOARD = "charuco[columns=8,rows=6,square=0.04,marker=0.03,dictionary=4X4_50]"
CAMERA = Camera(400, 300, (330, 328), (203, 147), (-0.2, 0.06, 0.001, -0.0008, 0.0), np.eye(4))

bench = partial(run, calibrate)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("views")
    for k, image in enumerate(photographs(CAMERA, poses(6, np.random.default_rng(1)))):
        cv2.imwrite(str(folder / f"view_{k}.png"), image)
    return folder


def test_a_folder_becomes_a_calibration(tmp_path: Path, pictures: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, info, picture = tmp_path / "calibration.yaml", tmp_path / "info.yaml", tmp_path / "coverage.png"
    assert bench(pictures, "--board", BOARD, "--out", out, "--camera-info", info, "--picture", picture) == 0
    found = read(out, np.eye(4))
    np.testing.assert_allclose(found.focal, CAMERA.focal, rtol=0.01)
    assert (found.width, found.height) == (400, 300)
    assert read(info, np.eye(4)).distortion == found.distortion
    drawn = cv2.imread(str(picture))
    assert drawn.shape[0] > 300
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) > 20
    said = capsys.readouterr().out
    assert f"focal length {found.focal[0]:.1f} ±" in said
    assert "RMS in 6 views" in said
    assert all(f"view_{k}.png" in said for k in range(6))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calibration.yaml", "coverage.png", "info.yaml"]
    assert found.response is None
    assert "response to light not measured: found 0 usable markers in 0 pictures" in said


def test_a_chessboard_becomes_a_calibration_and_another_board_is_named(
    tmp_path: Path, pictures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, squares = tmp_path / "views", Squares(9, 7, 0.03)
    folder.mkdir()
    placed = poses(6, np.random.default_rng(1), board=squares, distance=0.36)
    for k, image in enumerate([*photographs(CAMERA, placed, squares), np.full((300, 400), 90, np.uint8)]):
        cv2.imwrite(str(folder / f"{k}.png"), image)
    out = tmp_path / "calibration.yaml"
    assert bench(folder, "--board", "chessboard[columns=8,rows=6,square=0.03]", "--out", out) == 0
    np.testing.assert_allclose(read(out, np.eye(4)).focal, CAMERA.focal, rtol=0.01)
    said = capsys.readouterr().out
    assert "Left out 6.png: no whole chessboard of 8 x 6 inner corners" in said
    assert "response to light not measured: a chessboard has no markers" in said
    out.unlink()
    expected = r"^calibration: found a chessboard of 8 x 6 inner corners in 6 of 7 pictures, expected charuco\["
    with pytest.raises(InputError, match=expected):
        bench(folder, "--board", BOARD, "--out", out)
    with pytest.raises(InputError, match=r"^calibration: found markers of the dictionary 4X4_50, as of a ChArUco"):
        bench(pictures / "view_0.png", "--board", "chessboard", "--out", out)
    assert not out.exists()


def test_the_cameras_response_is_told_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From two folders with images of the same names, one of them without the board, one a copy."""
    board, rng = Board(columns=5, rows=4, square=0.05, marker=0.028, dictionary="4X4_50"), np.random.default_rng(1)
    camera = Camera(480, 360, (440.0, 439.0), (241.0, 177.0), (0.0, 0.0, 0.0, 0.0, 0.0), np.eye(4))
    images = sensed(camera, poses(6, rng, distance=0.36, board=board), Sensor(tone=1.8), rng, board)
    for folder, part in (("one", [np.full_like(images[0], 128), *images[:3]]), ("two", [images[0], *images[3:]])):
        (tmp_path / folder).mkdir()
        for k, image in enumerate(part):
            cv2.imwrite(str(tmp_path / folder / f"{k}.png"), image)
    out, info = tmp_path / "c.yaml", tmp_path / "info.yaml"
    words = "charuco[columns=5,rows=4,square=0.05,marker=0.028,dictionary=4X4_50]"
    assert bench(tmp_path / "one", tmp_path / "two", "--board", words, "--out", out, "--camera-info", info) == 0
    found = read(out, np.eye(4)).response
    assert found.gamma.value == pytest.approx(1.8, abs=0.15)
    assert read(info, np.eye(4)).response == found
    said = capsys.readouterr().out
    assert f"tone curve of gamma {found.gamma.value:.2f}" in said
    assert "markers in 6 views" in said
    assert "edges of the board's black are" in said
    assert " at 200: variance " in said


def test_a_video_becomes_a_calibration(tmp_path: Path, pictures: Path) -> None:
    film = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 10, (400, 300))
    for k in range(6):
        image = cv2.imread(str(pictures / f"view_{k}.png"))
        assert image is not None
        writer.write(image)
    writer.release()
    assert bench(film, "--board", BOARD, "--out", tmp_path / "c.json", "--quiet") == 0
    np.testing.assert_allclose(read(tmp_path / "c.json", np.eye(4)).focal, CAMERA.focal, rtol=0.01)


def test_what_is_left_out_is_said(tmp_path: Path, pictures: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "torn.png").write_bytes((pictures / "view_0.png").read_bytes()[:200])
    (tmp_path / "copy.png").write_bytes((pictures / "view_0.png").read_bytes())
    cv2.imwrite(str(tmp_path / "empty.png"), np.full((300, 400), 128, np.uint8))
    assert bench(pictures, tmp_path, "--board", BOARD, "--out", tmp_path / "c.yaml") == 0
    said = capsys.readouterr().out
    assert "Left out torn.png: cannot be read as an image" in said
    assert "Left out copy.png: the same picture as view_0.png" in said
    assert "Left out empty.png: no marker of 4X4_50" in said
    assert "RMS in 6 views" in said


def test_too_few_views_are_refused_with_reasons_and_nothing_is_written(tmp_path: Path, pictures: Path) -> None:
    wrong = BOARD.replace("]", ",legacy=true]")
    words = [pictures / f"view_{k}.png" for k in range(5)]
    with pytest.raises(InputError) as error:
        bench(*words, "--board", wrong, "--out", tmp_path / "c.yaml", "--picture", tmp_path / "p.png")
    assert str(error.value).startswith("calibration: found 0 usable views of the board, expected at least 4")
    assert "view_2.png and 2 more: only fits a board with legacy=false" in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_images_of_two_sizes_are_refused(tmp_path: Path, pictures: Path) -> None:
    cv2.imwrite(str(tmp_path / "large.png"), np.zeros((600, 800), np.uint8))
    expected = r"large.png: found 800x600 pixels, expected view_0.png's 400x300"
    with pytest.raises(InputError, match=expected):
        bench(pictures, tmp_path / "large.png", "--board", BOARD, "--out", tmp_path / "c.yaml")


def test_places_that_hold_no_views_are_refused(
    tmp_path: Path, pictures: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "text.txt").write_text("no video")
    (tmp_path / "bad.png").write_text("no picture")
    (tmp_path / "none").mkdir()
    for name, message in {
        "nowhere.png": "nowhere.png: is not there, expected an image, a folder of images or a video",
        "none": "none: has no images",
        "text.txt": "text.txt: cannot be opened as a video",
        "bad.png": "bad.png: cannot be read as an image",
    }.items():
        with pytest.raises(InputError, match=message):
            bench(tmp_path / name, "--board", BOARD, "--out", tmp_path / "c.yaml")
    assert capfd.readouterr().err == ""


def test_places_that_cannot_be_written_are_refused_before_any_work(tmp_path: Path, pictures: Path) -> None:
    with pytest.raises(InputError, match=r"--out .*c\.txt: found the ending '\.txt', expected one of \.yaml, \.yml"):
        bench(pictures, "--board", BOARD, "--out", tmp_path / "c.txt")
    with pytest.raises(InputError, match=r"--picture .*p\.gif: found the ending '\.gif'"):
        bench(pictures, "--board", BOARD, "--out", tmp_path / "c.yaml", "--picture", tmp_path / "p.gif")
    with pytest.raises(InputError, match=r"--camera-info .*: there is no folder .*/no, expected an existing one"):
        bench(pictures, "--board", BOARD, "--out", tmp_path / "c.yaml", "--camera-info", tmp_path / "no" / "i.yaml")
    assert list(tmp_path.iterdir()) == []


def test_the_real_views(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = os.environ.get("SLAMDUEL_DATA")
    if folder is None:
        pytest.skip("SLAMDUEL_DATA is not set")
    names = ("choriginal.jpg", "img_00.jpg", "img_01.jpg", "img_02.jpg", "img_03.jpg")
    board = "charuco[columns=5,rows=7,square=0.04,marker=0.02,dictionary=6X6_250]"
    assert bench(*(Path(folder) / "aruco" / name for name in names), "--board", board, "--out", tmp_path / "c.yml") == 0
    published = read(Path(folder) / "aruco" / "tutorial_camera_charuco.yml", np.eye(4))
    np.testing.assert_allclose(read(tmp_path / "c.yml", np.eye(4)).focal, published.focal, rtol=0.02)
    assert "Left out img_01.jpg: the same picture as choriginal.jpg" in capsys.readouterr().out

"""Printed markers: drawn at a known resolution, they are found by OpenCV where and as large as they should be."""

import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from command import run
from slamduel.bench.camera import paper
from slamduel.bench.camera.sheets import EDGE, FOOT, PAGES, STRIP, lay_out, sheets
from slamduel.bench.commands import markers as command_markers
from slamduel.core.errors import InputError
from slamduel.core.se2 import Array
from slamduel.frontend.boards.chessboard import Chessboard
from slamduel.frontend.boards.view import View
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.markers import Markers, find
from tiers import first_quick

DPI = 300
PIXEL = 25.4 / DPI


def picture(page: str, draw: paper.Draw) -> Image:
    """The page as a printer would put it on paper."""
    figure = paper.drawn(page, draw)
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(cv2.cvtColor(np.asarray(canvas.buffer_rgba()), cv2.COLOR_RGBA2GRAY), np.uint8)


def read(image: Image, dictionary: str) -> dict[int, Array]:
    """The markers on a page, id -> corners (4, 2) in mm from its lower left corner."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, ids, _ = cv2.aruco.ArucoDetector(find(dictionary), parameters).detectMarkers(image)
    corners = (np.reshape(found, (-1, 4, 2)) + 0.5) * PIXEL
    corners[..., 1] = image.shape[0] * PIXEL - corners[..., 1]
    return dict(zip(map(int, np.ravel(ids)), corners, strict=True))


@pytest.mark.parametrize(
    ("dictionary", "side", "names", "page", "pages"),
    [
        ("4X4_50", 0.15, [0, 49], "A4", 2),
        ("4X4_50", 0.04, range(14), "letter", 1),
        ("7X7_1000", 0.03, [1, 2, 3, 999], "A5", 1),
        ("custom[count=12,size=5,seed=0]", 0.02, range(12), "A4", 1),
    ],
)
def test_markers_are_detected_at_their_true_size(
    dictionary: str, side: float, names: Sequence[int], page: str, pages: int
) -> None:
    made = lay_out(sheets(Markers(dictionary, side), names), page)
    assert len(made) == pages
    seen: list[int] = []
    for placed in made:
        found = read(picture(page, paper.markers(placed, page)), dictionary)
        seen += found
        for sheet, x, y in placed:
            corners = found[sheet.name]
            sides = np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1)
            np.testing.assert_allclose(sides, 1000 * side, atol=0.1)
            top_left = np.array([x + sheet.rim, y + sheet.height - sheet.rim])
            np.testing.assert_allclose(corners[0], top_left, atol=0.1)
            assert corners[1] == pytest.approx([top_left[0] + 1000 * side, top_left[1]], abs=0.1)  # upright
    assert sorted(seen) == sorted(names)


def test_a_white_rim_of_a_module_around_every_marker() -> None:
    markers = Markers("4X4_50", 0.04, {3: 0.07})
    for placed in lay_out(sheets(markers, range(20)), "A4"):
        image = picture("A4", paper.markers(placed, "A4"))
        height = image.shape[0]
        for sheet, x, y in placed:
            assert sheet.rim == pytest.approx(sheet.side / 6)
            low, right = height - (y + STRIP) / PIXEL, (x + sheet.width) / PIXEL
            rim = image[int(low - sheet.width / PIXEL) + 5 : int(low) - 4, int(x / PIXEL) + 5 : int(right) - 4].copy()
            inner = int(sheet.rim / PIXEL) - 7
            rim[inner:-inner, inner:-inner] = 255
            assert rim.min() == 255


def test_sheets_stay_apart_and_on_their_page() -> None:
    markers = Markers("6X6_250", 0.03, {5: 0.1, 6: 0.06, 200: 0.1})
    for page, (width, height) in PAGES.items():
        names = [*range(40), 200]
        pages = lay_out(sheets(markers, names), page)
        assert sorted(placed.sheet.name for made in pages for placed in made) == names
        for made in pages:
            boxes = np.array([(x, y, x + sheet.width, y + sheet.height) for sheet, x, y in made])
            ink = np.array([(x + s.rim, y + 2, x + s.rim + s.side, y + s.height - s.rim) for s, x, y in made])
            assert (ink >= [EDGE, FOOT, EDGE, FOOT]).all()
            assert (ink <= [width - EDGE, height - EDGE] * 2).all()
            for index, one in enumerate(boxes):
                for other in boxes[:index]:
                    apart = np.maximum(one[:2] - other[2:], other[:2] - one[2:])
                    assert apart.max() >= -1e-6


def test_the_scale_bar_is_100_mm() -> None:
    image = picture("A4", paper.markers([], "A4"))[:, : int((2 * EDGE + paper.BAR + 2) / PIXEL)]
    rows, columns = np.nonzero(image < 128)
    bar = np.bincount(rows).argmax()
    ink = columns[rows == bar]
    assert len(ink) == np.ptp(ink) + 1
    assert len(ink) * PIXEL == pytest.approx(100, abs=0.1)


def test_the_pdf_has_the_pages_and_their_shapes(tmp_path: Path) -> None:
    """The path operators in the file itself, in points of 1/72 inch: no module is a shape of its own."""
    for page, size in (("A4", (595.276, 841.890)), ("letter", (612, 792))):
        placed = lay_out(sheets(Markers("4X4_50", 0.06), [0, 1]), page)
        paper.write_pdf(tmp_path / "m.pdf", page, [paper.markers(each, page) for each in [*placed, *placed]], "two")
        pdf = (tmp_path / "m.pdf").read_bytes()
        boxes = [tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox \[ ([^\]]*) \]", pdf)]
        assert len(boxes) == 2
        for box in boxes:
            assert box == pytest.approx((0, 0, *size), abs=1e-3)
        streams = [
            zlib.decompress(s)
            for s in re.findall(rb"FlateDecode.*?stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL)
            if s[:1] == b"x"
        ]
        drawn = next(text for text in streams if b" re\n" in text or b" l\n" in text)
        points = np.array([[float(p[0]), float(p[1])] for p in re.findall(rb"([\d.]+) ([\d.]+) [ml]\n", drawn)])
        sheet, x, y = placed[0][0]
        for corner in ((x + sheet.rim, y + STRIP + sheet.rim), (x + sheet.rim + 60, y + STRIP + sheet.rim + 60)):
            assert np.abs(points - np.array(corner) / 25.4 * 72).max(axis=1).min() < 1e-3
        assert drawn.count(b"\nf\n") == 1 + 3 + 2 + 1  # the page, the bar's three strokes, two markers, the strip
    first = (tmp_path / "m.pdf").read_bytes()
    paper.write_pdf(tmp_path / "m.pdf", "letter", [paper.markers(each, "letter") for each in [*placed, *placed]], "two")
    assert (tmp_path / "m.pdf").read_bytes() == first
    assert [file.name for file in tmp_path.iterdir()] == ["m.pdf"]


def test_outlines_are_the_cells() -> None:
    rng = np.random.default_rng(4)
    for _ in range(30):
        black = rng.random((6, 7)) < 0.6
        loops = paper.outlines(black)
        row, column = np.mgrid[:6, :7] + 0.5
        winding = np.zeros(black.shape)
        for loop in loops:  # crossings of a ray to the right, by their direction
            for (x0, y0), (x1, y1) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
                assert (x0 == x1) != (y0 == y1)
                crossed = (np.minimum(y0, y1) < row) & (row < np.maximum(y0, y1)) & (x0 > column)
                winding += np.where(crossed, np.sign(y1 - y0), 0)
        np.testing.assert_array_equal(winding != 0, black)


@pytest.mark.parametrize(
    ("size", "square", "marker", "page"), first_quick([((6, 5), 0.03, 0.021, "letter"), ((5, 7), 0.04, 0.02, "A4")])
)
def test_a_board_is_opencvs(size: tuple[int, int], square: float, marker: float, page: str) -> None:
    charuco = cv2.aruco.CharucoBoard(size, square, marker, find("6X6_250"))
    image = picture(page, paper.board(charuco, "a board", page))
    corners, ids, _, _ = cv2.aruco.CharucoDetector(charuco).detectBoard(image)
    assert np.ravel(ids).tolist() == list(range((size[0] - 1) * (size[1] - 1)))
    seen = np.reshape(corners, (-1, 2)) * PIXEL
    expected = 1000 * np.asarray(charuco.getChessboardCorners())[:, :2]
    np.testing.assert_allclose(seen - seen[0], expected - expected[0], atol=0.1)
    # Pixel for pixel what OpenCV draws, but for the edges.
    columns, rows = (round(1000 * square * n / PIXEL) for n in size)
    drawn = charuco.generateImage((columns, rows))
    left, top = np.round((seen[0] - expected[0]) / PIXEL).astype(int)
    inside = image[top : top + rows, left : left + columns]
    assert (np.abs(inside.astype(int) - drawn) > 100).mean() < 0.02


def test_a_chessboard_is_found_at_its_true_size() -> None:
    image = picture("A4", paper.chessboard((7, 5), 0.02, "a board", "A4"))
    found = Chessboard(7, 5, 0.02).find("page", image)
    assert isinstance(found, View)
    seen = found.corners.reshape(5, 7, 2) * PIXEL
    np.testing.assert_allclose(np.abs(np.diff(seen, axis=1))[..., 0], 20, atol=0.1)
    np.testing.assert_allclose(np.abs(np.diff(seen, axis=0))[..., 1], 20, atol=0.1)
    assert isinstance(Chessboard(8, 6, 0.02).find("page", image), str)
    with pytest.raises(InputError, match="the board is 450 x 350 mm and does not fit on A4; --page A1"):
        paper.chessboard((8, 6), 0.05, "", "A4")


def test_what_is_too_large_is_refused() -> None:
    with pytest.raises(InputError, match=r"marker 2 with its white rim is 213 x 218 mm .* A4; --page letter"):
        lay_out(sheets(Markers("4X4_50", 0.1, {2: 0.16}), range(4)), "A4")
    with pytest.raises(InputError, match=r"on A4 a side of 0\.157 m does"):
        lay_out(sheets(Markers("4X4_50", 0.16), [0]), "A4")
    assert len(lay_out(sheets(Markers("4X4_50", 0.157), [0]), "A4")) == 1
    with pytest.raises(InputError, match="does not fit on A0, nor any other"):
        lay_out(sheets(Markers("4X4_50", 2.0), [0]), "A0")
    large = cv2.aruco.CharucoBoard((5, 7), 0.05, 0.03, find("4X4_50"))
    with pytest.raises(InputError, match="the board is 250 x 350 mm and does not fit on A4; --page A3"):
        paper.board(large, "", "A4")
    with pytest.raises(InputError, match="marker 50: there is none in 4X4_50, expected ids from 0 to 49"):
        sheets(Markers("4X4_50", 0.1), [50])


def test_the_command_writes_a_pdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, words = tmp_path / "m.pdf", tmp_path / "mine.yml"
    name = "custom[base=4X4_50,count=60]"
    given = ["--dictionary", name, "--side", "0.05", "--side", "7=0.08", "--ids", "0-11,7,59", "--out", out]
    assert run(command_markers, *given, "--write-dictionary", words) == 0
    assert out.read_bytes().startswith(b"%PDF")
    said = capsys.readouterr().out
    assert f"{out}: 13 markers on 2 pages of A4" in said
    assert f'dictionary = "{name}"\nside = 0.05\nsides = {{7 = 0.08}}' in said
    np.testing.assert_array_equal(find(str(words)).bytesList, find(name).bytesList)


def test_the_command_writes_a_board(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "board.pdf"
    named = "charuco[columns=5,rows=7,square=0.04,marker=0.02,dictionary=6X6_250]"
    assert run(command_markers, "--board", named, "--page", "A4", "--out", out) == 0
    assert out.read_bytes().startswith(b"%PDF")
    assert capsys.readouterr().out == f"{out}: {named} on A4\n"
    with pytest.raises(InputError, match="the board is 200 x 280 mm and does not fit on letter; --page A4"):
        run(command_markers, "--board", named, "--page", "letter", "--out", str(tmp_path / "other.pdf"))
    assert [file.name for file in tmp_path.iterdir()] == ["board.pdf"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--ids", "0-"], "--ids 0-: found '0-', expected ids such as 0-11,20"),
        (["--ids", "5-3"], "--ids 5-3: found '5-3'"),
        (["--ids", ""], "--ids : found ''"),
        (["--ids", "0-99999999999"], "found 99999999999, expected ids of the dictionary, 0 to 49"),
        (["--side", "wide"], "--side wide: expected metres"),
        (["--side", "a=0.1"], "--side a=0.1: expected metres"),
        (["--side", "150"], r"--side: side: found 150, .*0\.15 if this is in millimetres"),
        (["--side", "nan"], "found nan"),
        (["--side", "30=0.1"], "marker 30 is not among --ids 0-11"),
        (["--side", "50=0.1"], "found id 50"),
        (["--dictionary", "4X4"], "there is no '4X4'"),
        (["--write-dictionary", "mine.txt"], r"mine\.txt: found the ending '\.txt'"),
        (["--side", "0.16"], r"does not fit on A4; .* 0\.157 m does"),
        (["--out", "nowhere/m.pdf"], "nowhere/m.pdf: there is no folder nowhere"),
    ],
)
def test_options_that_cannot_be_used(
    words: list[str], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=sentence):
        run(command_markers, *words)
    assert list(tmp_path.iterdir()) == []

"""The strip that shows how far ink spreads: drawn finely and grown like ink, it is read as its labels say."""

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from slamduel.bench.camera import paper
from slamduel.bench.camera.ink_strip import COARSE, FINE, LINES, STEP, ink_strip
from slamduel.bench.camera.sheets import EDGE, FOOT, PAGES
from slamduel.frontend.markers.aruco import Image

PIXEL = 0.005
"""mm, of the drawings."""


def drawn(spread: float, room: float = 90.0) -> Image:
    """The strip's black, as a printer draws it whose ink spreads so far, mm; rows go up."""
    strip = ink_strip(room, 150.0)
    black = np.zeros((round(7 / PIXEL), round(room / PIXEL)), np.uint8)
    for x, y, width, height in strip.boxes:
        left, low, right, top = (round(end / PIXEL) for end in (x, y, x + width, y + height))
        black[low:top, left:right] = 1
    reach = round(abs(spread) / PIXEL)
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    return np.asarray((cv2.dilate if spread > 0 else cv2.erode)(black, kernel), np.uint8)


@pytest.mark.parametrize("spread", [-0.05, 0.0, 0.05, 0.125, 0.2])
def test_edges_are_in_line_at_the_spread(spread: float) -> None:
    """And the further from it the more they are out of line: by twice the difference."""
    black = drawn(spread)
    strip = ink_strip(90.0, 150.0)
    upper, lower = (round(y / PIXEL) for y in (strip.boxes[0].y + 1.2, strip.boxes[1].y + 0.4))
    for k, step in enumerate(FINE):
        cells = np.s_[round(STEP * k / PIXEL) : round(STEP * (k + 1) / PIXEL)]
        right = np.flatnonzero(black[upper, cells]).max() + 1
        left = np.flatnonzero(black[lower, cells]).min()
        assert PIXEL * (left - right) == pytest.approx(2 * (step - spread), abs=PIXEL / 2)


def test_lines_are_as_wide_as_their_gaps_until_ink_closes_them() -> None:
    row = round(ink_strip(90.0, 150.0).boxes[-1].y / PIXEL) + 100
    right_of_steps = round(STEP * len(FINE) / PIXEL)
    for spread in (0.0, 0.04, 0.06, 0.11):
        line = np.diff(drawn(spread)[row, right_of_steps:].astype(int))
        starts, ends = np.flatnonzero(line == 1), np.flatnonzero(line == -1)
        gaps = PIXEL * (starts[1:] - ends[:-1])
        open_gaps = [width for width in LINES if width > 2 * spread]
        inner = gaps[gaps < 1.0]
        np.testing.assert_allclose(inner, np.repeat(open_gaps, 2) - 2 * spread, atol=PIXEL)


@pytest.mark.parametrize("page", PAGES)
def test_the_strip_fits_beside_the_scale_bar(page: str) -> None:
    room = PAGES[page][0] - 3 * EDGE - paper.BAR - paper.APART
    strip = ink_strip(room, 50.0)
    for x, y, width, height in strip.boxes:
        assert 0 <= x < x + width <= room
        assert 0 <= y < y + height <= FOOT - EDGE
    words = [label.words for label in strip.labels]
    spreads = COARSE if page == "A5" else FINE
    assert words[: len(spreads)] == [f"{step:g}" for step in spreads]
    assert page == "A5" or "0.1 is 0.2 % of 50 mm" in words[len(spreads)]


@pytest.mark.parametrize("page", ["A5", "A4"])
def test_its_words_stay_apart(page: str) -> None:
    figure = paper.drawn(page, paper.markers([], page))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in figure.texts]
    for index, one in enumerate(boxes):
        assert one.x1 <= figure.bbox.x1 - EDGE / 25.4 * figure.dpi + 1
        for other in boxes[:index]:
            assert not one.overlaps(other)

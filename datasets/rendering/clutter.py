"""Frames without a marker of the dictionary in question, full of similar patterns."""

from collections.abc import Callable, Iterator
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Image
from ...frontend.markers.markers import find
from .lens import Singles

DICTIONARY = "4X4_50"  # the dictionary in question
BLUR = 0.6  # px, standard deviation
GRAIN = 2.0  # grey levels, standard deviation

STRANGERS = ("6X6_250", "5X5_100", "7X7_100", "APRILTAG_16H5", "APRILTAG_36H11", "ARUCO_ORIGINAL")
"""Dictionaries of the distracting markers, except those shared with DICTIONARY."""

THINGS = (6, 16)  # range of their number in a frame
CELL = 12  # px per cell of a texture, before perspective

WORDS = ("EXIT", "H8", "Room 4.07", "#####", "OO", "M", "[#]", "%&@", "E3", "NO ENTRY", "0123", "B")

Bits = NDArray[np.bool_]  # (n, n) cells, True is white


def clutter(camera: Camera, count: int, rng: np.random.Generator) -> Iterator[Image]:
    """Yields `count` frames of squares, checkerboards, rectangles, writing, noise and other dictionaries' markers.

    All have random sizes and angles. None is a marker of DICTIONARY: random ones that are get redrawn.
    """
    things = (_cells, _bordered, _bordered, _checkers, _stranger, _stranger, _writing, _rectangles, _speckles)
    for _ in range(count):
        image = _ground(camera, rng)
        for _ in range(rng.integers(*THINGS)):
            thing: Callable[[np.random.Generator], Singles] = things[rng.integers(len(things))]
            _stick(image, thing(rng), rng)
        seen = cv2.GaussianBlur(image, (0, 0), BLUR)
        yield np.clip(np.round(seen + GRAIN * rng.standard_normal(seen.shape, np.float32)), 0, 255).astype(np.uint8)


def is_marker(bits: Bits) -> bool:
    """Tells if these cells are a marker of DICTIONARY, its black border included, in any of four orientations."""
    if len(bits) != find(DICTIONARY).markerSize + 2 or bits[[0, -1]].any() or bits[:, [0, -1]].any():
        return False
    return any(np.rot90(bits, turns).tobytes() in _known() for turns in range(4))


@cache
def _known() -> frozenset[bytes]:
    return frozenset(drawn(DICTIONARY, name).tobytes() for name in range(len(find(DICTIONARY).bytesList)))


def drawn(dictionary: str, name: int) -> Bits:
    """(n, n) a marker's cells, border included."""
    words = find(dictionary)
    return np.asarray(words.generateImageMarker(name, words.markerSize + 2, borderBits=1)) > 0


def _cells(rng: np.random.Generator) -> Singles:
    """Random cells, up to the edge."""
    while is_marker(bits := rng.random((rng.integers(4, 9),) * 2) < rng.uniform(0.2, 0.8)):
        pass
    return _on_paper(bits, rng)


def _bordered(rng: np.random.Generator) -> Singles:
    """Random cells in a black border, most in the markers' size: false positives by chance."""
    inner = find(DICTIONARY).markerSize if rng.random() < 0.7 else int(rng.integers(2, 8))
    while is_marker(bits := np.pad(rng.random((inner, inner)) < rng.uniform(0.2, 0.8), 1)):
        pass
    return _on_paper(bits, rng)


def _checkers(rng: np.random.Generator) -> Singles:
    rows, columns = rng.integers(3, 10, 2)
    bits = np.indices((rows, columns)).sum(axis=0) % 2 == rng.integers(2)
    return _on_paper(bits, rng) if not is_marker(bits) else _checkers(rng)


def _stranger(rng: np.random.Generator) -> Singles:
    """A marker of another dictionary."""
    other = STRANGERS[rng.integers(len(STRANGERS))]
    while is_marker(bits := drawn(other, int(rng.integers(len(find(other).bytesList))))):
        pass
    return _on_paper(bits, rng)


def _writing(rng: np.random.Generator) -> Singles:
    text, scale = WORDS[rng.integers(len(WORDS))], rng.uniform(0.6, 3.0)
    thickness, face = int(rng.integers(1, 6)), int(rng.integers(0, 8))
    (width, height), below = cv2.getTextSize(text, face, scale, thickness)
    paper = np.full((height + below + 20, width + 20), 220, np.uint8)
    cv2.putText(paper, text, (10, height + 8), face, scale, 30.0, thickness, cv2.LINE_AA)
    return paper.astype(np.float32)


def _rectangles(rng: np.random.Generator) -> Singles:
    """Nested rectangles, as windows and frames are."""
    paper = np.full((96, 96), rng.uniform(150, 230), np.float32)
    edges = np.sort(rng.integers(4, 48, rng.integers(1, 5)))
    for k, edge in enumerate(edges):
        paper[edge : 96 - edge, edge : 96 - edge] = rng.uniform(10, 80) if k % 2 == 0 else rng.uniform(150, 230)
    return paper


def _speckles(rng: np.random.Generator) -> Singles:
    """Smoothed noise, thresholded to black and white."""
    noise = cv2.GaussianBlur(rng.standard_normal((96, 96), np.float32), (0, 0), rng.uniform(1, 12))
    return np.where(noise > np.median(noise), np.float32(215), np.float32(35))


def _on_paper(bits: Bits, rng: np.random.Generator) -> Singles:
    """A texture of the cells in ink, on a sheet with a white rim."""
    ink, paper = rng.uniform(10, 90), rng.uniform(130, 245)
    cells = np.pad(bits, 1, constant_values=True).repeat(CELL, axis=0).repeat(CELL, axis=1)
    return np.where(cells, np.float32(paper), np.float32(ink))


def _ground(camera: Camera, rng: np.random.Generator) -> Singles:
    """(height, width) clouds of grey."""
    coarse = rng.uniform(40, 210, (int(rng.integers(2, 8)), int(rng.integers(2, 10)))).astype(np.float32)
    grown = cv2.resize(coarse, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(grown, 0, 255), np.float32)


def _stick(image: Singles, texture: Singles, rng: np.random.Generator) -> None:
    """Pastes the texture into `image` at random, as a plane seen at some angle."""
    (rows, columns), (height, width) = texture.shape, image.shape
    size = np.exp(rng.uniform(np.log(0.05), np.log(0.7))) * height
    outline = size / max(rows, columns) * np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], float)
    outline -= outline.mean(axis=0)
    angle = rng.uniform(-np.pi, np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    squeeze = np.diag([1.0, rng.uniform(0.6, 1.0)])
    outline = outline @ turn @ squeeze + rng.uniform(0, [width, height]) + rng.uniform(-0.06, 0.06, (4, 2)) * size
    source = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32) - np.float32(0.5)
    to_image = cv2.getPerspectiveTransform(source, outline.astype(np.float32))
    # smooth before shrinking, to avoid aliasing
    shrunk = max(rows, columns) / size
    smooth = cv2.GaussianBlur(texture, (0, 0), 0.4 * shrunk) if shrunk > 1 else texture
    seen = cv2.warpPerspective(smooth, to_image, (width, height), flags=cv2.INTER_LINEAR)
    share = cv2.warpPerspective(np.ones_like(texture), to_image, (width, height), flags=cv2.INTER_LINEAR)
    image += seen - share * image

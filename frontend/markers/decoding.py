"""Finds the dictionary that reads the squares in some frames: all known ones, also mirrored and inverted.

A detector needs its dictionary in advance. Here each square outline is sampled once per number of bits, and only clean
samples count: a border of one colour, and hardly a cell that is half black and half white. Clutter, or a marker with
another number of bits, hardly ever passes; the rate of chance readings is estimated.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import product
from math import factorial
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .aruco import Image
from .bits import sample
from .markers import find

FAMILIES = {
    "4X4_1000": ("4X4_50", "4X4_100", "4X4_250"),
    "5X5_1000": ("5X5_50", "5X5_100", "5X5_250"),
    "6X6_1000": ("6X6_50", "6X6_100", "6X6_250"),
    "7X7_1000": ("7X7_50", "7X7_100", "7X7_250"),
    "ARUCO_ORIGINAL": (),
    "ARUCO_MIP_36H12": (),
    "APRILTAG_16H5": (),
    "APRILTAG_25H9": (),
    "APRILTAG_36H11": (),
    "APRILTAG_36H10": (),
}
"""Dictionaries of which none contains another, and their smaller prefixes."""

BY_CHANCE = 0.004  # readings are rejected if at least this likely by chance

READ = 0.5
"""Least share of the clean squares with its number of bits that an accepted dictionary reads."""


class Reading(NamedTuple):
    """The markers that one dictionary reads in the frames."""

    dictionary: str  # the smallest with all `ids`
    mirrored: bool  # as if seen in a mirror
    inverted: bool  # black and white exchanged
    ids: list[int]  # distinct ids read
    frames: int  # with at least one of them
    sightings: int


class Decoded(NamedTuple):
    """The result over all frames."""

    readings: list[Reading]  # significant ones, most sightings first
    framed: int  # number of frames with a marker-like black square


def decode(images: Sequence[Image], own: str, words: cv2.aruco.Dictionary) -> Decoded:
    """Reads the markers in `images` with every known dictionary, and with `words`, the dictionary named `own`."""
    tables = {name: _table(name) for name in FAMILIES}
    if own not in {name for family, smaller in FAMILIES.items() for name in (family, *smaller)}:
        tables[own] = _words(words)
    sizes = sorted({size for size, _ in tables.values()})
    found: dict[tuple[str, bool, bool], list[tuple[int, int]]] = defaultdict(list)  # frame, id
    crowds: dict[tuple[int, bool], list[int]] = defaultdict(list)  # size, negative or not -> squares in each frame
    framed = 0
    finder = cv2.aruco.ArucoDetector(words)
    for frame, image in enumerate(images):
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8) if image.ndim == 3 else image
        for inverted in (False, True):
            patterns = list(_patterns(255 - grey if inverted else grey, finder, sizes))
            framed += bool(patterns) and not inverted
            for size, there in Counter(len(bits) for bits in patterns).items():
                crowds[size, inverted].append(there)
            for bits, (name, (size, table)), mirrored in product(patterns, tables.items(), (False, True)):
                index = _look_up(table, bits, mirrored) if size == len(bits) else None
                if index is not None:
                    found[name, mirrored, inverted].append((frame, index))
    readings: list[Reading] = []
    for (name, mirrored, inverted), pairs in found.items():
        size, table = tables[name]
        ids = sorted({index for _, index in pairs})
        smallest, count = _smallest(name, len(table), ids)
        if _believed(len(ids), len(pairs), crowds[size, inverted], 4 * count / 2 ** (size * size)):
            frames = len({frame for frame, _ in pairs})
            readings.append(Reading(smallest, mirrored, inverted, ids, frames, len(pairs)))
    return Decoded(sorted(readings, key=lambda reading: -reading.sightings), framed)


def _believed(ids: int, sightings: int, crowd: Sequence[int], rate: float) -> bool:
    """Tests a dictionary's readings against chance, which reads each of `crowd` squares per frame at `rate`.

    The same square in several frames is one piece of evidence, so only distinct ids count, with a Poisson tail
    probability.
    """
    chance = (max(crowd) * min(1.0, rate)) ** ids / factorial(ids)
    return chance < (BY_CHANCE if sightings > 1 else BY_CHANCE**2) and sightings >= READ * sum(crowd)


@cache
def _table(name: str) -> tuple[int, dict[bytes, int]]:
    return _words(find(name))


def _words(dictionary: cv2.aruco.Dictionary) -> tuple[int, dict[bytes, int]]:
    """The bits along a side, and each marker's bits -> its id."""
    size, count = dictionary.markerSize, len(dictionary.bytesList)
    turned = np.asarray(dictionary.bytesList).reshape(count, -1)[:, : -(-size * size // 8)]  # upright; not rotated
    table: dict[bytes, int] = {}
    for index, packed in enumerate(turned):
        bits = np.unpackbits(packed)
        whole = size * size // 8 * 8
        tail = bits[whole:][-(size * size - whole) :] if whole < size * size else bits[:0]
        table.setdefault(np.concatenate((bits[:whole], tail)).astype(bool).tobytes(), index)
    return size, table


def _look_up(table: dict[bytes, int], bits: NDArray[np.bool_], mirrored: bool) -> int | None:
    seen = bits[:, ::-1] if mirrored else bits
    return next((table[key] for turns in range(4) if (key := np.rot90(seen, turns).tobytes()) in table), None)


def _smallest(name: str, count: int, ids: Sequence[int]) -> tuple[str, int]:
    """The smallest dictionary of a family with all of `ids`, and its number of markers."""
    sizes = [(small, int(small.rpartition("_")[2])) for small in FAMILIES.get(name, ())]
    return next(((small, size) for small, size in sizes if max(ids) < size), (name, count))


def _patterns(grey: Image, finder: cv2.aruco.ArucoDetector, sizes: Sequence[int]) -> Iterator[NDArray[np.bool_]]:
    """Yields the bits (n, n) of every clean black square in `grey`, for each of the `sizes` n."""
    decoded, _, others = finder.detectMarkers(grey)
    for quad in np.array([*decoded, *others], float).reshape(-1, 4, 2):
        for size in sizes:
            bits = sample(grey, quad, size)
            if bits is not None:
                yield bits

"""The pixels of a frame that a printed pattern covers, compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._grey import BLACK, PARAMETERS, SHARED, WHITE, Model, Scratch, covariance, curve_of, eye_of, predict, slopes
from ._share import RIM

MARGIN = 0.5
"""Modules of paper outside the black border that are used; beyond, anything may be in the image."""

COUNTED = 200
"""About how many pixels of a box estimate how many of it are near edges."""

REACH = 3.0
"""Standard deviations of the blur within which a pixel is near an edge."""


@compiled
def box_of(corners: Array, shape: tuple[int, int], reach: float) -> tuple[int, int, int, int]:
    """The range of rows and columns that the corners (4, 2) span, with `reach` px more."""
    height, width = shape
    left, top, right, bottom = corners[0, 0], corners[0, 1], corners[0, 0], corners[0, 1]
    for k in range(1, 4):
        left, right = min(left, corners[k, 0]), max(right, corners[k, 0])
        top, bottom = min(top, corners[k, 1]), max(bottom, corners[k, 1])
    return (
        max(math.floor(top - reach), 0),
        min(math.ceil(bottom + reach) + 1, height),
        max(math.floor(left - reach), 0),
        min(math.ceil(right + reach) + 1, width),
    )


@compiled
def extremes(image: NDArray[np.uint8], box: tuple[int, int, int, int]) -> tuple[float, float]:
    """The darkest and the brightest grey level in a box."""
    darkest, brightest = 255, 0
    for y in range(box[0], box[1]):
        for x in range(box[2], box[3]):
            darkest = min(darkest, image[y, x])
            brightest = max(brightest, image[y, x])
    return float(darkest), float(brightest)


@compiled
def scattered(x: int, y: int) -> float:
    """A number from 0 to 1, 1 excluded, that looks random, for a place: it is multiplied and mixed."""
    mixed = ((x * 0x9E3779B1) ^ (y * 0x85EBCA77)) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 15)) * 0x2C1B3C6D) & 0xFFFFFFFF
    return (mixed ^ (mixed >> 13)) / 4294967296.0


@compiled
def gather(
    image: NDArray[np.uint8],
    rays: Array,
    G: Array,
    look: Array,
    m: int,
    box: tuple[int, int, int, int],
    most: int,
    places: Array,
) -> int:
    """Fills `places` (n, 8) with pixels near pattern edges: grey, ray, d ray / dx, d ray / dy, kind; returns how many.

    Of more than `most`, a sample is taken: each row is divided evenly, and of each part a random pixel is looked at.
    Along an edge nothing of it then repeats with the pixels' colours, as an even sequence does where edges run in
    certain directions: demosaicing moved such markers by four standard deviations.
    """
    height, width = image.shape
    s00, s01, s11 = covariance(look)
    share = 1.0
    count = 0
    lattice = max(math.floor(math.sqrt((box[1] - box[0]) * (box[3] - box[2]) / COUNTED)), 1)
    for counting in (True, False):
        seen = 0
        step = lattice if counting else 1
        for y in range(box[0], box[1], step):
            last = -1
            for part in range(math.ceil((box[3] - box[2]) * share / step)):
                x = box[2] + (part * step if counting else math.floor((part + scattered(part, y)) / share))
                if x >= box[3] or x == last:
                    continue
                last = x
                rx = rays[y, x, 0]
                ry = rays[y, x, 1]
                w = 1.0 / (G[2, 0] * rx + G[2, 1] * ry + G[2, 2])
                u = (G[0, 0] * rx + G[0, 1] * ry + G[0, 2]) * w
                v = (G[1, 0] * rx + G[1, 1] * ry + G[1, 2]) * w
                # negated so that a pixel without a ray, NaN, is outside
                if not (w > 0 and u > -MARGIN and u < m + MARGIN and v > -MARGIN and v < m + MARGIN):
                    continue
                left, right = max(x - 1, 0), min(x + 1, width - 1)
                above, below = max(y - 1, 0), min(y + 1, height - 1)
                rxx = (rays[y, right, 0] - rays[y, left, 0]) / (right - left)
                ryx = (rays[y, right, 1] - rays[y, left, 1]) / (right - left)
                rxy = (rays[below, x, 0] - rays[above, x, 0]) / (below - above)
                ryy = (rays[below, x, 1] - rays[above, x, 1]) / (below - above)
                ux, uy, vx, vy = slopes(G, u, v, w, rxx, ryx, rxy, ryy)
                near_u = REACH * math.sqrt(s00 * ux * ux + 2.0 * s01 * ux * uy + s11 * uy * uy)
                near_v = REACH * math.sqrt(s00 * vx * vx + 2.0 * s01 * vx * vy + s11 * vy * vy)
                edge_u = abs(u - min(max(math.floor(u + 0.5), 0), m))
                edge_v = abs(v - min(max(math.floor(v + 0.5), 0), m))
                if not (edge_u < near_u or edge_v < near_v):
                    continue
                seen += 1
                if not counting and count < len(places):
                    place = places[count]
                    place[0] = image[y, x]
                    place[1] = rx
                    place[2] = ry
                    place[3] = rxx
                    place[4] = ryx
                    place[5] = rxy
                    place[6] = ryy
                    place[7] = x % 2 + 2 * (y % 2)
                    count += 1
        if lattice * lattice * seen > most:
            share = most / (lattice * lattice * seen)
    return count


@compiled
def worst_module(image: NDArray[np.uint8], rays: Array, pattern: Array, G: Array, look: Array, corners: Array) -> float:
    """The distance of the worst module's middle, border included, from its predicted grey: a share of the contrast.

    The mean over the middle averages noise out and excludes edge effects: only a different print remains. In small or
    narrow modules the blur reaches the middle; the prediction has it.
    """
    height, width = image.shape
    m = pattern.shape[0] - 2 * RIM
    box = box_of(corners, image.shape, 2.0)
    stride = max(1, min(box[1] - box[0], box[3] - box[2]) // (8 * m))
    total, count = np.zeros((m, m)), np.zeros((m, m))
    model = Model(pattern, G, look, eye_of(G, m, np.zeros(3)))
    scratch, curve = Scratch(np.empty((2, 3, 7)), np.empty((2, 7)), np.empty(12), np.empty(2)), np.empty(SHARED)
    curve_of(model, curve)
    place, unused = np.zeros(8), np.empty(PARAMETERS)
    for y in range(max(box[0], 1), min(box[1], height - 1), stride):
        for x in range(max(box[2], 1), min(box[3], width - 1), stride):
            rx, ry = rays[y, x]
            w = 1.0 / (G[2, 0] * rx + G[2, 1] * ry + G[2, 2])
            u = (G[0, 0] * rx + G[0, 1] * ry + G[0, 2]) * w
            v = (G[1, 0] * rx + G[1, 1] * ry + G[1, 2]) * w
            if not (w > 0 and u > 0 and u < m and v > 0 and v < m):
                continue
            column, row = int(u), int(v)
            if abs(u - column - 0.5) > 0.25 or abs(v - row - 0.5) > 0.25:
                continue
            place[1], place[2] = rx, ry
            for k in range(2):
                place[3 + k] = 0.5 * (rays[y, x + 1, k] - rays[y, x - 1, k])
                place[5 + k] = 0.5 * (rays[y + 1, x, k] - rays[y - 1, x, k])
            grey = predict(place, model, curve, True, scratch, unused)
            if math.isnan(grey):
                continue
            total[row, column] += (image[y, x] - grey) / (look[WHITE] - look[BLACK])
            count[row, column] += 1
    worst = 0.0
    for row in range(m):
        for column in range(m):
            if count[row, column] > 0:
                worst = max(worst, abs(total[row, column] / count[row, column]))
    return worst

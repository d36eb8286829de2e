"""The noise of a camera by grey level, from flat areas of a board: a photon transfer curve of grey levels."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from ...core.se2 import Array
from ..camera.camera import Camera
from ..camera.response import BRIGHTEST, Measured
from ..markers.aruco import Image
from .board import Board

BLOCK = 3  # px, side of the blocks in which the noise is measured
CLEAR = 3.5  # px from a block to the nearest edge of the print: blur and sharpening reach so far
FEWEST = 20  # blocks of a picture that are enough
LEAST_RANGE = 30.0  # grey levels between dark and bright blocks, without which no slope is known
FINE = 50  # samples of a square's side in the drawing that tells where edges are

LARGEST = 4.0
"""Times the expected variance above which a block's counts as this: it has dirt, or the paper's texture."""


class Flat(NamedTuple):
    """The flat blocks of a picture."""

    grey: Array  # (n,) means
    variance: Array  # (n,) squared grey levels about a plane


def flat_areas(board: Board, camera: Camera, pose: Array, grey: Image) -> Flat:
    """The blocks of an image that see nothing but black, or nothing but white, of a board at `pose` (4, 4).

    Blocks with pixels that are saturated or black altogether are left out, as their noise is cut off.
    """
    rows, columns = grey.shape[0] // BLOCK, grey.shape[1] // BLOCK
    v, u = np.meshgrid(
        BLOCK * np.arange(rows) + (BLOCK - 1) / 2, BLOCK * np.arange(columns) + (BLOCK - 1) / 2, indexing="ij"
    )
    clear = _clearance(board, camera, pose, np.stack((u.ravel(), v.ravel()), axis=-1)).reshape(u.shape)
    blocks = grey[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK).swapaxes(1, 2)
    blocks = blocks[clear > CLEAR + (BLOCK - 1) / np.sqrt(2)].reshape(-1, BLOCK * BLOCK).astype(float)
    blocks = blocks[(blocks.min(axis=1) > 0) & (blocks.max(axis=1) < BRIGHTEST)]
    rest = blocks - blocks @ _PLANE @ _PLANE.T
    return Flat(blocks.mean(axis=1), (rest**2).sum(axis=1) / (BLOCK * BLOCK - _PLANE.shape[1]))


def noise_curve(pictures: Sequence[Flat]) -> tuple[Measured, Measured] | None:
    """The variance at grey level 0 and its growth per grey level; None without enough dark and bright areas.

    By weighted least squares, as a variance of n pixels has the standard deviation sqrt(2 / n) of itself. Standard
    errors by leaving out one picture at a time (jackknife).
    """
    used = [one for one in pictures if len(one.grey) >= FEWEST]
    if len(used) < 3 or np.ptp(np.percentile(np.concatenate([one.grey for one in used]), (1, 99))) < LEAST_RANGE:
        return None
    whole = _line(used)
    without = np.array([_line([*used[:k], *used[k + 1 :]]) for k in range(len(used))])
    error = np.sqrt((len(used) - 1) * without.var(axis=0))
    return Measured(float(whole[0]), float(error[0])), Measured(float(whole[1]), float(error[1]))


def _line(pictures: Sequence[Flat]) -> Array:
    """(2,) intercept and slope; the line is nowhere below 0 from black to white."""
    grey = np.concatenate([one.grey for one in pictures])
    seen = np.concatenate([one.variance for one in pictures])
    design = np.column_stack((1 - grey / BRIGHTEST, grey / BRIGHTEST))
    ends = np.full(2, np.median(seen))
    for _ in range(20):
        expected = np.maximum(design @ ends, 1e-3)
        weights = 1 / expected**2
        told = np.minimum(seen, LARGEST * expected)
        ends = np.maximum(np.linalg.solve((design * weights[:, None]).T @ design, design.T @ (weights * told)), 0.0)
    return np.array([ends[0], (ends[1] - ends[0]) / BRIGHTEST])


def _clearance(board: Board, camera: Camera, pose: Array, pixels: Array) -> Array:
    """(n,) px from each of the `pixels` (n, 2) to the nearest edge of print; 0 beside the board, or without a ray."""
    rays = np.column_stack((camera.undistort(pixels), np.ones(len(pixels))))
    x, y, w = np.linalg.solve(pose[:3, [0, 1, 3]], rays.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.stack((x / w, y / w), axis=-1)
    at = np.where((np.isfinite(at) & (w > 0)[:, None]), at, -1.0)
    drawn = board.opencv.generateImage((board.columns * FINE, board.rows * FINE))
    edges = cv2.morphologyEx(np.asarray(drawn), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    edges[[0, -1]] = edges[:, [0, -1]] = 255
    far = cv2.distanceTransform((edges == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    column, row = np.clip(at * FINE / board.square, -1, [far.shape[1], far.shape[0]]).astype(int).T + 1
    samples = np.pad(far, 1)[row, column]
    # from samples of the drawing to px: what is farther, or tilted, is smaller
    depth = at @ pose[2, :2] + pose[2, 3]
    sight = np.append(rays[:, :2], np.ones((len(rays), 1)), axis=1)
    lean = np.abs(sight @ pose[:3, 2]) / np.linalg.norm(sight, axis=1)
    return samples * (board.square / FINE) * min(camera.focal) / np.maximum(depth, 1e-9) * lean


_PLANE = np.linalg.qr(
    np.column_stack(
        (
            np.ones(BLOCK * BLOCK),
            np.repeat(np.arange(BLOCK), BLOCK) - (BLOCK - 1) / 2,
            np.tile(np.arange(BLOCK), BLOCK) - (BLOCK - 1) / 2,
        )
    )
)[0]
"""(9, 3) an orthonormal base of the planes over a block."""

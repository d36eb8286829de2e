"""Rays of a camera's pixels, and the part of a plane that each of them covers."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...frontend.camera.camera import Camera

Singles = NDArray[np.float32]
Part = tuple[slice, slice]  # rows and columns of an image
NEAR = 1e-6  # m; least distance in front of the lens at which an outline is clipped

COLOURS = np.array([0.299, 0.587, 0.114], np.float32)
"""Shares of red, green and blue in grey: the luma of JPEG (ITU-R BT.601)."""

CAMERAS_KEPT = 256  # as many lenses as the bands of a frame have for three colours
BLOCK = 8  # px, side of the blocks in which rays are looked up

NOWHERE = np.float32(-1e6)
"""px, a plane position outside of every texture: for rays that meet the plane behind the camera."""


class Patch(NamedTuple):
    """A part of an image that shows a plane, with the plane's texture coordinates."""

    part: Part
    at: Singles  # (2, h, w) column and row, in the texture's pixels, at the pixels' centres
    by_u: Singles  # (2, h, w) their change per pixel to the right
    by_v: Singles  # (2, h, w) and downwards


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera's pixels as rays, computed once."""

    camera: Camera

    @cached_property
    def rays(self) -> Singles:
        """(3, height, width) the direction of each pixel's ray in the camera frame, with z = 1.

        Pixels without a ray get the axis; see `open`.
        """
        axis = np.array([0, 0, 1], np.float32)[:, None, None]
        return np.where(self.open, self._flat, axis)

    @cached_property
    def open(self) -> NDArray[np.bool_]:
        """(height, width) mask of pixels with a ray."""
        return np.asarray(np.isfinite(self._flat).all(axis=0))

    @cached_property
    def cosine(self) -> Singles:
        """(height, width) of the angle between the axis and a pixel's ray."""
        return 1 / np.sqrt((self.rays**2).sum(axis=0))

    def transmission(self, vignetting: float) -> Singles:
        """(height, width) the share of the light that the lens transmits.

        It falls with the fourth power of the cosine, softened by an exponent `vignetting`: 0 is an even image. A
        fisheye, designed for light at 90 degrees, loses as much there as another lens at half the angle.
        """
        cosine = np.sqrt((1 + self.cosine) / 2) if self.camera.model == "fisheye" else self.cosine
        return np.where(self.open, cosine ** np.float32(4 * vignetting), np.float32(0))

    def patch(self, part: Part, to_plane: Array) -> Patch:
        """A plane as seen in a part of the image.

        `to_plane` (3, 3) maps rays to the texture's homogeneous (column, row, 1), positive multiples of it where the
        ray meets the plane in front of the camera. Within a pixel the mapping is approximated as affine.
        """
        homography = to_plane.astype(np.float32)
        at, by_u, by_v = (np.tensordot(homography, field[:, *part], axes=1) for field in (self.rays, *self._slopes))
        # Within a pixel of the plane's horizon it is not affine, and too far away for anything to be there.
        ahead = at[2] > np.abs(by_u[2]) + np.abs(by_v[2])
        scale = 1 / np.where(ahead, at[2], np.float32(1))
        place = at[:2] * scale
        steps = ((by[:2] - place * by[2]) * scale for by in (by_u, by_v))
        return Patch(part, np.where(ahead & self.open[part], place, NOWHERE), *steps)

    def crop(self, outline: Array) -> Part | None:
        """Rows and columns in which the convex `outline` (n, 3), m, in the camera frame, can show; None: outside.

        Anything thinner than a pixel may be missed.
        """
        outline = _in_front(outline)
        if len(outline) == 0:
            return None
        rays = outline[:, :2] / outline[:, 2:]
        low, high = rays.min(axis=0), rays.max(axis=0)
        if (low > self._view[1]).any() or (high < self._view[0]).any():
            return None
        low, high = low[:, None, None], high[:, None, None]
        least, most = self._blocks
        rows, columns = _span(((least <= high) & (most >= low)).all(axis=0))  # ty: ignore[invalid-argument-type]
        rough = slice(rows.start * BLOCK, rows.stop * BLOCK), slice(columns.start * BLOCK, columns.stop * BLOCK)
        rays = self._flat[:2, *rough]
        rows, columns = _span(((rays >= low) & (rays <= high)).all(axis=0))  # ty: ignore[invalid-argument-type]
        if rows.start == rows.stop:
            return None
        # A pixel whose centre just misses the outline may still overlap it.
        top, left = rough[0].start + rows.start - 1, rough[1].start + columns.start - 1
        bottom, right = rough[0].start + rows.stop + 1, rough[1].start + columns.stop + 1
        height, width = self.camera.height, self.camera.width
        return slice(max(top, 0), min(bottom, height)), slice(max(left, 0), min(right, width))

    @cached_property
    def _flat(self) -> Singles:
        """(3, height, width) as `rays`, with NaN for none."""
        x, y = np.moveaxis(self.camera.rays, -1, 0)
        return np.stack((x, y, np.ones_like(x))).astype(np.float32)

    @cached_property
    def _view(self) -> Singles:
        """(2, 2) the least and the largest x and y of all rays."""
        return np.stack([np.asarray(end(self._flat[:2], axis=(1, 2))) for end in (np.nanmin, np.nanmax)])

    @cached_property
    def _slopes(self) -> tuple[Singles, Singles]:
        """(3, height, width) d ray / du and d ray / dv: within a pixel the lens is linear."""
        by_v, by_u = (np.nan_to_num(np.asarray(slope)) for slope in np.gradient(self._flat, axis=(1, 2)))
        return by_u, by_v

    @cached_property
    def _blocks(self) -> tuple[Singles, Singles]:
        """(2, rows, columns) the least and the largest x and y of the rays in each block, and one pixel around it."""
        least, most = [], []
        for top in range(0, self.camera.height, BLOCK):
            rows = self._flat[:2, max(top - 1, 0) : top + BLOCK + 1]
            lefts = range(0, self.camera.width, BLOCK)
            blocks = [rows[:, :, max(left - 1, 0) : left + BLOCK + 1] for left in lefts]
            least.append([np.fmin.reduce(block, axis=(1, 2)) for block in blocks])
            most.append([np.fmax.reduce(block, axis=(1, 2)) for block in blocks])
        return np.moveaxis(np.array(least), -1, 0), np.moveaxis(np.array(most), -1, 0)


@lru_cache(maxsize=CAMERAS_KEPT)
def through(camera: Camera) -> Lens:
    """The camera's lens, cached."""
    return Lens(camera)


@lru_cache(maxsize=CAMERAS_KEPT)
def bands(camera: Camera, lines: int) -> tuple[Camera, ...]:
    """Cameras that see `lines` rows each of the camera's frame, from the top, cached."""
    (cx, cy), rows = camera.centre, range(0, camera.height, lines)
    return tuple(replace(camera, height=min(lines, camera.height - row), centre=(cx, cy - row)) for row in rows)


@lru_cache(maxsize=CAMERAS_KEPT)
def dispersed(camera: Camera, share: float) -> tuple[Camera, ...]:
    """The camera in red, whose image is larger than the green one by `share`, in green, and in blue, smaller; cached.

    `camera` is as calibrated in grey: the mean of the three by COLOURS.
    """
    scales = np.array([1 + share, 1.0, 1 - share])
    (fx, fy), scales = camera.focal, scales / (COLOURS @ scales)
    return tuple(replace(camera, focal=(fx * scale, fy * scale)) for scale in scales.tolist())


def _in_front(outline: Array) -> Array:
    """Clips a convex outline (n, 3) to the part in front of the lens, (m, 3)."""
    if (outline[:, 2] >= NEAR).all():
        return outline
    kept: list[Array] = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if a[2] >= NEAR:
            kept.append(a)
        if (a[2] >= NEAR) != (b[2] >= NEAR):
            kept.append(a + (NEAR - a[2]) / (b[2] - a[2]) * (b - a))
    return np.array(kept).reshape(-1, 3)


def _span(found: NDArray[np.bool_]) -> Part:
    """The rows and columns from the first to the last that is set; empty if none is."""
    rows, columns = np.flatnonzero(found.any(axis=1)), np.flatnonzero(found.any(axis=0))
    if len(rows) == 0:
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)

"""Inner loops of `depth`: how deep each pixel's ray goes, and a depth camera's noise, compiled."""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

Singles = NDArray[np.float32]


@compiled
def reach(rays: Singles, turn: Array, eye: Array, half: Array, faces: Array, out: Singles) -> None:
    """Writes to `out` (n,) the multiples of `rays` (3, n) at which they first meet a surface.

    `turn` (3, 3) and `eye` (3,), m, are the camera's in the room's frame. The room goes from -half to +half in x and y,
    and from 0 to half[2] in z. `faces` (f, 14) are rectangles that face the camera: their middle, their axes x, y and z
    out of them, half their width and half their height. Rays have z = 1, so that a multiple is a depth, m.
    """
    for k in range(rays.shape[1]):
        a, b, c = rays[0, k], rays[1, k], rays[2, k]
        dx = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
        dy = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
        dz = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
        best = np.inf
        if dx != 0.0:
            best = min(best, ((half[0] if dx > 0.0 else -half[0]) - eye[0]) / dx)
        if dy != 0.0:
            best = min(best, ((half[1] if dy > 0.0 else -half[1]) - eye[1]) / dy)
        if dz != 0.0:
            best = min(best, ((half[2] if dz > 0.0 else 0.0) - eye[2]) / dz)
        for i in range(len(faces)):
            face = faces[i]
            ox, oy, oz = eye[0] - face[0], eye[1] - face[1], eye[2] - face[2]
            towards = face[9] * dx + face[10] * dy + face[11] * dz
            if towards >= 0.0:
                continue
            far = -(face[9] * ox + face[10] * oy + face[11] * oz) / towards
            if far >= best:
                continue
            hx, hy, hz = ox + far * dx, oy + far * dy, oz + far * dz
            across = face[3] * hx + face[4] * hy + face[5] * hz
            up = face[6] * hx + face[7] * hy + face[8] * hz
            if abs(across) <= face[12] and abs(up) <= face[13]:
                best = far
        out[k] = best


@compiled
def smooth(noise: Singles, taps: Singles) -> Singles:
    """The noise (h + t - 1, w + t - 1) weighed by `taps` (t,) along rows and columns: (h, w)."""
    size = len(taps)
    rows, columns = noise.shape[0] - size + 1, noise.shape[1] - size + 1
    level = np.empty((noise.shape[0], columns), np.float32)
    for v in range(noise.shape[0]):
        for u in range(columns):
            total = np.float32(0)
            for k in range(size):
                total += taps[k] * noise[v, u + k]
            level[v, u] = total
    out = np.empty((rows, columns), np.float32)
    for v in range(rows):
        for u in range(columns):
            total = np.float32(0)
            for k in range(size):
                total += taps[k] * level[v + k, u]
            out[v, u] = total
    return out


@compiled
def measured(
    depth: Singles, noise: Singles, scale: float, steps: float, near: float, far: float, jump: float, around: int
) -> Singles:
    """The depth (h, w), m, in whole millimetres, as a camera of disparities `scale` / depth, px, measures it; 0: none.

    The disparities err by `noise` (h, w), px, and have `steps` per px. Nothing is measured where the true depth is not
    within `near` to `far`, or changes by more than its share `jump` within `around` pixels.
    """
    rows, columns = depth.shape
    out = np.zeros((rows, columns), np.float32)
    for v in range(rows):
        for u in range(columns):
            z = depth[v, u]
            if not near <= z <= far:
                continue
            least, most = z, z
            for i in range(max(v - around, 0), min(v + around + 1, rows)):
                for j in range(max(u - around, 0), min(u + around + 1, columns)):
                    least, most = min(least, depth[i, j]), max(most, depth[i, j])
            if most - least > jump * z:
                continue
            disparity = np.rint((scale / z + noise[v, u]) * steps) / steps
            if disparity > 0.0:
                out[v, u] = np.float32(np.rint(1000.0 * scale / disparity) / 1000.0)
    return out

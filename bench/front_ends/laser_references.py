"""References for the laser front end's cost: plain programs for parts of the same work, in NumPy and SciPy."""

import numpy as np

from ...core.se2 import Array
from ...frontend.laser._search import FULL, Search
from ...frontend.laser.submap import Submap

ROUNDS, CLOSE = 20, 0.3  # rounds of ICP, and m between points that belong together


def icp(before: Array, now: Array) -> Array:
    """The pose (3,) of the points `now` (k, 2) that lays them on those of the scan `before` (m, 2).

    Besl and McKay, A method for registration of 3-D shapes, PAMI 1992, in the plane: nearest neighbours by a k-d tree,
    then the rotation and shift with the least squared distance.
    """
    from scipy.spatial import KDTree

    tree, turn, shift = KDTree(before), np.eye(2), np.zeros(2)
    for _ in range(ROUNDS):
        moved = now @ turn.T + shift
        distance, nearest = tree.query(moved)
        close = distance < CLOSE
        if close.sum() < 3:
            break
        a, b = now[close], before[np.asarray(nearest)[close]]
        U, _, Vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
        turn = U @ np.diag([1.0, np.linalg.det(U @ Vt)]) @ Vt
        shift = b.mean(axis=0) - turn @ a.mean(axis=0)
    return np.array([*shift, np.arctan2(turn[1, 0], turn[0, 0])])


def tried(search: Search, submap: Submap) -> float:
    """The best score of all poses of a search, each of them tried: array sums over the whole window."""
    field, size = submap.pyramid[0], submap.settings.cell
    half, turns = int(np.ceil(search.window / size)), int(np.ceil(search.turn / search.turn_step))
    padded, best = np.pad(field, 2 * half).astype(np.int32), 0
    for turn in range(-turns, turns + 1):
        heading = search.centre[2] + turn * search.turn_step
        c, s = np.cos(heading), np.sin(heading)
        x, y = search.points.T
        i = np.floor((search.centre[0] + c * x - s * y - submap.origin[0]) / size).astype(int)
        j = np.floor((search.centre[1] + s * x + c * y - submap.origin[1]) / size).astype(int)
        sums = np.zeros((2 * half + 1, 2 * half + 1), np.int32)
        for u, v in zip((i + half).tolist(), (j + half).tolist(), strict=True):
            if 0 <= u < field.shape[0] + 2 * half and 0 <= v < field.shape[1] + 2 * half:
                sums += padded[u : u + 2 * half + 1, v : v + 2 * half + 1]
        best = max(best, int(sums.max()))
    return best / FULL / len(search.points)

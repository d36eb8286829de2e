"""The first position in the world, which the start of its log may contradict."""

from collections.abc import Iterator

import numpy as np

from ...core.factors import Log, Truth
from ...core.se2 import Array, act
from ...core.truth.errors import rows_of
from ...datasets.fixes.degrees import ORIGIN
from ...datasets.fixes.geodetic import degrees
from ..words.numerals import number

FRAME, NOISE = 3.0, 5.0
"""Standard deviations of the first position from the start by odometry: where that position is the origin itself, the
frames are not the same, as a start is there by chance alone; of others, noise has more once in 270,000 logs."""

SURE = 0.5
"""Of the first position's standard deviations: the odometry's error up to there is less, or nothing is said."""


def far_start(log: Log, truth: Truth | None = None) -> Iterator[str]:
    """Compares the first position with the start, where that is known.

    Where the origin of the positions is its place in degrees, that of the start is said: by the true path, if known.
    """
    if log.fixes is None or log.prior.start != "known":
        return
    rows = np.flatnonzero(~np.isnan(log.fixes.z[:, :2]).any(axis=1))
    if not len(rows):
        return
    row, step = int(rows[0]), int(log.fixes.step[rows[0]])
    path = log.dead_reckoned()[: step + 1]
    pose = path[step]
    cov = log.fixes.cov[row, :2, :2] + log.prior.cov[:2, :2]
    turned = pose[:2] - log.prior.pose[:2]
    cov = cov + log.prior.cov[2, 2] * np.outer([-turned[1], turned[0]], [-turned[1], turned[0]])
    noise, left = log.delta_cov[1 : step + 1], pose[:2] - path[1:, :2]
    drift = np.sqrt(noise[:, 0, 0].sum() + noise[:, 1, 1].sum() + noise[:, 2, 2] @ (left**2).sum(axis=1))
    if drift > SURE * np.sqrt(cov.trace()):
        return
    off = log.fixes.z[row, :2] - act(pose, log.fixes.arm[row])
    sds = float(np.sqrt(off @ np.linalg.solve(cov, off)))
    origin = not log.fixes.z[row, :2].any()
    if sds > (FRAME if origin else NOISE):
        at = "the start" if not step else f"where the odometry leads from the start until {log.t[step]:.10g} s"
        far = number(float(np.hypot(*off)))
        yield (
            f"the first position is {far} m from {at}, {number(sds)} standard deviations of both"
            + ": it is the origin of the positions, and that of the start or the truth is another" * origin
            + (_mended(log, truth, off) if origin else "")
        )


def _mended(log: Log, truth: Truth | None, off: Array) -> str:
    """Says which origin takes out that the first position is `off` (2,), m; "" where it is not in degrees."""
    origin, table = log.notes.get(ORIGIN), log.fixes
    if origin is None or table is None:
        return ""
    by, shift = "the start", off
    if truth is not None and truth.exact and len(truth.t):
        at = rows_of(truth.t, log.t[table.step])
        mine = (at >= 0) & ~np.isnan(table.z[:, :2]).any(axis=1)
        if mine.any():
            by = "the true path"
            shift = np.median(table.z[mine, :2] - act(truth.poses[at[mine]], table.arm[mine]), axis=0)
    lat, lon = degrees(shift, np.array(origin)).tolist()
    return f": by {by} origin_lat={lat:.7f} and origin_lon={lon:.7f} of csv, or [gps] origin in robot.toml, take it out"

"""Drives around beacons of which a range or a bearing is measured alone, with positions and headings in between."""

from typing import NamedTuple

import numpy as np

from slamduel.core.factors import Log, Prior, Systematic
from slamduel.core.fixes import FixTable
from slamduel.core.partial import BEARING, RANGE, PartialTable
from slamduel.core.se2 import Array, compose, wrap

BEACONS = np.array([[6.0, 1.0], [2.0, 7.0], [-4.0, 4.0], [1.0, -3.0]])


class Drive(NamedTuple):
    """A log and the truth that it was drawn from."""

    log: Log
    path: Array  # (n, 3)
    beacons: Array  # (b, 2)
    scale: float  # of ranges, minus one


def drive(
    seed: int,
    *,
    steps: int = 200,
    kinds: tuple[int, ...] = (RANGE,),
    range_sd: float = 0.05,
    bearing_sd: float = 0.02,
    scale_sd: float = 0.0,
    fix_every: int = 0,
    fix_sd: float = 0.1,
    compass: bool = False,
    noise: float = 1.0,
) -> Drive:
    """A circle of 3 m radius through the beacons, one beacon measured a step, each kind in turn.

    `noise` multiplies the standard deviations of motions and measurements, `scale_sd` aside.
    """
    rng = np.random.default_rng(seed)
    sd = noise * np.array([0.01, 0.005, 0.005])
    range_sd, bearing_sd, fix_sd, compass_sd = (noise * one for one in (range_sd, bearing_sd, fix_sd, 0.05))
    scale = rng.normal(0, scale_sd) if scale_sd else 0.0
    path, delta = [np.zeros(3)], [np.full(3, np.nan)]
    for _ in range(1, steps):
        motion = np.array([0.2, 0.0, 0.2 / 3])
        path.append(compose(path[-1], motion + rng.normal(0, sd)))
        delta.append(motion)
    poses = np.array(path)
    rows = []
    for k in range(steps):
        beacon, kind = int(rng.integers(len(BEACONS))), kinds[k % len(kinds)]
        dx, dy = BEACONS[beacon] - poses[k, :2]
        if kind == RANGE:
            rows.append((k, beacon, kind, (1 + scale) * np.hypot(dx, dy) + rng.normal(0, range_sd), range_sd**2))
        else:
            bearing = wrap(np.arctan2(dy, dx) - poses[k, 2] + rng.normal(0, bearing_sd))
            rows.append((k, beacon, kind, bearing, bearing_sd**2))
    step, ids, kind, z, var = (np.array(column) for column in zip(*rows, strict=True))
    fixes = None
    if fix_every:
        at = np.arange(fix_every, steps, fix_every)
        arm = np.array([0.3, -0.2])
        c, s = np.cos(poses[at, 2]), np.sin(poses[at, 2])
        where = poses[at, :2] + np.column_stack((c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]))
        heading = wrap(poses[at, 2] + rng.normal(0, compass_sd, len(at))) if compass else np.full(len(at), np.nan)
        measured = np.column_stack((where + rng.normal(0, fix_sd, where.shape), heading))
        cov = np.tile(np.diag([fix_sd**2, fix_sd**2, compass_sd**2 if compass else np.nan]), (len(at), 1, 1))
        unmeasured = np.isnan(measured)
        cov[unmeasured[:, :, None] | unmeasured[:, None, :]] = np.nan
        fixes = FixTable.from_arrays(steps, at, measured, cov, np.tile(arm, (len(at), 1)))
    log = Log.from_arrays(
        "beacons",
        Prior(np.zeros(3), np.diag([1e-6, 1e-6, 1e-6]), systematic=Systematic(range_scale=scale_sd)),
        np.arange(steps, dtype=np.float64) * 0.1,
        np.array(delta),
        np.tile(np.diag(sd**2), (steps, 1, 1)),
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
        partial=PartialTable.from_arrays(steps, step, ids, kind, z, var),
        fixes=fixes,
    )
    return Drive(log, poses, BEACONS, scale)


__all__ = ["BEACONS", "BEARING", "RANGE", "Drive", "drive"]

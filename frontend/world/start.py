"""The start of a robot in the world by its first positions and headings, for one that nobody gave.

The path by the odometry is laid upon the first positions. What that tells of the start is stated three times as wide as
it is, since the same positions are factors of the log as well: they count by a ninth more than once.
"""

import numpy as np

from ...core.arrays import frozen
from ...core.errors import InputError
from ...core.factors import Log, Prior
from ...core.se2 import Array, act, wrap
from ..wheels.motion import Motion
from .fixes import path_at
from .jumps import fitted
from .measured import Measured

WIDE = 3.0  # times as wide as known
SURE = 0.1  # rad, of the heading, at which no more positions are used
LEAST_SD = 0.02  # rad
MOST = 0.4  # rad, by positions alone, beyond which the heading is not known


def start(log: Log, found: Measured, motion: Motion | None) -> Prior:
    """The log's prior, in the world; InputError where positions do not tell the heading, and no compass does."""
    inside = found.taken((log.t[0] <= found.t) & (found.t <= log.t[-1]))
    own, turned = inside.taken(inside.placed), inside.taken(~inside.placed)
    pose, sd = log.prior.pose.copy(), np.sqrt(np.diag(log.prior.cov))
    heading, heading_sd = None, np.inf
    if len(turned.t):
        first = turned.taken(np.arange(min(len(turned.t), 5)))
        off = wrap(first.z[:, 2] - path_at(log, first.t, motion)[:, 2])
        heading = float(np.arctan2(np.sin(off).sum(), np.cos(off).sum()))
        constant = log.prior.systematic.heading_offset
        heading_sd = float(np.hypot(np.sqrt(first.cov[:, 2, 2].mean()), constant))
    if len(own.t):
        path = act(path_at(log, own.t, motion), own.arm)
        rows, by_way = _first(path, own)
        if by_way < heading_sd and by_way < MOST:
            fit = fitted(path[:rows], own.z[:rows, :2])
            heading, heading_sd = fit.turn, by_way
        if heading is None:
            raise InputError(
                f"{log.name}: nothing says which way the robot started: its positions tell that to {by_way:.2g} rad, "
                f"expected {MOST:g}, and there is no compass; expected [prior] pose in robot.toml, x east and y north."
            )
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s], [s, c]])
        pose[:2] = (own.z[:rows, :2] - path[:rows] @ turn.T).mean(axis=0)
        reach = float(np.hypot(*path[:rows].mean(axis=0)))
        sd[:2] = np.hypot(_sd(own) / np.sqrt(rows), reach * heading_sd)
    if heading is not None:
        pose[2], sd[2] = np.arctan2(np.sin(heading), np.cos(heading)), max(heading_sd, LEAST_SD)
    wide = np.diag((WIDE * sd) ** 2)
    return log.prior._replace(pose=frozen(pose), cov=frozen(wide))


def _first(path: Array, own: Measured) -> tuple[int, float]:
    """The number of positions that tell the heading to SURE, or of all, and its standard deviation by these."""
    by_way = np.inf
    for rows in range(2, len(path) + 1):
        apart = path[:rows] - path[:rows].mean(axis=0)
        way = float(np.sqrt((apart**2).sum()))
        by_way = _sd(own) / way if way > 0 else np.inf
        if by_way < SURE:
            return rows, by_way
    return len(path), by_way


def _sd(own: Measured) -> float:
    """m, the typical standard deviation of a coordinate."""
    return float(np.sqrt(np.trace(own.cov[:, :2, :2], axis1=1, axis2=2).mean() / 2))

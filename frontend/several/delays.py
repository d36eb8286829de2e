"""Delays: how late a sensor's stamps are beside the gyro's or the wheels', by the turns that both tell.

A sensor that is d late saw at t - d what it stamps t. Its turn from one step to the next is then that of the gyro, or
the wheels, between t - d of both, up to their noise: d is the one under which they differ least, by weighted least
squares, with a gyro's bias beside it. It shows where the rate of turning changes; its standard deviation says how well.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints, wrap
from ..inertial.delay import Delay
from ..inertial.imu import Imu
from ..wheels.motion import Drift, Motion

MOST, GRID = 0.5, 0.005  # s, the largest delay that is looked for, and between those tried
FEW = 10  # turns that tell anything
KNOWN = 0.03  # s, the standard deviation of a delay that is worth telling
SINGLE = 4.0  # standard deviations beyond which a turn counts less
BENT = 4  # grid points to each side that a parabola goes through: headings between readings are interpolated
UNKNOWN_BIAS = 0.02  # rad/s


class Turning(NamedTuple):
    """A gyro or wheels that tell the turn between any two times."""

    by: str
    t: Array  # (n,) s
    heading: Array  # (n,) rad, summed and not wrapped
    var: Array  # (n,) rad^2, summed: that of the turn between two times is the difference
    biased: bool  # by an unknown rate


class Turned(NamedTuple):
    """Turns of a sensor between steps, one after another, so that no two have a stretch of the way in common."""

    start: Array  # (m,) s
    end: Array  # (m,) s
    turn: Array  # (m,) rad
    var: Array  # (m,) rad^2


def turning(motion: Motion, imu: Imu | None) -> Turning | None:
    """The turning by a gyro without gaps that nothing contradicts, else by the wheels; None without both."""
    if imu is not None and imu.turns and imu.sound.all():
        between = np.diff(imu.t)
        rate = imu.gyro[:, 2]
        heading = np.concatenate(([0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * between)))
        return Turning("gyro", imu.t, heading, imu.noise * (imu.t - imu.t[0]), biased=True)
    if isinstance(motion, Drift):
        return None
    first, last = motion.t[[0, -1]].tolist()
    t = np.linspace(first, last, int((last - first) / GRID) + 2)
    moved = [motion.odometry(*ends).delta[2] for ends in zip(t[:-1].tolist(), t[1:].tolist(), strict=True)]
    # The floors of a motion are for each that is asked for: those of a second, not of every 5 ms.
    seconds = np.linspace(first, last, int(last - first) + 2)
    some = [motion.odometry(*ends).cov[2, 2] for ends in zip(seconds[:-1].tolist(), seconds[1:].tolist(), strict=True)]
    var = np.interp(t, seconds, np.concatenate(([0.0], np.cumsum(some))))
    return Turning("wheels", t, np.concatenate(([0.0], np.cumsum(moved))), var, biased=False)


def turned(t: Array, at: Ints, to: Ints, turn: Array, var: Array) -> Turned:
    """The turns between the steps, at `t` (n,), s, of relative poses from `to` to `at` (m,), rising.

    Two that are to one step make the turn between both.
    """
    rows = list[tuple[float, float, float, float]]()
    latest = -np.inf
    for k in range(len(at)):
        if k and to[k] == to[k - 1] and at[k] > at[k - 1]:
            begin, way, spread = float(t[at[k - 1]]), float(turn[k] - turn[k - 1]), float(var[k] + var[k - 1])
        else:
            begin, way, spread = float(t[to[k]]), float(turn[k]), float(var[k])
        if begin >= latest:
            latest = float(t[at[k]])
            rows.append((begin, latest, np.arctan2(np.sin(way), np.cos(way)), spread))
    return Turned(*np.array(rows, float).reshape(-1, 4).T)


def delay(known: Turning, seen: Turned) -> Delay | None:
    """The delay of a sensor's turns; None with too few, and where they do not tell it."""
    kept = (seen.start - MOST >= known.t[0]) & (seen.end + MOST <= known.t[-1])
    start, end, turn, var = (column[kept] for column in seen)
    if len(start) < FEW:
        return None
    total = var + np.interp(end, known.t, known.var) - np.interp(start, known.t, known.var)
    tried = np.arange(-MOST, MOST + GRID / 2, GRID)
    dt = end - start
    costs = np.empty(len(tried))
    for k, late in enumerate(tried.tolist()):
        off = wrap(
            turn - np.interp(end - late, known.t, known.heading) + np.interp(start - late, known.t, known.heading)
        )
        if known.biased:
            off = off - dt * (dt * off / total).sum() / ((dt**2 / total).sum() + 1 / UNKNOWN_BIAS**2)
        squares = off**2 / total
        costs[k] = np.where(squares < SINGLE**2, squares, 2 * SINGLE * np.sqrt(squares) - SINGLE**2).sum()
    best = int(costs.argmin())
    if not BENT <= best < len(tried) - BENT:
        return None
    near = slice(best - BENT, best + BENT + 1)
    bend, slope, _ = np.polyfit(tried[near] - tried[best], costs[near], 2)
    if bend <= 0:
        return None
    scale = max(1.0, float(costs[best]) / (len(start) - 1))
    found = Delay(float(tried[best] - slope / (2 * bend)), float(np.sqrt(scale / bend)))
    return found if found.sd < KNOWN else None


def remark(name: str, sensor: str, by: str, found: Delay) -> str:
    """Says that a sensor's stamps are off."""
    return (
        f"{name}: by the turns of the {by} the stamps of the {sensor} are {1e3 * abs(found.seconds):.0f} "
        f"± {1e3 * found.sd:.0f} ms {found.word}: [{sensor}] time_offset = {-found.seconds:.3f} in robot.toml "
        "takes that off"
    )

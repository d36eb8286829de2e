"""Hints at the units of odometry: degrees taken for radians, milliseconds for seconds."""

from collections.abc import Iterator

import numpy as np

from ...core.elementary import arctan2, hypot, sincos
from ...core.se2 import Array

FEW = 10  # readings below which nothing is odd

ALONG, ACROSS = 0.9, 0.5
"""Mean resultant lengths of twice the angle from the heading to the way, above and below which a robot drives along its
heading, forwards or backwards, and does not: wheels hold it within 13 degrees of it."""

SPINNING = 5.0
"""rad/s; a median turning rate beyond it, while turning, is nearly a turn per second: it may be in degrees."""

OFTEN, TURN = 0.9, 2 * np.pi
"""Share of the turning rates that are below a turn a second, rad/s: a robot that drives turns less."""

CREEPING = 0.005
"""m/s; a median speed below it, while moving, is of no robot that maps: 5 m/s with times in milliseconds."""

SELDOM = 5.0
"""s; a median time between readings beyond it: 200 Hz or less with times in milliseconds."""


def odd_units(source: str, t: Array, poses: Array) -> Iterator[str]:
    """Yields what looks like another unit in poses (m, 3) at `t` (m,), s, a sentence each without its full stop."""
    if len(t) <= FEW:
        return
    dt, way = np.diff(t), hypot(*np.diff(poses[:, :2], axis=0).T)
    if np.median(dt) > SELDOM:
        yield f"{source}: the median time between readings is {np.median(dt):.4g} s: perhaps it is in milliseconds"
    else:
        speed = (way / dt)[way > 0]
        if len(speed) >= FEW and np.median(speed) < CREEPING:
            found = f"the median speed while moving is {np.median(speed):.2g} m/s"
            yield f"{source}: {found}: perhaps the times are in milliseconds, or the positions in kilometres"
    turn = np.abs(np.diff(np.unwrap(poses[:, 2])))
    rate = (turn / dt)[turn > 0]
    if len(rate) >= FEW and np.median(rate) > SPINNING:
        found = f"the median turning rate while turning is {np.median(rate):.3g} rad/s"
        yield f"{source}: {found}: perhaps headings or turning rates are in degrees"


def fast_turns(source: str, rates: Array) -> Iterator[str]:
    """Yields that turning rates (m,), rad/s, are those of no robot: some of them more than a turn a second."""
    if len(rates) > FEW and (fast := float(np.quantile(np.abs(rates), OFTEN))) > TURN:
        found = f"in {100 * (1 - OFTEN):.0f} % of the time the robot turns by more than {fast:.3g} rad/s"
        yield f"{source}: {found}: perhaps turning rates are in degrees"


def in_degrees(poses: Array) -> bool:
    """Tells if a robot drives along its headings, the last column of `poses` (m, 3), only if these are in degrees."""
    moved = np.diff(poses[:, :2], axis=0)
    way = hypot(*moved.T)
    typical = way > 0.1 * way.max(initial=0.0)  # the direction of less is mostly noise
    if typical.sum() < FEW or not np.isfinite(poses).all():
        return False
    direction = arctan2(moved[typical, 1], moved[typical, 0])
    heading = ((poses[:-1, 2] + poses[1:, 2]) / 2)[typical]
    return _along(direction - heading) < ACROSS and _along(direction - np.deg2rad(heading)) > ALONG


def _along(angle: Array) -> float:
    s, c = sincos(2 * angle)
    return float(np.hypot(s.mean(), c.mean()))

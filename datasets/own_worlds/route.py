"""The way of a robot through way points: an arc until it faces the next one, then straight ahead.

The robot keeps its speed while it turns: the arc's radius is speed over greatest turn rate (in the code of the Matlab
report's appendix, V / MAXW). It heads for the next way point as soon as it is near one (AT_WAYPOINT).
"""

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from ...core.elementary import arctan2, hypot, sincos
from ...core.se2 import Array, Ints, compose, wrap
from ...frontend.wheels.encoder import roll

AHEAD = 1e-9  # rad; a turn short of a whole one by no more is none


class Route(NamedTuple):
    """Arcs and straight pieces, by the way to where each begins."""

    starts: Array  # (p,) m
    poses: Array  # (p, 3) there
    curvature: Array  # (p,) 1/m
    length: float  # m, of the whole
    passed: Ints  # way points that were near already when their turn came
    around: Ints  # those inside the circle of a turn towards them, so that the robot turns the other way round

    def at(self, way: Array) -> Array:
        """The poses (n, 3) after `way` (n,) m."""
        piece = np.searchsorted(self.starts, way, "right") - 1
        into = way - self.starts[piece]
        delta, _ = roll(np.stack((into, into * self.curvature[piece]), axis=-1), "arc")
        delta[:, 2] = wrap(delta[:, 2])
        return compose(self.poses[piece], delta)


def route(way_points: Array, radius: float, near: float) -> Route:
    """The way from the first of `way_points` (w, 2), m, facing the second, to within `near` m of the last.

    Turns have `radius`, m. A way point w is ahead of a robot on the circle around c where, at the heading psi,
    sin(beta - psi) = -side radius / |w - c|, with beta the direction from c to w.
    """
    pose = np.array([*way_points[0], float(arctan2(*(way_points[1] - way_points[0])[::-1]))])
    starts, poses, curvature = [0.0], [pose], [0.0]
    passed, around = list[int](), list[int]()
    for k, goal in enumerate(way_points[1:].tolist(), start=1):
        if float(hypot(goal[0] - pose[0], goal[1] - pose[1])) <= near:
            passed.append(k)
            continue
        (turn, straight, side), *other = sorted(filter(None, (_turn(pose, goal, radius, side) for side in (1.0, -1.0))))
        if not other:
            around.append(k)
        for length, bend in ((turn * radius, side / radius), (max(straight - near, 0.0), 0.0)):
            if length:
                starts.append(starts[-1] + length)
                curvature[-1] = bend
                curvature.append(0.0)
                delta, _ = roll(np.array([[length, length * bend]]), "arc")
                pose = compose(pose, np.array([*delta[0, :2], wrap(delta[0, 2])]))
                poses.append(pose)
    return Route(
        np.array(starts), np.array(poses), np.array(curvature), starts[-1], np.array(passed, np.int64),
        np.array(around, np.int64),
    )  # fmt: skip


def _turn(pose: Array, goal: Sequence[float], radius: float, side: float) -> tuple[float, float, float] | None:
    """The turn (rad) to one side, 1 being the left, until `goal` is straight ahead; the way to it then, m; the side.

    None where it is inside the circle.
    """
    s, c = (float(one) for one in sincos(pose[2]))
    x, y = goal[0] - (pose[0] - side * radius * s), goal[1] - (pose[1] + side * radius * c)
    d = float(hypot(x, y))
    if d < radius:
        return None
    ahead = sqrt(max(d * d - radius * radius, 0.0))
    heading = float(arctan2(y, x)) + side * float(arctan2(radius, ahead))
    turn = (side * (heading - float(pose[2]))) % (2 * pi)
    return (0.0 if turn > 2 * pi - AHEAD else turn), ahead, side

"""Messages of a topic as columns: integrated poses of nav_msgs/Odometry, or whatever numbers a message has."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import LARGEST
from ...frontend.wheels.motion import Poses
from .bag import Bag, Topic
from .clock import astray, check_clock
from .left_out import LeftOut

FARTHEST = 50.0
"""m from the message before and from the one after it, if these are nearer to each other: no robot was there."""

FEW = 4  # places, of which none is far from the others

COUNTS = 2.0**53  # a counter beyond is no whole number any more

LEVEL = np.cos(np.deg2rad(30))
"""Cosine of the largest angle between the robot's z axis and the world's on a level floor."""


def poses(bag: Bag, topic: Topic, remarks: list[str], back: float = np.inf) -> Poses:
    """The poses of a topic of nav_msgs/Odometry; `remarks` grows by what is odd or left out.

    InputError for stamps that go `back`, s, and where most messages cannot be read or are of no robot on a floor.
    """

    def row(message: Any) -> tuple[float, ...]:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        return place.x, place.y, turn.x, turn.y, turn.z, turn.w

    return planar(*columns(bag, topic, row, remarks, back, no_poses))


def planar(t: Array, found: Array) -> Poses:
    """Poses (m, 3) of the rows x, y, qx, qy, qz, qw (m, 6) at `t` (m,), s, which are sound."""
    x, y, z, w = found[:, 2:].T
    heading = np.arctan2(2 * (w * z + x * y), w**2 + x**2 - y**2 - z**2)
    return Poses(t, np.column_stack((found[:, :2], heading)))


def no_poses(found: Array) -> dict[int, str]:
    """The rows x, y, qx, qy, qz, qw of (m, 6), in order of time, that are no pose of a robot on a floor, and why."""
    with np.errstate(all="ignore"):
        size = np.linalg.norm(found[:, 2:], axis=1)
        x, y, z, w = found[:, 2:].T
        upright = (w**2 + z**2 - x**2 - y**2) / size**2
        faults = no_numbers(found[:, :2], LARGEST, "metres")
        faults |= {
            row: f"has the orientation {found[row, 2:].tolist()}, expected numbers"
            for row in _rows(~np.isfinite(found[:, 2:]).all(axis=1))
        }
        faults |= {
            row: f"has an orientation whose quaternion is of length {size[row]:.3g}, expected 1"
            for row in _rows(np.abs(size - 1) > 1e-2)
        }
        for row in _rows(upright < LEVEL):
            tilt = np.rad2deg(np.arccos(np.clip(upright[row], -1, 1)))
            faults.setdefault(row, f"is tilted by {tilt:.0f} degrees, expected a robot that drives on a floor")
    rest = np.array([row for row in range(len(found)) if row not in faults], np.int64)
    return faults | {int(rest[row]): why for row, why in _elsewhere(found[rest, :2]).items()}


def no_numbers(found: Array, most: float = COUNTS, unit: str = "counts") -> dict[int, str]:
    """The rows of (m, k) that are not finite or beyond `most`, and why."""
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(found) <= most).all(axis=1)
    return {row: f"has {found[row].tolist()}, expected {unit}, at most {most:.4g}" for row in _rows(wrong)}


def columns(
    bag: Bag,
    topic: Topic,
    row: Callable[[Any], tuple[float, ...]],
    remarks: list[str],
    back: float = np.inf,
    faults: Callable[[Array], dict[int, str]] = no_numbers,
) -> tuple[Array, Array]:
    """Times (m,), s, strictly increasing, and the `row` (m, k) of each message; of equal times the last counts.

    `remarks` grows. Messages that cannot be read, whose stamps are astray, or that have `faults` are left out.
    """
    left_out = LeftOut(str(bag.path), "message", f"of topic {topic.name}")
    numbers, stamps, received = list[int](), list[int](), list[int]()
    rows, untimed, total = list[tuple[float, ...]](), 0, 0
    for total, message in enumerate(bag.messages(topic.name), start=1):
        if message.content is None:
            left_out.add(total, "cannot be read")
            continue
        untimed += message.untimed
        numbers.append(total)
        stamps.append(message.nanoseconds)
        received.append(message.received)
        rows.append(row(message.content))
    if not rows:
        raise InputError(f"{bag.path}: none of the {topic.messages} messages of topic {topic.name} can be read.")
    found = np.array(rows, float)
    wrong = faults(found) | astray(stamps, received)
    for one, why in wrong.items():
        left_out.add(numbers[one], f"at {stamps[one] / 1e9:.10g} s, {why}")
    remarks += left_out.remarks(total)
    kept = [one for one in range(len(rows)) if one not in wrong]
    check_clock(bag, topic, [numbers[one] for one in kept], [stamps[one] for one in kept], back)
    at = {stamps[one]: one for one in kept}
    if len(at) < len(kept) / 2:
        raise InputError(
            f"{bag.path}: the {total} messages of topic {topic.name} have only {len(at)} distinct times, expected "
            "headers with the time of each reading, or zero times."
        )
    remarks += of_untimed(bag, topic, untimed)
    return np.array([time / 10**9 for time in sorted(at)]), found[[at[time] for time in sorted(at)]]


def of_untimed(bag: Bag, topic: Topic, untimed: int) -> list[str]:
    """The remark on messages whose headers have no time, where the others of their topic have."""
    if not untimed:
        return []
    found = f"{untimed} of {topic.messages} messages of topic {topic.name} have the time 0 in their headers"
    return [f"{bag.path}: {found}: theirs is that of their reception, less the others' delay"]


def _elsewhere(places: Array) -> dict[int, str]:
    """The rows of (m, 2), m, that are far from both neighbours while these are near each other; ends, from the rest."""
    far = np.zeros(len(places), np.bool_)
    if len(places) > FEW:
        way, over = (np.hypot(*(places[k:] - places[:-k]).T) for k in (1, 2))
        far[1:-1] = (way[:-1] > FARTHEST) & (way[1:] > FARTHEST) & (over < FARTHEST)
        rest = np.flatnonzero(~far)
        way = np.hypot(*np.diff(places[rest], axis=0).T)
        far[rest[0]] = way[0] > max(FARTHEST, 10 * way[1:].max(initial=0))
        far[rest[-1]] = way[-1] > max(FARTHEST, 10 * way[:-1].max(initial=0))
    return {row: f"has the place {places[row].tolist()}, m, far from those before and after it" for row in _rows(far)}


def _rows(wrong: Any) -> list[int]:
    return np.flatnonzero(wrong).tolist()

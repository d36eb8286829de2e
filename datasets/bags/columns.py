"""Messages of a topic as columns: integrated poses of nav_msgs/Odometry, or whatever numbers a message has."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import LARGEST
from ...frontend.wheels.track import Poses
from .bag import Bag, Topic
from .clock import astray, check_clock
from .left_out import LeftOut

LEAST, LEAPS = 1.0, 50.0
"""m, and times the median step, from the message before and from the one after it: no robot was there and back."""

FAST = 5.0  # m/s there and m/s back; a faster one does not turn round from one message to the next

LEAST_COUNTS = 50.0  # of a counter, likewise

FARTHEST = 50.0  # m from the first message to the next, or from the last to the one before it

FEW = 4  # places, of which none is far from the others

COUNTS, METRES = 2.0**53, "metres"  # a counter beyond is no whole number any more

SPEEDS = "m/s and rad/s"

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


def no_poses(found: Array, t: Array) -> dict[int, str]:
    """The rows x, y, qx, qy, qz, qw of (m, 6) at `t` (m,), s, that are no pose of a robot on a floor, and why."""
    with np.errstate(all="ignore"):
        size = np.linalg.norm(found[:, 2:], axis=1)
        x, y, z, w = found[:, 2:].T
        upright = (w**2 + z**2 - x**2 - y**2) / size**2
        faults = no_numbers(found[:, :2], LARGEST, METRES)
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
    for wrong in (_there_and_back, _ends_elsewhere):
        rest = np.array([row for row in range(len(found)) if row not in faults], np.int64)
        for row in wrong(found[rest, :2], t[rest]):
            place = found[rest[row], :2].tolist()
            faults[int(rest[row])] = f"has the place {place}, m, far from those before and after it"
    return faults


def no_counts(found: Array, t: Array) -> dict[int, str]:  # noqa: ARG001 - of any rate
    """The rows of (m, k) that are no counts, or all 0 as none before and after them is, and why."""
    faults = no_numbers(found)
    rest = np.array([row for row in range(len(found)) if row not in faults], np.int64)
    for row in _elsewhere(found[rest], LEAST_COUNTS):
        if not found[rest[row]].any():  # else a counter may have wrapped forth and back
            faults[int(rest[row])] = "has counts of 0, far from those before and after it"
    return faults


def no_numbers(found: Array, most: float = COUNTS, unit: str = "whole numbers") -> dict[int, str]:
    """The rows of (m, k) that are not finite or beyond `most`, and why."""
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(found) <= most).all(axis=1)
    what = {METRES: "the place", SPEEDS: "the speeds"}.get(unit, "the counts")
    return {row: f"has {what} {found[row].tolist()}, expected {unit}, at most {most:.4g}" for row in _rows(wrong)}


def columns(
    bag: Bag,
    topic: Topic,
    row: Callable[[Any], tuple[float, ...]],
    remarks: list[str],
    back: float = np.inf,
    faults: Callable[[Array, Array], dict[int, str]] = no_counts,
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
    wrong = faults(found, np.array(stamps, float) / 1e9) | astray(stamps, received)
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


def _elsewhere(places: Array, least: float) -> list[int]:
    """The rows of (m, k) that are far from both neighbours while these are near each other.

    Far is beyond `least` and LEAPS times the median of all steps that are any.
    """
    if len(places) <= FEW:
        return []
    way, over = (np.linalg.norm(places[k:] - places[:-k], axis=1) for k in (1, 2))
    far = max(least, LEAPS * float(np.median(way[way > 0]))) if (way > 0).any() else least
    return (np.flatnonzero((way[:-1] > far) & (way[1:] > far) & (over < far)) + 1).tolist()


def _there_and_back(places: Array, t: Array) -> list[int]:
    """The rows of (m, 2), m, at `t` (m,), s, that are far from both neighbours and reached faster than any robot."""
    with np.errstate(divide="ignore", invalid="ignore"):
        fast = ~(np.hypot(*np.diff(places, axis=0).T) <= FAST * np.maximum(np.diff(t), 0.0))
    return [row for row in _elsewhere(places, LEAST) if fast[row - 1] and fast[row]]


def _ends_elsewhere(places: Array, t: Array) -> list[int]:  # noqa: ARG001 - of any rate
    """The first or the last row of (m, 2), m, if all others are far from it and near each other."""
    if len(places) <= FEW:
        return []
    way = np.hypot(*np.diff(places, axis=0).T)
    first, last = way[0] > max(FARTHEST, 10 * way[1:].max()), way[-1] > max(FARTHEST, 10 * way[:-1].max())
    return [0] * bool(first) + [len(places) - 1] * bool(last)


def _rows(wrong: Any) -> list[int]:
    return np.flatnonzero(wrong).tolist()

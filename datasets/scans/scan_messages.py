"""Reads the messages of a bag's topic of laser scans: sensor_msgs/LaserScan, or MultiEchoLaserScan.

Of several echoes of a beam the first counts. Scans that cannot be used are left out and counted.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.laser.scanner import Fan
from ..bags.bag import Bag, Topic
from ..bags.clock import astray, check_clock
from ..bags.columns import of_untimed
from ..bags.left_out import LeftOut

SCAN, ECHOES = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan"

APART = 1000  # ns; stamps that are closer are of the same scan
SAME = 1e-3  # rad by which the beams of two scans may differ and count as the first's
USUAL = 4  # times the median number of beams that a scan may have
SWEEP = 1.0  # s; a sweep that lasts longer is a `time_increment` in other units


class Swept(NamedTuple):
    """A scan of a bag."""

    number: int  # of its message
    stamp: int  # ns
    received: int  # ns
    middle: int  # ns, of its sweep
    frame: str
    fan: Fan
    ranges: Array  # (b,) m


class Scans(NamedTuple):
    """The scans of a topic in the order of time."""

    t: Array  # (n,) s, the middle of each sweep, strictly increasing
    ranges: list[Array]  # (b,) m of each scan
    fans: list[Fan]
    limits: tuple[float, float]  # m, the least and the largest range of a return as the scanner states them
    frame: str


def read_messages(bag: Bag, topic: Topic, remarks: list[str]) -> Scans:
    """All scans of a topic; `remarks` grows by what is odd or left out.

    InputError where no two can be used, most cannot, or their clock is set back.
    """
    example: Any = None  # the first scan that can be used
    number = unreadable = untimed = slow = empty = 0
    taken, left_out = list[Swept](), LeftOut(str(bag.path), "scan", f"of topic {topic.name}")
    for number, message in enumerate(bag.messages(topic.name), start=1):
        scan, stamp = message.content, message.nanoseconds
        if scan is None:
            unreadable += 1
            continue
        fan = Fan(len(scan.ranges), float(scan.angle_min), float(scan.angle_increment))
        if not fan.beams:
            empty += 1
            continue
        if fault := _fault(fan):
            left_out.add(number, f"has {_shown(fan)}, expected {fault}")
            continue
        example, untimed = example or scan, untimed + message.untimed
        sweep = (fan.beams - 1) * float(scan.time_increment)
        slow += not 0 <= sweep <= SWEEP
        middle = stamp + round(0.5e9 * sweep if 0 <= sweep <= SWEEP else 0.0)
        ranges = [_first(echo.echoes) for echo in scan.ranges] if topic.type == ECHOES else scan.ranges
        frame = scan.header.frame_id.strip("/")
        taken.append(Swept(number, stamp, message.received, middle, frame, fan, np.asarray(ranges, float)))
    if unreadable == number:
        raise InputError(f"{bag.path}: none of the {number} messages of topic {topic.name} can be read.")
    if empty + unreadable == number:
        raise InputError(f"{bag.path}: all {empty} scans of topic {topic.name} are empty, expected ranges.")
    odd = _others(taken) | astray([one.stamp for one in taken], [one.received for one in taken])
    for row, why in odd.items():
        left_out.add(taken[row].number, why)
    remarks += left_out.remarks(number - empty - unreadable)
    taken = [one for row, one in enumerate(taken) if row not in odd]
    check_clock(bag, topic, [one.number for one in taken], [one.stamp for one in taken])
    some = [one for one in taken if not np.isnan(one.ranges).all()]
    if some:  # else the ranges are refused
        empty, taken = empty + len(taken) - len(some), some
    kept = _apart(taken)
    if len(kept) < 2:
        raise InputError(f"{bag.path}: found {len(kept)} scans in topic {topic.name}, expected at least 2.")
    if empty:
        remarks.append(
            f"{bag.path}: {empty} of {number} scans of topic {topic.name} are empty, or NaN in every beam, and are "
            "left out"
        )
    remarks += of_untimed(bag, topic, untimed)
    remarks += list(_odd(bag, topic, example, unreadable, len(taken) - len(kept), slow))
    least, most = float(example.range_min), float(example.range_max)
    stated = (least, most) if 0 <= least < most else (0.0, np.inf)  # an unset limit is 0 or not a number
    t = np.array([one.middle / 10**9 for one in kept])
    return Scans(t, [one.ranges for one in kept], [one.fan for one in kept], stated, kept[0].frame)


def _apart(taken: list[Swept]) -> list[Swept]:
    """The scans in the order of time; of several at one time, the first."""
    kept = list[Swept]()
    for one in sorted(taken, key=lambda one: one.middle):
        if not kept or one.middle - kept[-1].middle > APART:
            kept.append(one)
    return kept


def _others(taken: list[Swept]) -> dict[int, str]:
    """The rows that are of another scanner than most, and why: another frame, or many times as many beams."""
    if not taken:
        return {}
    usual = USUAL * float(np.median([one.fan.beams for one in taken]))
    frame = Counter(one.frame for one in taken).most_common(1)[0][0]
    many = f"expected at most {usual:.0f}, {USUAL} times the median"
    faults = {row: f"has {one.fan.beams} beams, {many}" for row, one in enumerate(taken) if one.fan.beams > usual}
    for row, one in enumerate(taken):
        if one.frame != frame:
            faults[row] = f"is of the frame {one.frame!r}, most are of {frame!r}"
    return faults


def _first(echoes: Array) -> float:
    """The nearest echo of a beam, which scanners say first; NaN for none."""
    return float(echoes[0]) if len(echoes) else np.nan


def _fault(fan: Fan) -> str:
    """The expectation that beams do not meet; "" for sound ones."""
    if fan.beams < 2 or not np.isfinite([fan.first, fan.step]).all() or not 0 < abs(fan.step) < np.pi:
        return "at least 2 beams at steps of an angle"
    if abs(fan.last - fan.first) > 2 * np.pi + SAME + abs(fan.step):
        return "at most a full turn, in radians"
    return ""


def is_like(fan: Fan, other: Fan) -> bool:
    """Tells if all beams point the same way as another's."""
    return fan.beams == other.beams and max(abs(fan.first - other.first), abs(fan.last - other.last)) <= SAME


def _odd(bag: Bag, topic: Topic, scan: Any, unreadable: int, twice: int, slow: int) -> Sequence[str]:
    """Remarks on scans that are legal yet odd; `scan` is the first."""
    fan, said = Fan(len(scan.ranges), float(scan.angle_min), float(scan.angle_increment)), list[str]()
    if unreadable:
        said.append(f"{bag.path}: {unreadable} of {topic.messages} scans of topic {topic.name} cannot be read")
    if twice:
        said.append(f"{bag.path}: {twice} scans of topic {topic.name} have the stamp of another one and are left out")
    if slow:
        said.append(
            f"{bag.path}: time_increment is {scan.time_increment:.4g} s in {slow} scans of topic {topic.name}, a sweep "
            f"below 0 or above {SWEEP:g} s: theirs count as taken at their stamps"
        )
    if not abs(scan.angle_max - fan.last) < 1.5 * abs(fan.step):
        said.append(
            f"{bag.path}: angle_max of topic {topic.name} is {scan.angle_max:.5g} rad, the last of {fan.beams} beams "
            f"is at {fan.last:.5g}, which is used"
        )
    return said


def _shown(fan: Fan) -> str:
    return f"{fan.beams} beams from {fan.first:.5g} rad in steps of {fan.step:.5g}"

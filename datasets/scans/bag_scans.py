"""Reads sensor_msgs/LaserScan and odometry of a ROS bag for the laser front end.

Of MultiEchoLaserScan, which is read where a bag has no LaserScan or robot.toml names it, the first echo counts.
The front end takes a scan as a snapshot. Its stamp is that of its first beam, so the scan counts as taken in the middle
of its sweep, (n - 1) / 2 of `time_increment` later; single beams are not moved to where the robot was. The odometry, of
nav_msgs/Odometry or else of tf, is interpolated to that time.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.laser.recording import FARTHEST, LaserRecording, jump
from ...frontend.laser.scanner import CODES, Fan, Scanner, padded, spread, without_codes
from ..bags.bag import Bag, Topic
from ..bags.clock import astray, check_clock
from ..bags.columns import of_untimed
from ..bags.left_out import LeftOut
from ..bags.topics import choose, found, plain
from ..bags.transforms import Transforms
from ..prior import assumed
from .mounted import placed
from .odometry import Covered, covered, read_odometry
from .robot import LaserRobot

SCAN, ECHOES = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan"

APART = 1000  # ns; stamps that are closer are of the same scan
SAME = 1e-3  # rad by which the beams of two scans may differ and count as the first's
USUAL = 4  # times the median number of beams that a scan may have
SWEEP = 1.0  # s; a sweep that lasts longer is a `time_increment` in other units

FIRST = "of several echoes of a beam, the first"

SNAPSHOT = "a scan counts as taken at once, in the middle of its sweep; its beams are not corrected for the motion"


class Swept(NamedTuple):
    """A scan of a bag."""

    number: int  # of its message
    stamp: int  # ns
    received: int  # ns
    middle: int  # ns, of its sweep
    fan: Fan
    ranges: Array  # (b,) m


class Scans(NamedTuple):
    """The scans of a topic in the order of time."""

    t: Array  # (n,) s, the middle of each sweep, strictly increasing
    ranges: list[Array]  # (b,) m of each scan
    fans: list[Fan]
    limits: tuple[float, float]  # m, the least and the largest range of a return as the scanner states them
    frame: str


def read_bag(path: Path, robot: LaserRobot) -> tuple[LaserRecording, list[str]]:
    """The scans of the bag at `path` with their odometry, and remarks.

    InputError for a bag that is damaged, topics that are missing or ambiguous, a clock that goes back, a scanner or
    robot that is not level, and scans without odometry where the bag has some.
    """
    bag = Bag(path)
    listed = bag.listed()
    if not any(topic.messages for topic in listed):
        raise InputError(f"{path}: contains no messages, expected a recording.")
    single = any(one.type == SCAN and one.messages for one in listed)
    types = (SCAN, ECHOES) if robot.topic is not None else (SCAN,) if single else (ECHOES,)
    topic = choose(path, listed, robot.topic, "[laser] topic or the option scan", types)
    if topic is None:
        raise InputError(f"{path}: has no topic with scans ({plain(SCAN)}); {found(listed)}")
    remarks = bag.remarks()
    scans = _scans(bag, topic, remarks)
    transforms = Transforms(bag, listed)
    read = read_odometry(bag, listed, transforms, robot, remarks)
    mounted = placed(str(path), transforms, scans.frame, None if read is None else read.base, robot.pose, remarks)
    remarks += transforms.remarks
    ranges, fans = scans.ranges, scans.fans
    alike = all(is_like(fan, fans[0]) for fan in fans)
    if alike:
        fans = fans[:1] * len(fans)
    else:
        remarks.append(f"{path}: topic {topic.name}: {spread(fans)}")
    if mounted.upside_down:
        fans = [Fan(fan.beams, -fan.first, -fan.step) for fan in fans]
    clockwise = [fan.step < 0 for fan in fans]
    ranges = [row[::-1] if turned else row for row, turned in zip(ranges, clockwise, strict=True)]
    angles = fans[0].angles(fans[0].beams)
    least, most = scans.limits
    scanner = Scanner(
        angles[::-1].copy() if clockwise[0] else angles,
        mounted.pose,
        max(robot.min_range, least),
        min(robot.max_range, most),
    )
    fans = [Fan(fan.beams, fan.last, -fan.step) if turned else fan for fan, turned in zip(fans, clockwise, strict=True)]
    ranges = padded(ranges)
    if scanner.most > CODES[0]:
        ranges = without_codes(ranges)
    if not ((ranges > scanner.least) & (ranges < scanner.most)).any():
        raise InputError(
            f"{path}: no range of topic {topic.name} is between {scanner.least:.4g} and {scanner.most:.4g} m, expected "
            "returns in metres."
        )
    here = Covered(np.ones(len(scans.t), bool), None) if read is None else covered(path, scans.t, read, robot, remarks)
    if here.poses is not None and (jumped := jump(here.poses)) is not None:
        raise InputError(
            f"{path}: the odometry jumps by {jumped[1]:.6g} m before the scan at {scans.t[here.rows][jumped[0]]} s, "
            f'expected at most {FARTHEST:g} m; [laser] odometry = "none" goes by the scans alone.'
        )
    notes: dict[str, Any] = {
        "source": path.name.encode("utf-8", "replace").decode(),
        "time": SNAPSHOT,
        "topics": {"scan": topic.name, "odometry": "none" if here.poses is None or read is None else read.source},
    }
    if topic.type == ECHOES:
        notes["echo"] = FIRST
    prior = robot.prior or assumed(None if here.poses is None else here.poses[0])
    name = robot.name or path.name.partition(".")[0]
    recording = LaserRecording(name, scanner, scans.t, ranges, None, prior, notes, fans=None if alike else fans)
    return replace(recording.taken(here.rows), odometry=here.poses), remarks


def _scans(bag: Bag, topic: Topic, remarks: list[str]) -> Scans:
    """All scans of a topic; `remarks` grows by what is odd."""
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
        taken.append(Swept(number, stamp, message.received, middle, fan, np.asarray(ranges, float)))
    if unreadable == number:
        raise InputError(f"{bag.path}: none of the {number} messages of topic {topic.name} can be read.")
    if empty + unreadable == number:
        raise InputError(f"{bag.path}: all {empty} scans of topic {topic.name} are empty, expected ranges.")
    usual = USUAL * float(np.median([one.fan.beams for one in taken])) if taken else 0
    wrong = {
        row: f"has {one.fan.beams} beams, expected at most {usual:.0f}, {USUAL} times the median"
        for row, one in enumerate(taken)
        if one.fan.beams > usual
    } | astray([one.stamp for one in taken], [one.received for one in taken])
    for row, why in wrong.items():
        left_out.add(taken[row].number, why)
    remarks += left_out.remarks(number - empty - unreadable)
    taken = [one for row, one in enumerate(taken) if row not in wrong]
    check_clock(bag, topic, [one.number for one in taken], [one.stamp for one in taken])
    some = [one for one in taken if not np.isnan(one.ranges).all()]
    if some:  # else the ranges are refused
        empty, taken = empty + len(taken) - len(some), some
    taken.sort(key=lambda one: one.middle)
    kept = taken[:1]
    for one in taken[1:]:
        if one.middle - kept[-1].middle > APART:
            kept.append(one)
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
    ranges, fans = [one.ranges for one in kept], [one.fan for one in kept]
    return Scans(t, ranges, fans, stated, example.header.frame_id)


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

"""Reads sensor_msgs/LaserScan and odometry of a ROS bag for the laser front end.

Of MultiEchoLaserScan, which is read where a bag has no LaserScan or robot.toml names it, the first echo counts.
The front end takes a scan as a snapshot. Its stamp is that of its first beam, so the scan counts as taken in the middle
of its sweep, (n - 1) / 2 of `time_increment` later; single beams are not moved to where the robot was. The odometry, of
nav_msgs/Odometry or else of tf, is interpolated to that time.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...frontend.laser.recording import FARTHEST, LaserRecording, jump
from ...frontend.laser.scanner import CODES, Fan, Scanner, padded, spread, without_codes
from ..bags.bag import Bag
from ..bags.topics import choose, found, plain
from ..bags.transforms import Transforms
from ..prior import assumed
from .mounted import placed
from .odometry import Covered, covered, read_odometry
from .robot import LaserRobot
from .scan_messages import ECHOES, SCAN, is_like, read_messages

FIRST = "of several echoes of a beam, the first"

SNAPSHOT = "a scan counts as taken at once, in the middle of its sweep; its beams are not corrected for the motion"


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
    scans = read_messages(bag, topic, remarks)
    scans = scans._replace(t=scans.t + robot.time_offset) if robot.time_offset else scans
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

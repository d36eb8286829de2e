"""A short drive on the made-up floor as bags and CARMEN logs: the same numbers in all of them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import bags
from slamduel.core.se2 import Array
from slamduel.datasets.worlds import laser_floor
from slamduel.frontend.laser.recording import LaserRecording

NS = 10**9
BEGIN = 100
"""s, of the first scan."""

STEP = np.float32(np.pi / 180)
"""rad between beams, as a scan's message has it."""

LASER_ON_BASE = bags.Transform("base_link", "laser", (0.0, 0.0, 0.3))


def floor_drive(laps: float = 0.12, seed: int = 0) -> LaserRecording:
    """A drive whose ranges are those of messages: single precision, and none at all in place of 81.83 m."""
    recording, _ = laser_floor.record(laser_floor.Options(laps=laps, people=0), np.random.default_rng(seed))
    return recording


def stamps(drive: LaserRecording) -> list[int]:
    """ns, of the scans."""
    return [BEGIN * NS + round(t * NS) for t in drive.t.tolist()]


def turned(heading: float) -> tuple[float, float, float, float]:
    """The quaternion of a heading."""
    return 0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2))


def scans(drive: LaserRecording, **changes: Any) -> list[bags.Said]:
    """One message per scan."""
    numbers: dict[str, Any] = {"angle_increment": STEP} | changes
    return [bags.scan(stamp, ranges, **numbers) for stamp, ranges in zip(stamps(drive), drive.ranges, strict=True)]


def odometry(drive: LaserRecording, **changes: Any) -> list[bags.Said]:
    """One message of nav_msgs/Odometry per scan, at its time."""
    return [
        bags.odometry(stamp, x, y, turned(heading), **changes)
        for stamp, (x, y, heading) in zip(stamps(drive), drive.odometry.tolist(), strict=True)
    ]


def by_tf(drive: LaserRecording, parent: str = "odom", child: str = "base_link") -> list[bags.Said]:
    """One message of tf per scan, at its time."""
    return [
        bags.transforms(stamp, bags.Transform(parent, child, (x, y, 0.0), turned(heading)))
        for stamp, (x, y, heading) in zip(stamps(drive), drive.odometry.tolist(), strict=True)
    ]


def mounting(*given: bags.Transform) -> list[bags.Said]:
    """The message of tf_static."""
    return [bags.transforms(BEGIN * NS, *(given or (LASER_ON_BASE,)), topic="/tf_static")]


def bag(folder: Path, kind: str, *streams: Sequence[bags.Said]) -> Path:
    """Writes the streams into a new folder, in the order of their stamps."""
    folder.mkdir(parents=True)
    return bags.write(folder, kind, sorted((one for stream in streams for one in stream), key=lambda one: one.stamp))


def carmen(path: Path, drive: LaserRecording, change: Callable[[Array], Array] = lambda ranges: ranges) -> Path:
    """Writes a log of ROBOTLASER1 lines with the numbers that messages have."""
    start, step = (repr(float(angle)) for angle in (np.float32(-np.pi / 2), STEP))
    lines = list[str]()
    for stamp, ranges, pose in zip(stamps(drive), drive.ranges, drive.odometry.tolist(), strict=True):
        words = " ".join(repr(float(r)) for r in np.asarray(change(ranges), np.float32))
        place = " ".join(map(repr, pose))
        t = f"{stamp // NS}.{stamp % NS:09d}"
        lines.append(
            f"ROBOTLASER1 0 {start} 3.14 {step} 81.9 0.01 0 {len(ranges)} {words} 0 {place} {place} 0 0 0 0 0 "
            f"{t} host {t}"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join((*lines, "")))
    return path

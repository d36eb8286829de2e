"""The laser scanner of the rendered robot, as an option of its room: scans of the walls, and of boxes on the floor.

The scanner is level and sees a plane below the tops of all boxes. All that it says has few binary digits: files and
messages, whose ranges are single precision, have the same numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...core.elementary import sincos
from ...core.factors import Prior
from ...core.options import option
from ...core.se2 import Array, compose
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.scanner import Scanner
from ._casting import cast
from .people import People, standing_on_floor
from .room import Room

PLACE = np.array([0.125, 0.0, 0.0])  # m, m, rad, of the scanner on the robot
BEAMS, STEP = 201, 1 / 64  # over 179 degrees; rad
RANGE_SD, LOST = 0.015, 0.02  # m; share of beams without a return
RESOLUTION = 1 / 256  # m
LEAST, FARTHEST = 0.125, 25.0  # m, of a return
LATER = 0.05  # s of the first scan after the first frame: the sensors are not triggered together


@dataclass(frozen=True)
class RoomScans:
    """A laser scanner beside the camera, by default none; a rendered world's options inherit it."""

    sensors: str = option(
        "both",
        "whose measurements the log has, of a robot with a scanner or depth; both: all that there are",
        choices=("both", "markers", "laser"),
    )
    scan_rate: float = option(
        0.0, "scans per second of a laser scanner, whose log is then one of markers and scans; 0: none",
        minimum=0.0, maximum=40.0,
    )  # fmt: skip

    def scan_times(self, end: float) -> Array:
        """The times (n,) of the scans up to `end`, s."""
        if not self.scan_rate:
            return np.zeros(0)
        t = LATER + np.arange(int(end * self.scan_rate) + 1) / self.scan_rate
        return t[t <= end]


def scanned(
    room: Room, drive: Callable[[Array], Array], people: People, t: Array, rng: np.random.Generator
) -> LaserRecording:
    """The scans at `t` (n,), s, without odometry, of a robot whose true poses `drive` gives, among `people`."""
    walls, poses = room.outlines, drive(t)
    angles = STEP * (np.arange(BEAMS, dtype=np.float64) - BEAMS // 2)
    ranges = np.empty((len(t), BEAMS))
    for k, (x, y, heading) in enumerate(compose(poses, PLACE).tolist()):
        s, c = sincos(heading + angles)
        ranges[k] = cast(walls, standing_on_floor(people(float(t[k]))), x, y, np.stack((c, s), -1), FARTHEST)
    seeing, losing = rng.spawn(2)
    ranges = RESOLUTION * np.round((ranges + RANGE_SD * seeing.standard_normal(ranges.shape)) / RESOLUTION)
    ranges[(losing.random(ranges.shape) < LOST) | (ranges >= FARTHEST)] = np.inf
    return LaserRecording("aruco-room", Scanner(angles, PLACE), t, ranges, None, Prior(poses[0], np.eye(3)))

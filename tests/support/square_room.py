"""Laser scans of a square room, whose walls are known."""

from typing import Any

import numpy as np

from slamduel.core.factors import Prior
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.laser.scanner import Scanner


def square_room() -> LaserRecording:
    """Nine scans from the middle of a room of 4 m by 2 m, one turned."""
    angles = np.linspace(-np.pi, np.pi, 721)[:-1]
    heading = np.zeros(9)
    heading[4] = 0.5
    poses = np.column_stack((np.linspace(-0.5, 0.5, 9), np.zeros(9), heading))
    ranges = list[Any]()
    for x, y, turn in poses:
        c, s = np.cos(angles + turn), np.sin(angles + turn)
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges.append(np.fmin((np.sign(c) * 2 - x) / c, (np.sign(s) - y) / s))
    scanner = Scanner(angles, np.zeros(3), 0.1, 10.0)
    return LaserRecording("room", scanner, np.arange(9.0), np.array(ranges), poses, Prior(poses[0], 1e-6 * np.eye(3)))

"""A laser scanner: the directions of its beams, where it sits on the robot, and which ranges are returns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.beside import returns
from ...core.se2 import Array
from ..maps._grid import thinned

CODES = (81.825, 81.915)  # m; a SICK scanner says 81.83 to 81.91 where it has no return


@dataclass(frozen=True, eq=False)
class Scanner:
    """The properties that all scans share."""

    angles: Array  # (b,) rad, counter-clockwise from straight ahead; of the first scan where they vary
    pose: Array  # (3,) of the scanner on the robot
    least: float = 0.15  # m; nearer returns are of the robot itself
    most: float = 25.0  # m; what is farther says nothing, not even that the way is free

    @property
    def farthest(self) -> float:
        """m from the robot's origin to a point at most."""
        return self.most + float(np.hypot(self.pose[0], self.pose[1]))

    def points(self, ranges: Array, angles: Array | None = None) -> Array:
        """The returns among `ranges` (b,), m, as points (k, 2) in the robot's frame, in the order of the beams.

        `angles` (b,) are those of this scan, where they vary.
        """
        valid = (ranges > self.least) & (ranges < self.most)  # false for NaN, too
        return returns(ranges, self.angles if angles is None else angles, self.pose, valid)


class Fan(NamedTuple):
    """The beams of a scan, evenly apart."""

    beams: int
    first: float  # rad
    step: float  # rad, below 0 for beams that go clockwise

    @property
    def last(self) -> float:
        """The direction of the last beam, rad."""
        return self.first + (self.beams - 1) * self.step

    def angles(self, count: int) -> Array:
        """The directions (count,) of its beams, rad, and of more at the same steps."""
        return self.first + self.step * np.arange(count, dtype=np.float64)


def padded(rows: Sequence[Array]) -> Array:
    """The ranges (n, b), m, of scans of different numbers of beams, b the most: NaN where a scan has no beam."""
    out = np.full((len(rows), max(map(len, rows))), np.nan)
    for row, ranges in zip(out, rows, strict=True):
        row[: len(ranges)] = ranges
    return out


def spread(fans: Sequence[Fan]) -> str:
    """The remark on scans of different beams: their numbers or, where these are alike, their directions."""

    def told(values: Sequence[float], form: str) -> str:
        least, most = (format(bound(values), form) for bound in (min, max))
        return least if least == most else f"{least} to {most}"

    beams = told([fan.beams for fan in fans], "d")
    if " to " in beams:
        return f"its scans have {beams} beams: each counts at its own angles"
    first, step = told([fan.first for fan in fans], ".5g"), told([fan.step for fan in fans], ".5g")
    return f"the beams of its scans begin at {first} rad, in steps of {step}: each counts at its own angles"


class Scan:
    """The points of a scan in the robot's frame: all of them (k, 2), and those that are matched."""

    def __init__(self, points: Array, spacing: float) -> None:
        self.points = points
        self.few = np.ascontiguousarray(points[thinned(points, spacing)])


def evenly(beams: int) -> Array:
    """The angles (b,) of a scanner over half a circle as CARMEN logs it.

    180 or 360 beams start at -90 degrees and stop a step before +90; an odd number takes in both ends.
    """
    if beams % 2:
        return np.linspace(-np.pi / 2, np.pi / 2, beams, dtype=np.float64)
    return -np.pi / 2 + np.pi / beams * np.arange(beams, dtype=np.float64)


def without_codes(ranges: Array) -> Array:
    """The ranges, m, with NaN for those by which a SICK scanner says that there is no return."""
    return np.where((ranges > CODES[0]) & (ranges < CODES[1]), np.nan, ranges)

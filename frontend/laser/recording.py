"""A recording of laser scans with odometry, and the way of a front end through it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...core.factors import Prior, Start
from ...core.se2 import Array, between, compose
from ..maps.occupancy import Occupancy
from .anchors import anchors
from .front_end import FrontEnd
from .localising import Localiser
from .scanner import Scanner
from .settings import Settings

FARTHEST = 50.0  # m between two scans; the map of the last metres could not hold more


@dataclass(frozen=True, eq=False)
class LaserRecording:
    """Scans in the order of time."""

    name: str
    scanner: Scanner
    t: Array  # (n,) s, strictly increasing
    ranges: Array  # (n, b) m; NaN, infinite or beyond the scanner's limits where there is no return
    odometry: Array | None  # (n, 3) the wheels' pose at each scan; None without wheels
    prior: Prior
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])  # the source and what its reader has done
    map: Occupancy | None = None  # the drive is localised on it; the prior's pose is then one on the map
    start: Start = "known"  # unknown: the robot may be anywhere on the map

    def scans(self) -> Iterator[tuple[float, Array | None, Array]]:
        """Time (s), the wheels' motion since the scan before (3,), if it is known, and ranges (b,) of each scan."""
        motions: Any = [None] * len(self.t)
        if self.odometry is not None:
            motions[1:] = between(self.odometry[:-1], self.odometry[1:])
        return zip(self.t.tolist(), motions, self.ranges, strict=True)


def jump(odometry: Array) -> tuple[int, float] | None:
    """The row of `odometry` (n, 3) farthest from the one before it and how far, m, if the front end cannot bear it."""
    way = np.hypot(*np.diff(odometry[:, :2], axis=0).T)
    at = int(way.argmax())
    return None if way[at] <= FARTHEST else (at + 1, float(way[at]))


def matched(
    recording: LaserRecording, settings: Settings, observe: Callable[[FrontEnd], None] | None = None
) -> FrontEnd:
    """Takes a front end through all scans; `observe` is called after every one."""
    localiser = None
    if recording.map is not None:
        start = (recording.prior.pose, recording.prior.cov) if recording.start == "known" else None
        localiser = Localiser(recording.map, recording.scanner, settings, start)
    front_end = FrontEnd(recording.scanner, settings, recording.odometry is not None, localiser)
    for t, motion, ranges in recording.scans():
        front_end.scan(t, motion, ranges)
        if observe is not None:
            observe(front_end)
    front_end.finish()
    return front_end


def placed(recording: LaserRecording, front_end: FrontEnd) -> Array:
    """The front end's own estimate (n, 3) of every scan, from the prior's pose on."""
    path = anchors(front_end, recording.t).anchors.along(front_end.estimate)
    return compose(recording.prior.pose, between(path[0], path))

"""A recording of laser scans with odometry, and the way of a front end through it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Prior, Start
from ...core.se2 import Array, between, compose
from ..maps.occupancy import Occupancy
from .anchors import anchors
from .front_end import FrontEnd
from .localising import Localiser
from .scanner import Fan, Scanner
from .settings import Settings

FARTHEST = 50.0  # m between two scans; the map of the last metres could not hold more


class Taken(NamedTuple):
    """A scan as the front end takes it."""

    t: float  # s
    motion: Array | None  # (3,) the wheels' since the scan before, if it is known
    ranges: Array  # (b,) m
    angles: Array | None  # (b,) rad, where they vary; None: the scanner's


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
    fans: Sequence[Fan] | None = None  # of each scan, where they differ; None: the scanner's

    def scans(self) -> Iterator[Taken]:
        """Every scan, with its own angles where these vary."""
        motions: Any = [None] * len(self.t)
        if self.odometry is not None:
            motions[1:] = between(self.odometry[:-1], self.odometry[1:])
        for k, (t, motion) in enumerate(zip(self.t.tolist(), motions, strict=True)):
            yield Taken(t, motion, self.ranges[k], self.angles(k))

    def angles(self, k: int) -> Array | None:
        """The directions (b,) of scan k's beams, rad, where they vary; None: the scanner's."""
        return None if self.fans is None else self.fans[k].angles(self.ranges.shape[1])

    def points(self, k: int) -> Array:
        """The returns of scan k as points (m, 2) in the robot's frame."""
        return self.scanner.points(self.ranges[k], self.angles(k))

    @property
    def beams(self) -> tuple[int, int]:
        """The least and the largest number of beams of a scan."""
        counts = [len(self.scanner.angles)] if self.fans is None else [fan.beams for fan in self.fans]
        return min(counts), max(counts)

    def taken(self, rows: NDArray[np.bool_]) -> "LaserRecording":
        """Some of its scans."""
        return replace(
            self,
            t=self.t[rows],
            ranges=self.ranges[rows],
            odometry=None if self.odometry is None else self.odometry[rows],
            fans=None if self.fans is None else list(compress(self.fans, rows.tolist())),
        )


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
    for scan in recording.scans():
        front_end.scan(*scan)
        if observe is not None:
            observe(front_end)
    front_end.finish()
    return front_end


def placed(recording: LaserRecording, front_end: FrontEnd) -> Array:
    """The front end's own estimate (n, 3) of every scan, from the prior's pose on."""
    path = anchors(front_end, recording.t).anchors.along(front_end.estimate)
    return compose(recording.prior.pose, between(path[0], path))

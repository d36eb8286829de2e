"""Measures the laser front end: CPU time of a scan and of a search, and errors beside what is stated of them."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Truth
from ...core.se2 import Array, between
from ...datasets.formats import carmen
from ...datasets.published.catalogue import place
from ...datasets.published.installed import here
from ...datasets.published.laser_logs import log_file
from ...datasets.worlds.laser_floor import Options, record
from ...frontend.laser._search import Search
from ...frontend.laser.estimate import ScanStep, StepPoses
from ...frontend.laser.front_end import FrontEnd
from ...frontend.laser.loops import ScanLoop, cloud, search_of
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.scanner import Scan
from ...frontend.laser.settings import Settings
from ...frontend.laser.submap import Submap
from ...frontend.laser.tracking import Placed, Tracker
from .consistency import Consistency, errors, gathered
from .laser_references import icp, tried

PARTS = ("match", "insert", "loop search", "optimise")

NAMED = "intel-lab"  # the published log that is timed where it was fetched
BETWEEN = 20  # scans between two that the reference aligns


class LaserExtent(NamedTuple):
    """The extent of the study."""

    drives: int  # on made-up floors, one each
    laps: float
    scans: int  # of a recorded log, at most
    searches: int
    exhaustive: int  # of those, as many as the reference makes, too


QUICK, FULL = LaserExtent(1, 1.3, 2_000, 6, 1), LaserExtent(3, 2.0, 100_000, 60, 8)


class ScanCost(NamedTuple):
    """ms of CPU that the scans of a log take."""

    log: str
    scans: int
    median: float
    mean: float
    p99: float
    parts: tuple[float, ...]  # means of PARTS
    icp: float  # the reference's median, of one pair of scans


class SearchCost(NamedTuple):
    """ms of CPU that searches of a window take."""

    searches: int
    window: float  # m
    turn: float  # rad
    poses: int  # in the window, the median
    median: float
    p99: float
    exhaustive: float  # the reference's median
    ratio: float  # the median of reference by search, of the same searches
    compared: int  # searches that the reference made, too
    same: int  # of those, with the same score


class _TimedEstimate(StepPoses):
    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.ns = 0

    def _move(
        self, first: int, steps: Sequence[ScanStep], loops: Sequence[ScanLoop], iterations: int, far: bool = False
    ) -> None:
        start = time.thread_time_ns()
        super()._move(first, steps, loops, iterations, far)
        self.ns += time.thread_time_ns() - start


class _TimedTracker(Tracker):
    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.ns = 0

    def take(self, t: float, motion: Array | None, scan: Scan, submap: Submap) -> list[Placed]:
        start = time.thread_time_ns()
        placed = super().take(t, motion, scan, submap)
        self.ns += time.thread_time_ns() - start
        return placed


class Timed(FrontEnd):
    """A front end with the ns of CPU that its parts took."""

    def __init__(self, recording: LaserRecording, settings: Settings) -> None:
        super().__init__(recording.scanner, settings, recording.odometry is not None)
        self.ns: dict[str, int] = dict.fromkeys(PARTS, 0)
        self.scan_ns: list[int] = []  # of each scan
        self._estimate = self._moving = _TimedEstimate(settings)
        self.tracker = self._matching = _TimedTracker(settings)

    def drive(self, recording: LaserRecording, progress: Callable[[], None]) -> None:
        """Takes all scans."""
        for one in recording.scans():
            start = time.thread_time_ns()
            self.scan(*one)
            self.scan_ns.append(time.thread_time_ns() - start)
            progress()
        self.ns["match"] = self._matching.ns
        self.ns["optimise"] = self._moving.ns  # without the last one, which no scan waits for
        self.finish()

    def _draw(self, pose: Array, scan: Scan) -> None:
        self._timed("insert", super()._draw, pose, scan)

    def _close(self, k: int, scan: Scan) -> None:
        moving = self._moving.ns
        self._timed("loop search", super()._close, k, scan)
        self.ns["loop search"] -= self._moving.ns - moving

    def _timed(self, part: str, do: Callable[..., Any], *given: Any) -> Any:
        start = time.thread_time_ns()
        found = do(*given)
        self.ns[part] += time.thread_time_ns() - start
        return found


class LaserDrive(NamedTuple):
    """A recording and its front end, at the end."""

    recording: LaserRecording
    front_end: Timed
    truth: Truth | None


@dataclass(frozen=True, eq=False)
class LaserStudy:
    """Drives on made-up floors, and a recorded log."""

    seed: int = 0
    extent: LaserExtent = FULL
    log: Path | None = None  # in CARMEN's format; None: NAMED, if it was fetched

    def warm_up(self) -> None:
        """Loads all kernels, on a short drive that closes loops."""
        _driven(*record(Options(laps=1.2, people=0), self._rng(2)), lambda: None)

    def drives(self, progress: Callable[[], None]) -> list[LaserDrive]:
        """Takes the front end over the made-up floors."""
        options = Options(laps=self.extent.laps)
        return [_driven(*record(options, self._rng(0, number)), progress) for number in range(self.extent.drives)]

    def recorded(self, progress: Callable[[], None]) -> LaserDrive | None:
        """Takes it over the recorded log; None where there is none."""
        path = self.recorded_log
        if path is None:
            return None
        recording, _ = carmen.read(path, carmen.Options())
        n = self.extent.scans
        return _driven(recording.taken(np.arange(len(recording.t)) < n), None, progress)

    @cached_property
    def recorded_log(self) -> Path | None:
        """The recorded log's file, if there is one."""
        return self.log or (place(NAMED) / log_file(NAMED) if here(NAMED) else None)

    def searches(self, drives: Sequence[LaserDrive], progress: Callable[[], None]) -> SearchCost:
        """Times searches of the largest window for steps of a drive, in submaps of the same place."""
        spent, others, ratios, poses, same = list[float](), list[float](), list[float](), list[int](), 0
        for number in range(self.extent.searches):
            submap, search = search_case(drives[number % len(drives)], self._rng(1, number))
            submap.pyramid  # noqa: B018 - made before the clock starts
            start = time.thread_time_ns()
            _, score = submap.best(search, submap.settings.score)
            spent.append(1e-6 * (time.thread_time_ns() - start))
            poses.append(_poses(search, submap.settings.cell))
            if number < self.extent.exhaustive:
                start = time.thread_time_ns()
                best = tried(search, submap)
                others.append(1e-6 * (time.thread_time_ns() - start))
                ratios.append(others[-1] / spent[-1])
                same += score == (best if best > submap.settings.score else 0.0)
            progress()
        s = Settings()
        return SearchCost(
            len(spent), s.window, s.turn_window, int(np.median(poses)), float(np.median(spent)),
            float(np.percentile(spent, 99)), float(np.median(others)), float(np.median(ratios)), len(others), same,
        )  # fmt: skip

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *stream])


def scan_cost(drives: Sequence[LaserDrive], progress: Callable[[], None]) -> ScanCost:
    """Summarises the CPU time of all scans of some drives, and times the reference on pairs of them."""
    ms = np.concatenate([1e-6 * np.array(one.front_end.scan_ns) for one in drives])
    parts = tuple(1e-6 * sum(one.front_end.ns[part] for one in drives) / len(ms) for part in PARTS)
    theirs = list[float]()
    for one in drives:
        points = [_scan(one, k).few for k in range(0, len(one.recording.t) - 1, BETWEEN)]
        after = [_scan(one, k + 1).few for k in range(0, len(one.recording.t) - 1, BETWEEN)]
        for before, now in zip(points, after, strict=True):
            if len(before) and len(now):
                start = time.thread_time_ns()
                icp(before, now)
                theirs.append(1e-6 * (time.thread_time_ns() - start))
        progress()
    name = drives[0].recording.name
    median, p99 = np.percentile(ms, (50, 99)).tolist()
    return ScanCost(name, len(ms), median, float(ms.mean()), p99, parts, float(np.median(theirs)))


def consistency(drives: Sequence[LaserDrive]) -> list[Consistency]:
    """Compares the errors of steps and loops with their covariances."""
    steps, loops = list[tuple[Array, Array]](), list[tuple[Array, Array]]()
    for drive in drives:
        assert drive.truth is not None
        made, closed = drive.front_end.steps, drive.front_end.loops
        true = drive.truth.poses[[step.scan for step in made]]
        cov = np.array([step.cov for step in made[1:]])
        steps.append((errors(np.array([step.delta for step in made[1:]]), true[:-1], true[1:]), cov))
        if closed:
            to, at = ([getattr(loop, end) for loop in closed] for end in ("to", "step"))
            off = errors(np.array([loop.delta for loop in closed]), true[to], true[at])
            loops.append((off, np.array([loop.cov for loop in closed])))
    return [*gathered("step", steps), *gathered("loop", loops)]


def _driven(recording: LaserRecording, truth: Truth | None, progress: Callable[[], None]) -> LaserDrive:
    front_end = Timed(recording, Settings() if truth is None else Settings(stamp_sd=Options().stamp_sd))
    front_end.drive(recording, progress)
    return LaserDrive(recording, front_end, truth)


def _scan(drive: LaserDrive, k: int) -> Scan:
    front_end, recording = drive.front_end, drive.recording
    return Scan(recording.points(k), front_end.settings.spacing)


def search_case(drive: LaserDrive, rng: np.random.Generator) -> tuple[Submap, Search]:
    """A step that was drawn into a finished submap, to be searched for there from anywhere in the window."""
    front_end, s = drive.front_end, drive.front_end.settings
    submap = front_end.finished.kept[rng.integers(len(front_end.finished.kept))]
    step = front_end.steps[submap.steps[rng.integers(len(submap.steps))]]
    path, last = front_end.path, step.scan
    drawn = [last]
    while len(drawn) < s.cloud and last > 0:  # the last scans that were drawn
        last -= 1
        off = between(path[drawn[-1]], path[last])
        if np.hypot(off[0], off[1]) > s.insert_step or abs(off[2]) > s.insert_turn:
            drawn.append(last)
    seen = cloud(step.pose, [path[k] for k in drawn], [_scan(drive, k) for k in drawn], s.cloud_cell)
    share = rng.uniform(-0.5, 0.5, 3)
    return submap, search_of(seen, step.pose + share * (s.window, s.window, s.turn_window), s.window, s.turn_window, s)


def _poses(search: Search, cell: float) -> int:
    return int((2 * np.ceil(search.turn / search.turn_step) + 1) * (2 * np.ceil(search.window / cell) + 1) ** 2)

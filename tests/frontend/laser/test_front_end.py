"""The laser front end on made-up floors, whose truth is known."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from motions import chained
from refusals import refused
from slamduel.core.factors import Log, Truth
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.laser import scanner, tracking
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.log import build_log, log_of
from slamduel.frontend.laser.loops import ScanLoop, Surprises, contradicted
from slamduel.frontend.laser.pose_graph import Edges, optimised
from slamduel.frontend.laser.recording import LaserRecording, matched, placed
from slamduel.frontend.laser.scanner import Scanner, evenly
from slamduel.frontend.laser.settings import Settings


class Driven:
    """A drive, its log, and its errors against the truth."""

    def __init__(self, seed: int, **options: Any) -> None:
        chosen = Options(**options)
        recording, truth = record(chosen, np.random.default_rng(seed))
        self.front_end: FrontEnd | None = None
        self.recording, self.truth = recording, truth
        self.log: Log = log_of(recording, matched(recording, chosen, self._look))
        self.poses = truth.poses[np.searchsorted(truth.t, self.log.t)]
        self.at = np.repeat(np.arange(len(self.log)), np.diff(self.log.loop_first))

    def _look(self, front_end: FrontEnd) -> None:
        self.front_end = front_end

    def step_errors(self) -> Array:
        return _off(self.log.delta[1:], between(self.poses[:-1], self.poses[1:]))

    def loop_errors(self) -> Array:
        return _off(self.log.loop_delta, between(self.poses[self.log.loop_to], self.poses[self.at]))

    def revisits(self) -> tuple[int, int]:
        """Steps that come within 1 m and 0.8 rad of one more than 25 m of path ago; those of them that have a loop."""
        way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(self.poses[:, :2], axis=0).T))))
        near = np.hypot(*(self.poses[:, None, :2] - self.poses[None, :, :2]).transpose(2, 0, 1)) < 1.0
        alike = np.abs(wrap(self.poses[:, None, 2] - self.poses[None, :, 2])) < 0.8
        again = (near & alike & (way[:, None] - way[None] > 25)).any(axis=1)
        return int(again.sum()), int(np.isin(np.flatnonzero(again), self.at).sum())


def _off(found: Array, true: Array) -> Array:
    off = found - true
    off[:, 2] = wrap(off[:, 2])
    return off


def nees(errors: Array, cov: Array) -> float:
    return float(np.einsum("ni,nij,nj->n", errors, np.linalg.inv(cov), errors).mean() / 3)


@cache
def lap(people: int = 0) -> Driven:
    return Driven(0, laps=1.4, people=people)


def test_a_step_is_as_good_as_it_is_stated_and_no_loop_is_false() -> None:
    drive = lap()
    assert 0.5 < nees(drive.step_errors(), drive.log.delta_cov[1:]) < 2
    errors = drive.loop_errors()
    assert len(errors) > 100
    assert 0.5 < nees(errors, drive.log.loop_cov) < 2
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.2
    assert np.abs(errors[:, 2]).max() < np.radians(1)
    again, found = drive.revisits()
    assert found >= 0.9 * again > 20


def test_its_own_estimate_is_far_closer_than_the_wheels() -> None:
    drive = lap()
    assert drive.front_end is not None
    truth, wheels = drive.truth.poses, drive.recording.odometry
    assert wheels is not None
    own = placed(drive.recording, drive.front_end)
    off, theirs = np.hypot(*(own - truth)[:, :2].T), np.hypot(*(wheels - truth)[:, :2].T)
    assert np.sqrt((off**2).mean()) < 0.06
    assert np.sqrt((theirs**2).mean()) > 5 * np.sqrt((off**2).mean())


@pytest.mark.slow
@pytest.mark.parametrize("people", [0, 4, 12])
def test_on_nine_drives_no_loop_is_false(people: int) -> None:
    drives = [Driven(seed, people=people) for seed in range(3)]
    again, found = (sum(both) for both in zip(*(drive.revisits() for drive in drives), strict=True))
    assert found >= (0.9 if people < 12 else 0.75) * again
    for drive in drives:
        errors = drive.loop_errors()
        assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.2
        assert np.abs(errors[:, 2]).max() < np.radians(1)
        assert 0.5 < nees(drive.step_errors(), drive.log.delta_cov[1:]) < 2
        assert 0.5 < nees(errors, drive.log.loop_cov) < 2


def test_without_wheels_it_goes_by_scans_alone() -> None:
    drive = Driven(1, laps=0.25, people=0)
    log = build_log(replace(drive.recording, odometry=None), Settings())
    errors = _off(log.delta[1:], between(*_ends(log, drive.truth)))
    assert np.sqrt((errors[:, :2] ** 2).mean()) < 0.02
    assert log.notes["laser"]["wheels"] is False


def _ends(log: Log, truth: Truth) -> tuple[Array, Array]:
    poses = truth.poses[np.searchsorted(truth.t, log.t)]
    return poses[:-1], poses[1:]


def test_wheels_that_jump_are_caught_by_a_search() -> None:
    """The odometry says that the robot turned by half a radian while it drove straight on."""
    drive = Driven(2, laps=0.2, people=0)
    motion = between(drive.recording.odometry[:-1], drive.recording.odometry[1:])
    motion[60, 2] += 0.5
    found: list[FrontEnd] = []
    recording = replace(drive.recording, odometry=chained(motion, drive.recording.odometry[0]))
    log = log_of(recording, matched(recording, Settings(), found.append))
    errors = _off(log.delta[1:], between(*_ends(log, drive.truth)))
    assert np.abs(errors[:, 2]).max() < 0.03
    assert found[-1].tracker.lost > 0


@pytest.mark.parametrize("seed", range(5))
def test_loops_that_the_others_contradict_are_told(seed: int) -> None:
    """Around a square, all true but two: their squared distance is chi-squared with three degrees of freedom."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, 41)
    poses = np.stack((5 * np.cos(angle), 5 * np.sin(angle), wrap(angle + np.pi / 2)), axis=-1)
    sd = np.array([0.02, 0.01, 0.005])
    loops = list[ScanLoop]()
    for step in range(20, 41):
        delta = between(poses[step - 20], poses[step]) + sd * rng.uniform(-1, 1, 3)
        loops.append(ScanLoop(step - 20, step, delta, np.diag(sd**2), 0.9))
    for number, off in ((4, (0.0, 0.046, 0.0)), (11, (0.0, 0.0, 0.023 + 2 * np.pi))):
        loops[number] = loops[number]._replace(delta=between(poses[number], poses[number + 20]) + off)
    assert np.flatnonzero(contradicted(loops, poses)).tolist() == [4, 11]
    # 4.58 sd; 4.59 are too many
    loops[4] = loops[4]._replace(delta=between(poses[4], poses[24]) + 0.0458 * np.array([0, 1, 0]))
    assert np.flatnonzero(contradicted(loops, poses)).tolist() == [11]


def first(scans: int, seed: int, **options: Any) -> tuple[LaserRecording, Array]:
    """The first scans of the log with that seed, and their true poses."""
    recording, truth = record(Options(**options), generator("laser-floor", seed))
    odometry = None if recording.odometry is None else recording.odometry[:scans]
    return replace(recording, t=recording.t[:scans], ranges=recording.ranges[:scans], odometry=odometry), truth.poses


def by_their_own_noise(points: Array, spacing: float) -> NDArray[np.bool_]:
    """The points (k, 2) that are `spacing` (m) from the last one kept, (k,)."""
    keep, last = np.zeros(len(points), np.bool_), np.full(2, np.inf)
    for k, point in enumerate(points):
        keep[k] = not ((point - last) ** 2).sum() < spacing * spacing
        last = point if keep[k] else last
    return keep


@pytest.mark.parametrize("doubted", [tracking.DOUBTED, np.inf], ids=["by a scan", "by half a metre"])
def test_somebody_who_walks_ahead_does_not_hold_the_robot_back(doubted: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the corridor, at its speed: the few points that tell how far the robot came are on that person.

    Points that are chosen by their own noise let it be held back, and the wheels notice half a metre later.
    """
    if doubted == np.inf:
        monkeypatch.setattr(scanner, "thinned", by_their_own_noise)
    monkeypatch.setattr(tracking, "DOUBTED", doubted)
    monkeypatch.setattr(tracking, "DROP", tracking.DROP if doubted < np.inf else 1.0)
    recording, true = first(60, 1003, laps=3)
    front_end = matched(recording, Settings())
    off = between(between(true[0], true[59]), front_end.path[-1])
    assert np.hypot(off[0], off[1]) < 0.1
    assert front_end.tracker.by_wheels == (doubted == np.inf)


def test_wheels_that_spin_are_not_believed() -> None:
    recording, true = first(60, 1001, laps=0.2, people=0)
    motion = between(recording.odometry[:-1], recording.odometry[1:])
    motion[30:36, 0] += 0.1  # 0.6 m, as much as the person above
    front_end = matched(replace(recording, odometry=chained(motion, recording.odometry[0])), Settings())
    off = between(between(true[0], true[59]), front_end.path[-1])
    assert np.hypot(off[0], off[1]) < 0.05
    assert front_end.tracker.by_wheels == 0


def test_a_scan_without_a_return_leaves_the_odometry() -> None:
    drive = Driven(2, laps=0.15, people=0)
    ranges = drive.recording.ranges.copy()
    ranges[20:24] = np.nan
    log = build_log(replace(drive.recording, ranges=ranges), Settings())
    errors = _off(log.delta[1:], between(*_ends(log, drive.truth)))
    assert np.abs(errors[:, :2]).max() < 0.15


def test_a_robot_that_stands_still_is_no_log() -> None:
    drive = Driven(2, laps=0.1, people=0)
    still = LaserRecording(
        "still", drive.recording.scanner, np.arange(5.0), np.repeat(drive.recording.ranges[:1], 5, axis=0),
        np.zeros((5, 3)), drive.recording.prior,
    )  # fmt: skip
    refused(r"^still: the robot moved .* m in 5 scans, expected .* one step of 0.5 m", build_log, still, Settings())


def test_a_finished_submap_keeps_no_more_than_the_floor() -> None:
    drive = lap()
    for submap in drive.front_end.finished.kept:
        assert submap.cells.base is None  # no view that keeps the whole grid
        rows, columns = submap.cells.shape[:2]
        assert rows * columns * 0.05**2 < 36.5 * 22.5 + 4 * 36.5


def test_the_graph_of_poses_finds_the_optimum_and_does_without_false_loops() -> None:
    rng = np.random.default_rng(0)
    truth = chained(np.tile([1.0, 0.0, 2 * np.pi / 30], (59, 1)))
    number = np.arange(59)
    information = np.tile(np.diag([1e4, 1e4, 1e5]), (59, 1, 1))
    delta = between(truth[:-1], truth[1:]) + rng.normal(0, [0.01, 0.01, 0.003], (59, 3))
    start = chained(delta)
    to = np.arange(0, 30)
    loops = Edges(to, to + 30, between(truth[to], truth[to + 30]), np.tile(np.eye(3) * 1e4, (30, 1, 1)))
    found = optimised(start, Edges(number, number + 1, delta, information), loops, 50)
    assert np.abs(_off(found, truth))[:, :2].max() < 0.1 < np.abs(_off(start, truth))[:, :2].max()
    loops.delta[7] += (2.0, 1.0, 0.5)
    again = optimised(start, Edges(number, number + 1, delta, information), loops, 50)
    assert np.abs(again - found).max() < 0.02
    assert (again[0] == start[0]).all() or np.abs(again[0] - start[0]).max() < 1e-6


def test_loops_that_are_far_off_move_the_graph_once_they_are_believed() -> None:
    """Each hundreds of its standard deviations off: at once Cauchy's loss leaves all of them out."""
    truth = chained(np.tile([1.0, 0.0, 2 * np.pi / 120], (119, 1)))
    number = np.arange(119)
    delta = between(truth[:-1], truth[1:]) + np.array([0.0, 0.0, 0.003])  # one standard deviation of each
    start = chained(delta)
    steps = Edges(number, number + 1, delta, np.tile(np.diag([1e4, 1e4, 1e5]), (119, 1, 1)))
    to = np.arange(4)
    loops = Edges(to, to + 114, between(truth[to], truth[to + 114]), np.tile(np.eye(3) * 1e4, (4, 1, 1)))
    at_once, gradually = (optimised(start, steps, loops, 15, far=far) for far in (False, True))
    off = [
        np.abs(between(between(truth[3], truth[117]), between(path[3], path[117])))[:2].max()
        for path in (at_once, gradually)
    ]
    assert off[0] > 1.0
    assert off[1] < 0.02


def test_a_surprise_counts_once_enough_steps_ask_for_the_same() -> None:
    settings = Settings()
    estimate = np.array([[0.5 * k, 0.0, 0.0] for k in range(60)])
    surprises = Surprises(settings)

    def loop(step: int, off: float) -> ScanLoop:
        return ScanLoop(0, step, np.add(between(estimate[0], estimate[step]), (0.0, off, 0.0)), np.eye(3), 1.0)

    assert surprises.is_expected(np.array([0.1, 0.1, 0.0]), 0.0)
    assert not surprises.is_expected(np.array([0.0, 1.0, 0.0]), 0.0)
    asked = [surprises.add(loop(40 + k, 2.0 if k != 2 else -3.0), 20 + 0.7 * k, estimate) for k in range(6)]
    assert [len(one) for one in asked] == [0, 0, 0, 0, 4, 0]
    surprises.agreed()
    assert surprises.add(loop(50, 2.0), 30.0, estimate) == []


def test_the_beams_of_a_scanner() -> None:
    assert np.allclose(np.degrees(evenly(181))[[0, 90, 180]], [-90, 0, 90])
    assert np.allclose(np.degrees(evenly(180))[[0, 90, 179]], [-90, 0, 89])
    assert np.allclose(np.degrees(evenly(360))[[0, 180, 359]], [-90, 0, 89.5])
    assert np.allclose(np.degrees(evenly(361))[[0, 180, 360]], [-90, 0, 90])
    scanner = Scanner(np.array([0.0, np.pi / 2, 0.1, 0.2, 0.3]), np.array([0.2, 0.0, np.pi / 2]), most=10.0)
    points = scanner.points(np.array([1.0, 2.0, np.nan, 81.83, 0.01]))
    assert np.abs(points - [[0.2, 1.0], [-1.8, 0.0]]).max() < 1e-12

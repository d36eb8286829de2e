"""What a front end keeps of a long log: as much as its floor has room for."""

from functools import cache

import numpy as np
import pytest

from slamduel.core.factors import Truth
from slamduel.core.se2 import Array, between, compose, wrap
from slamduel.core.small_matrices import inverse
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.laser.estimate import ScanStep, StepPoses
from slamduel.frontend.laser.finished import Finished
from slamduel.frontend.laser.front_end import FrontEnd
from slamduel.frontend.laser.loops import ScanLoop
from slamduel.frontend.laser.packed import Packed
from slamduel.frontend.laser.pose_graph import Edges, optimised
from slamduel.frontend.laser.recording import matched
from slamduel.frontend.laser.rows import FIRST, Rows
from slamduel.frontend.laser.scanner import Scan, Scanner
from slamduel.frontend.laser.settings import Settings
from slamduel.frontend.laser.submap import Submap
from slamduel.frontend.maps._grid import DX, HIT


def test_rows_are_those_appended_however_many() -> None:
    rng = np.random.default_rng(0)
    rows, given = Rows(3), rng.normal(size=(3 * FIRST + 1, 3))
    for number, row in enumerate(given, start=1):
        rows.append(row)
        assert len(rows) == number
    assert (rows.array == given).all()


@pytest.mark.parametrize("most", [3, 255, 256, 65_535, 65_536, 1_000_000])
def test_packed_cells_come_back_bit_for_bit(most: int) -> None:
    rng = np.random.default_rng(most)
    cells = np.zeros((60, 40, 4), np.float32)
    cells[:, :, :2] = np.where(rng.random((60, 40, 2)) < 0.2, rng.integers(0, most + 1, (60, 40, 2)), 0)
    cells[7, 9, :2] = most
    hit = cells[:, :, HIT] > 0
    cells[hit, DX:] = rng.random((int(hit.sum()), 2)).astype(np.float32)
    packed = Packed(cells)
    assert packed.cells().tobytes() == cells.tobytes()
    assert packed.nbytes < cells.nbytes * (0.3 if most < 256 else 0.65 if most < 65_536 else 0.9)


def test_a_submap_has_room_for_all_that_is_seen_while_it_is_drawn() -> None:
    s, scanner = Settings(), Scanner(np.array([-3.0, 0.0, 3.0]), np.array([0.2, 0.1, 0.0]), most=60.0)
    start = np.array([3.01, -7.02, 0.3])
    submap = Submap(start, s, scanner, 0.0)
    for way in np.linspace(0, 2 * s.submap_path + s.insert_step, 9):
        for heading in (0.3, 0.3 + np.pi):
            pose = np.array([start[0] + way * np.cos(heading), start[1] + way * np.sin(heading), heading])
            submap.insert(pose, Scan(scanner.points(np.full(3, 59.99)), s.spacing))
    assert submap.cells[:, :, HIT].sum() == 9 * 2 * 3


def test_a_packed_submap_is_searched_as_before() -> None:
    recording, _ = record(Options(laps=0.1, people=0), np.random.default_rng(0))
    front_end = matched(recording, Settings())
    submap = Submap(np.zeros(3), Settings(), recording.scanner, 0.0)
    for pose, ranges in zip(front_end.path, recording.ranges, strict=True):
        submap.insert(pose, Scan(recording.scanner.points(ranges), 0.04))
    submap.finish(20.0)
    cells, pyramid = submap.cells.copy(), [level.copy() for level in submap.pyramid]
    whole = submap.nbytes
    submap.pack()
    assert submap.nbytes < 0.3 * whole
    assert (submap.cells == cells).all()
    assert all((one == other).all() for one, other in zip(submap.pyramid, pyramid, strict=True))


SCANNER = Scanner(np.zeros(1), np.zeros(3), most=2.0)


def submap_of(first: int, count: int, died: float) -> Submap:
    one = Submap(np.zeros(3), Settings(), SCANNER, died - 10)
    one.steps = list(range(first, first + count))
    one.finish(died)
    return one


def rings(laps: int, one: int = 100, radius: float = 8.0) -> Array:
    """Steps (n, 3) around a ring, half a metre apart, again and again."""
    angle = 2 * np.pi * np.arange(laps * one) / one
    return np.stack((radius * np.cos(angle), radius * np.sin(angle), wrap(angle + np.pi / 2)), axis=-1)


def test_submaps_are_kept_for_the_floor_and_not_for_the_path() -> None:
    """A ring of 50 m, 12 times: its first submaps stay, and the newest, and every place is in several."""
    s, poses, kept = Settings(), rings(12), list[int]()
    finished = Finished(s)
    for number in range(len(poses) // 10 - 1):
        finished.add(submap_of(10 * number, 20, 5.0 * number + 10), poses[: 10 * number + 20])
        kept.append(len(finished.kept))
    assert finished.count == 119
    assert max(kept[70:]) <= max(kept[:70]) <= 10 * (s.newer + 5)
    firsts = [submap.steps[0] for submap in finished.kept]
    assert set(range(0, 90, 10)) <= set(firsts)
    assert set(range(1150, 1180, 10)) <= set(firsts)
    steps = np.concatenate([submap.steps for submap in finished.kept])
    for pose in poses[:100]:
        assert (np.hypot(*(poses[steps, :2] - pose[:2]).T) < s.ground).sum() > s.newer


def test_ground_seen_the_other_way_is_other_ground() -> None:
    s = Settings()
    there = rings(6)
    back = there.copy()
    back[300:, 2] = wrap(back[300:, 2] + np.pi)
    counts = list[int]()
    for poses in (there, back):
        finished = Finished(s)
        for number in range(len(poses) // 10 - 1):
            finished.add(submap_of(10 * number, 20, 5.0 * number + 10), poses[: 10 * number + 20])
        counts.append(len(finished.kept))
    assert counts[0] < counts[1] == 59


def test_the_nearest_submaps_are_found_in_order() -> None:
    s, poses, rng = Settings(), rings(3), np.random.default_rng(2)
    finished = Finished(s)
    for number in range(29):
        finished.add(submap_of(10 * number, 20, 5.0 * number + 10), poses)
    for _ in range(50):
        here, before = np.array([*rng.uniform(-20, 20, 2), 0.0]), float(rng.uniform(0, 150))
        old = [submap for submap in finished.kept if submap.died <= before]
        distances = sorted(min(float(np.hypot(*(poses[k, :2] - here[:2]))) for k in one.steps) for one in old)
        expected = [distance for distance in distances if distance < s.loop_radius][: s.loop_submaps]
        found = finished.near(here, poses, before)
        assert [one.distance for one in found] == pytest.approx(expected)
        for one in found:
            assert np.hypot(*(poses[one.step, :2] - here[:2])) == pytest.approx(one.distance)
            assert one.step in one.submap.steps
            assert one.submap.died <= before


def test_only_the_submaps_used_last_are_unpacked() -> None:
    s, poses = Settings(), rings(3)
    finished = Finished(s)
    for number in range(29):
        finished.add(submap_of(10 * number, 20, 5.0 * number + 10), poses)
    packed = [submap.nbytes for submap in finished.kept]
    for submap in [*finished.kept, *finished.kept[:3]]:
        finished.use(submap)
        assert len(submap.pyramid) > 1
    unpacked = [one for one, before in zip(finished.kept, packed, strict=True) if one.nbytes > before]
    assert set(unpacked) == {*finished.kept[:3], *finished.kept[-(s.opened - 3) :]}


def graph(laps: int) -> tuple[Array, list[ScanStep], list[ScanLoop]]:
    """A ring driven several times with noise: true poses, steps, and a loop of each to one a lap ago."""
    rng, true = np.random.default_rng(1), rings(laps)
    cov = np.diag([1e-4, 1e-4, 1e-6])

    def noisy(first: int, second: int) -> Array:
        return between(true[first], true[second]) + np.sqrt(np.diag(cov)) * rng.standard_normal(3)

    steps = [ScanStep(0.0, 0, true[0], np.zeros(3), np.zeros((3, 3)))]
    steps += [ScanStep(float(k), k, true[k], noisy(k - 1, k), cov) for k in range(1, len(true))]
    loops = [ScanLoop(k - 100, k, noisy(k - 100, k), cov, 1.0) for k in range(100, len(true))]
    return true, steps, loops


def test_the_estimate_of_the_last_steps_alone_is_nearly_that_of_all() -> None:
    """At the end it is the optimum of all, and in between no step moves that is older than the last ones."""
    true, steps, loops = graph(12)
    s = Settings()
    estimate, taken, whole, held = StepPoses(s), list[ScanLoop](), 0, 0
    estimate.append(true[0], 0)
    for k in range(1, len(steps)):
        estimate.append(compose(estimate.poses[-1], steps[k].delta), len(taken))
        taken += [loop for loop in loops if loop.step == k]
        if k % s.optimise_every == 0 and taken:
            before = estimate.poses.copy()
            estimate.correct(steps[: k + 1], taken)
            old = max(1, k + 1 - s.optimise_last)
            moved = (estimate.poses != before).any(axis=1)
            if moved[1:old].any():
                whole += 1
            elif old > 1:
                held += 1
                assert moved[old:].all()
            assert np.abs(between(true[: k + 1], estimate.poses))[:, :2].max() < 0.3
    assert whole >= 3
    assert held >= 3
    corrected = (len(steps) - 1) // s.optimise_every * s.optimise_every + 1
    lap, best = estimate.poses[:corrected].copy(), _optimum(steps, taken, true)
    off = np.abs(between(lap[:-100], lap[100:]) - between(best[: corrected - 100], best[100:corrected]))
    assert off[:, :2].max() < 0.05  # what a search for a loop starts from
    estimate.move(steps, taken, 100)
    assert np.abs(between(best, estimate.poses)).max() < 1e-3


def _optimum(steps: list[ScanStep], loops: list[ScanLoop], start: Array) -> Array:
    number = np.arange(len(steps) - 1)
    cov = inverse(np.array([step.cov for step in steps[1:]]))
    to, step, delta, loop_cov = (np.array([loop[k] for loop in loops]) for k in range(4))
    edges = Edges(number, number + 1, np.array([step.delta for step in steps[1:]]), cov)
    return optimised(start, edges, Edges(to, step, delta, inverse(loop_cov)), 100)


def test_held_poses_stay() -> None:
    true, steps, loops = graph(3)
    rng, number = np.random.default_rng(5), np.arange(len(steps) - 1)
    start = true + 0.01 * rng.standard_normal(true.shape)
    edges = Edges(
        number, number + 1, np.array([step.delta for step in steps[1:]]), np.tile(np.eye(3) * 1e4, (len(number), 1, 1))
    )
    of = Edges(
        np.array([loop.to for loop in loops]), np.array([loop.step for loop in loops]),
        np.array([loop.delta for loop in loops]), np.tile(np.eye(3) * 1e4, (len(loops), 1, 1)),
    )  # fmt: skip
    found = optimised(start, edges, of, 50, 120)
    assert np.abs(found[:120] - start[:120]).max() < 1e-3
    assert np.abs(found[120:] - start[120:]).max() > 1e-3


@cache
def laps() -> tuple[FrontEnd, Truth]:
    recording, truth = record(Options(laps=6.0, people=0), np.random.default_rng(4))
    return matched(recording, Settings()), truth


@pytest.mark.slow
def test_six_laps_of_a_floor_drop_submaps_and_keep_the_loops() -> None:
    front_end, truth = laps()
    assert len(front_end.finished.kept) < front_end.finished.count - 10
    true = truth.poses[[step.scan for step in front_end.steps]]
    to, at = ([getattr(loop, end) for loop in front_end.loops] for end in ("to", "step"))
    off = np.array([loop.delta for loop in front_end.loops]) - between(true[to], true[at])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.2
    assert np.abs(wrap(off[:, 2])).max() < np.radians(1)
    late = np.arange(len(true) // 2, len(true))
    assert np.isin(late, at).mean() > 0.8
    own = between(front_end.estimate[0], front_end.estimate)
    assert np.sqrt(((own - between(true[0], true))[:, :2] ** 2).sum(axis=1).mean()) < 0.1

"""Which loops are closed, on a made-up drive whose pairs are known beforehand."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from depth_scenes import CAMERA
from motions import chained
from slamduel.core.se2 import Array, between
from slamduel.frontend.depth.features import Features
from slamduel.frontend.depth.level import Level
from slamduel.frontend.depth.loops import Loops
from slamduel.frontend.depth.pairs import Keyframe, Pair, Pairs, Trial
from slamduel.frontend.depth.planar import Planar, floors
from slamduel.frontend.depth.points import Points
from slamduel.frontend.depth.settings import RecordedSettings, Settings
from slamduel.frontend.depth.ways import Ways

SETTINGS = Settings(landmarks=False, loops=True)
SHARP = 1e-6 * np.eye(3)
NO_ROWS = np.zeros((0, 2), np.int64)


class Known(Pairs):
    """Finds the pairs that it is given, with as many features as it is told."""

    def __init__(self, found: dict[tuple[int, int], tuple[Array, int]]) -> None:
        super().__init__(CAMERA, SETTINGS)
        self.found, self.asked, self.cov = found, list[tuple[int, int]](), SHARP

    def register(self, first: Keyframe, second: Keyframe, least: int, known: Callable[[], Planar] | None) -> Trial:
        self.asked.append((first.step, second.step))
        delta, count = self.found.get((first.step, second.step), (None, 0))
        if delta is None or count < least:
            return Trial(first, second, None, "too few matches", NO_ROWS, NO_ROWS)
        rows = np.zeros((count, 2), np.int64)
        return Trial(first, second, Pair(first, second, Planar(delta, self.cov), rows), "", rows, NO_ROWS)


def frame(step: int, t: float) -> Keyframe:
    none = np.zeros((0, 2))
    features = Features(none, Points(none, *(np.zeros(0),) * 3), np.zeros((0, 32), np.uint8))
    level = Level(np.eye(4), SHARP, True)
    return Keyframe(step, t, features, level, np.zeros((1, 1), np.float32), np.zeros(0, np.int64))


def square(n: int) -> Array:
    """(n, 3) poses on a square of 4 m that is driven round and round, half a metre a step and eight steps a side."""
    return chained(np.array([[0.5, 0.0, np.pi / 2 if k % 8 == 7 else 0.0] for k in range(n - 1)]))


def closed(
    pairs: Known, n: int, sd: float, wheels: bool = True, settings: Settings = SETTINGS
) -> list[tuple[int, int]]:
    """The loops of a drive whose steps err by `sd` each, as (earlier step, step)."""
    poses, ways, out = square(n), Ways(), list[tuple[int, int]]()
    loops = Loops(pairs, ways, settings, wheels)
    for k in range(n):
        if k:
            ways.step(Planar(between(poses[k - 1], poses[k]), sd**2 * np.diag([1, 1, 0.01])))
        found = loops.search(frame(k, float(k)))
        for pair in found:
            ways.join(pair.first.step, pair.second.step, pair.motion)
            out.append((pair.first.step, pair.second.step))
        loops.remember(frame(k, float(k)), found)
    return out


def true_loops(steps: list[tuple[int, int]], count: int = 50) -> dict[tuple[int, int], tuple[Array, int]]:
    poses = square(60)
    return {(a, b): (between(poses[a], poses[b]), count) for a, b in steps}


def test_places_are_searched_once_they_are_old_enough_and_the_best_loops_are_closed() -> None:
    found = true_loops([(0, 32), (1, 32), (2, 32)])
    found[1, 32] = (found[1, 32][0], 99)
    found[2, 32] = (found[2, 32][0], 70)
    pairs = Known(found)
    assert closed(pairs, 34, 0.001) == [(1, 32), (2, 32)]
    assert all(second - first > 5 for first, second in pairs.asked)
    assert (0, 6) in pairs.asked
    assert (0, 5) not in pairs.asked


@pytest.mark.parametrize(("wheels", "least"), [(True, 20), (False, 30)])
def test_a_loop_needs_more_features_without_wheels(wheels: bool, least: int) -> None:
    for count in (least - 1, least):
        assert closed(Known(true_loops([(0, 32)], count)), 34, 0.001, wheels) == [(0, 32)] * (count >= least)


@pytest.mark.parametrize("settings", [SETTINGS, RecordedSettings(landmarks=False, loops=True)])
@pytest.mark.parametrize(("sd", "expected"), [(0.0049, [(0, 32)]), (0.0051, [])])
def test_a_loop_whose_features_leave_the_turn_open_stays_open(settings: Settings, sd: float, expected: Any) -> None:
    """Whatever the floors, which are no part of what features tell."""
    pairs = Known(true_loops([(0, 32)]))
    delta = pairs.found[0, 32][0]
    pairs.cov = np.diag([1e-6, 1e-6, sd**2]) + floors(delta, settings)
    assert closed(pairs, 34, 0.001, settings=settings) == expected


def test_where_the_steps_cannot_tell_two_loops_have_to_agree() -> None:
    assert closed(Known(true_loops([(0, 32)])), 40, 0.1) == []
    assert closed(Known(true_loops([(0, 32), (3, 35)])), 40, 0.1) == [(0, 32), (3, 35)]
    wrong = true_loops([(0, 32), (3, 35)])
    wrong[0, 32] = (wrong[0, 32][0] + [1.6, 0.0, 0.0], 80)
    assert closed(Known(wrong), 40, 0.1) == []
    assert closed(Known(true_loops([(0, 32), (25, 57)])), 60, 0.1) == []  # too late


def test_a_loop_is_less_certain_than_its_features_say_by_what_they_share() -> None:
    ways, poses, found = Ways(), square(33), list[Pair]()
    loops = Loops(Known(true_loops([(0, 32)])), ways, SETTINGS, True)
    for k in range(33):
        if k:
            ways.step(Planar(between(poses[k - 1], poses[k]), SHARP))
        found = loops.search(frame(k, float(k)))
        loops.remember(frame(k, float(k)), found)
    assert [pair.first.step for pair in found] == [0]
    np.testing.assert_allclose(found[0].motion.cov, SHARP + np.diag([0.002**2, 0.002**2, 0.0012**2]), rtol=1e-12)


def test_a_keyframe_near_a_place_is_no_place_of_its_own() -> None:
    ways = Ways()
    loops = Loops(Known({}), ways, SETTINGS, True)
    near = Planar(np.array([0.11, 0.0, 0.05]), SHARP)
    for k in range(4):
        if k:
            ways.step(near)
        loops.remember(frame(k, float(k)), [])
    assert [place.step for place in loops.places] == [0, 3]  # 0.3 m on
    ways.step(Planar(np.array([1.0, 0.0, 0.0]), SHARP))
    known = frame(4, 4.0)
    loops.remember(known, [Pair(loops.places[0], known, near, np.zeros((0, 2), np.int64))])
    assert len(loops.places) == 2
    ways.step(Planar(np.array([0.0, 0.0, 0.31]), SHARP))
    loops.remember(replace(known, step=5), [])
    assert [place.step for place in loops.places] == [0, 3, 5]

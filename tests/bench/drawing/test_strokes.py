"""Lines of long paths: all of what is seen, once, and never more than a bounded number of strokes."""

import numpy as np
import pytest

from slamduel.bench.drawing.strokes import FINEST, MOST, strokes
from slamduel.core.se2 import Array

LOW, HIGH = np.array((-1.2, -1.2)), np.array((1.2, 1.2))


def circles(n: int, laps: float) -> Array:
    angle = np.linspace(0, 2 * np.pi * laps, n)
    return np.column_stack((np.cos(angle), np.sin(angle)))


def drawn(line: Array) -> int:
    """The number of strokes of a line with gaps."""
    return int(np.isfinite(line[1:] + line[:-1]).all(axis=1).sum())


def test_a_short_path_is_drawn_as_it_is() -> None:
    path = circles(MOST, 3)
    assert strokes(path, LOW, HIGH) is path


@pytest.mark.parametrize("laps", [1, 40, 400])
def test_each_lap_is_drawn_once_and_whole(laps: int) -> None:
    line = strokes(circles(400_000, laps), LOW, HIGH)
    side = 2.4 / FINEST
    assert drawn(line) < 3 * 2 * np.pi / side
    points = line[np.isfinite(line).all(axis=1)]
    assert np.hypot(*points.T) == pytest.approx(1, abs=1e-9)
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < 3 * side
    ends = line[1:] - line[:-1]
    assert np.nanmax(np.hypot(*ends.T)) < 3 * side


def test_a_path_that_fills_the_picture_has_a_bounded_number_of_strokes() -> None:
    rng = np.random.default_rng(1)
    path = np.clip(np.cumsum(rng.normal(scale=0.02, size=(300_000, 2)), axis=0), -1, 1)
    line = strokes(path, LOW, HIGH)
    assert MOST / 8 < drawn(line) <= MOST
    given = {tuple(p) for p in path.tolist()}
    assert {tuple(p) for p in line[np.isfinite(line).all(axis=1)].tolist()} <= given


def test_what_is_far_outside_or_unknown_is_a_gap() -> None:
    path = circles(200_000, 2)
    path[1000:2000] = 1e9
    path[3000:3500] = np.nan
    line = strokes(path, LOW, HIGH)
    assert np.nanmax(np.abs(line)) <= 1.0
    assert np.isnan(line).any()
    assert np.nanmax(np.hypot(*(line[1:] - line[:-1]).T)) < 0.05
    assert len(strokes(np.full((MOST + 1, 2), 1e9), LOW, HIGH)) == 0


def test_the_same_strokes_whichever_way_they_are_driven() -> None:
    there = circles(100_000, 1)
    once, twice = (strokes(path, LOW, HIGH) for path in (there, np.concatenate((there, there[::-1]))))
    assert drawn(once) == drawn(twice)

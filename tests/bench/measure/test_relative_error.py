"""Relative errors: what evo's own command line prints, and, over durations, what plain matrices say."""

from pathlib import Path

import numpy as np
import pytest
from evo.core.filters import filter_pairs_by_path

from evo_cli import evo
from slamduel.bench.measure.accuracy import align, aligned, ate
from slamduel.bench.measure.relative_error import TOLERANCE, pairs_by_path, pairs_by_time, relative_error
from slamduel.core.se2 import Array, Ints, compose, wrap
from slamduel.core.truth.tum import write_tum


def drive(rng: np.random.Generator, n: int, pace: float = 0.4) -> tuple[Array, Array]:
    """A path (n, 3) in bends, and one that drifts away from it, turned and shifted from the start."""
    heading = np.cumsum(rng.normal(0, 0.2, n))
    moves = rng.uniform(0.5, 1.5, n) * pace * np.stack((np.cos(heading), np.sin(heading)))
    truth = np.column_stack((*np.cumsum(moves, axis=1), wrap(heading)))
    drift = np.cumsum(rng.normal(0, (0.01, 0.01, 0.003), (n, 3)), axis=0)
    estimate = compose(np.broadcast_to((2.0, -1.0, 0.7), (n, 3)), truth + drift)
    return truth, estimate


def matrix(pose: Array) -> Array:
    """(4, 4)."""
    found = np.eye(4)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    found[:2, :2] = (c, -s), (s, c)
    found[:2, 3] = pose[:2]
    return found


def by_matrices(estimate: Array, truth: Array, pairs: Ints) -> tuple[float, float]:
    """Root mean squares of Sturm et al., eq. (1): (Qi^-1 Qj)^-1 (Pi^-1 Pj)."""
    squares = []
    for i, j in pairs:
        right = np.linalg.inv(matrix(truth[i])) @ matrix(truth[j])
        off = np.linalg.inv(right) @ np.linalg.inv(matrix(estimate[i])) @ matrix(estimate[j])
        squares.append((off[0, 3] ** 2 + off[1, 3] ** 2, np.arctan2(off[1, 0], off[0, 0]) ** 2))
    return tuple(np.sqrt(np.mean(squares, axis=0)))


@pytest.mark.slow
def test_errors_are_what_evos_command_line_prints(tmp_path: Path) -> None:
    """Absolute and relative, aligned and not, translation and rotation, over distances and frames."""
    rng = np.random.default_rng(4)
    truth, estimate = drive(rng, 900)
    t: Array = 0.1 * np.arange(900.0)
    write_tum(tmp_path / "truth.tum", t, truth)
    write_tum(tmp_path / "estimate.tum", t, estimate)
    every = np.arange(0, 900, 7)
    frames = np.stack((every[:-1], every[1:]), axis=1)
    files, flat = ("truth.tum", "estimate.tum"), ("--project_to_plane", "xy")
    turns = ("--pose_relation", "angle_rad")
    commands = [("ape", *files, *flat), ("ape", *files, "-a", *flat)]
    ours = [ate(estimate, truth), ate(aligned(align(estimate, truth), estimate), truth)]
    for delta, unit, pairs in (*((str(d), "m", pairs_by_path(truth, d)) for d in (1, 10, 100)), ("7", "f", frames)):
        over = ("rpe", *files, "-d", delta, "-u", unit, "--pairs_from_reference", *flat)
        commands += [over, (*over, "-a"), (*over, *turns), (*over, "-a", *turns)]
        found = relative_error(estimate, truth, pairs)
        ours += [found.translation, found.translation, found.rotation, found.rotation]
    assert ours == pytest.approx(evo(tmp_path, *commands), abs=1e-6)


@pytest.mark.parametrize("step", [0.1, 0.2, 1 / 3, 0.05])
def test_pairs_are_evos_where_a_sum_of_lengths_is_the_distance_but_for_rounding(step: float) -> None:
    rng = np.random.default_rng(5)
    way = np.cumsum(np.where(rng.random(400) < 0.05, np.pi / 2, 0.0))
    path = np.column_stack((*np.cumsum(step * np.stack((np.cos(way), np.sin(way))), axis=1), way))
    poses = [matrix(pose) for pose in path]
    for distance in (1.0, 10.0):
        assert pairs_by_path(path, distance).tolist() == [list(p) for p in filter_pairs_by_path(poses, distance)]


def test_over_durations_pairs_are_of_the_nearest_times() -> None:
    """Against a search of all times for each pair; there are a gap and stretches at another rate."""
    rng = np.random.default_rng(6)
    truth, estimate = drive(rng, 700)
    apart = np.concatenate((rng.uniform(0.02, 0.2, 300), [7.3], rng.uniform(0.2, 0.5, 399)))
    t = 1.7e9 + np.cumsum(apart)
    for duration in (1.0, 10.0):
        expected = list[tuple[int, int]]()
        first = 0
        while first < len(t) - 1:
            later = range(first + 1, len(t))
            second = min(later, key=lambda k: abs(t[k] - t[first] - duration))
            if abs(t[second] - t[first] - duration) <= TOLERANCE * duration:
                expected.append((first, second))
            first = second
        pairs = pairs_by_time(t, duration)
        assert pairs.tolist() == [list(pair) for pair in expected]
        assert len(pairs) > 0.6 * (t[-1] - t[0] - 7.3) / duration
        found = relative_error(estimate, truth, pairs)
        assert found == pytest.approx(by_matrices(estimate, truth, pairs), rel=1e-9)


def test_a_path_that_is_too_short_has_no_relative_error() -> None:
    t, path = np.arange(5.0), np.zeros((5, 3))
    path[:, 0] = 0.1 * t
    for poses in (path, path[:1]):
        assert not len(pairs_by_path(poses, 1.0))
    assert not len(pairs_by_time(t, 10.0))
    assert not len(pairs_by_time(2 * t, 1.0))  # keyframes too far apart
    assert not len(pairs_by_time(t[:1], 1.0))
    assert relative_error(path, path, pairs_by_time(t, 10.0)) is None


def test_a_path_off_by_a_motion_has_no_relative_error_at_all() -> None:
    truth, _ = drive(np.random.default_rng(7), 300)
    found = relative_error(
        compose(np.broadcast_to((5.0, 3.0, 2.0), truth.shape), truth), truth, pairs_by_path(truth, 1)
    )
    assert found == pytest.approx((0, 0), abs=1e-12)

"""Scans of a robot that leans: horizontal ranges, no returns of the floor, and none of scans beyond a tilt."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from in_space import beams_in_space
from refusals import refused
from slamduel.core.factors import Prior
from slamduel.core.se2 import Array
from slamduel.frontend.inertial.levels import Levels
from slamduel.frontend.inertial.tilts import LEVELS, Tilts
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.laser.scanner import Fan, Scanner
from slamduel.frontend.laser.tilted import BUMPS, SURE, Leaning, levelled
from tiers import first_quick

RAISED = Leaning(height=0.3)


def tilting(t: Array, angles: Array, sd: float = 1e-4) -> Tilts:
    zero = np.zeros(len(t))
    return Tilts(
        t, angles, np.full((len(t), 2), sd), np.full(len(t), sd), np.zeros(len(t) - 1, bool), np.zeros(len(t), bool),
        np.full(2, 0.1), np.zeros(2), Levels(zero, zero, zero, zero, 0.1, 0.3),
    )  # fmt: skip


def scans(t: Array, ranges: Array, heading: float = 0.0, **more: Any) -> LaserRecording:
    angles = np.linspace(-2, 2, ranges.shape[1])
    scanner = Scanner(angles, np.array([0.1, 0.0, heading]))
    return LaserRecording("scans", scanner, t, ranges, None, Prior(np.zeros(3), np.eye(3)), **more)


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_ranges_along_the_floor_are_those_of_beams_in_space(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(6.0)
    pitch, roll = rng.uniform(-0.15, 0.15, (2, 6))
    made = scans(t, rng.uniform(1, 5, (6, 40)), float(rng.uniform(-3, 3)))
    found = levelled(made, tilting(t, np.column_stack((pitch, roll))), Leaning(0.3), [])
    at = made.scanner.angles + made.scanner.pose[2]
    for k in range(6):
        space = made.ranges[k][:, None] * beams_in_space(at, pitch[k], roll[k])
        np.testing.assert_allclose(found.ranges[k], np.hypot(space[:, 0], space[:, 1]), rtol=1e-12)
        moved = np.arctan2(space[:, 1], space[:, 0]) - at
        assert np.abs(np.arctan2(np.sin(moved), np.cos(moved))).max() < 0.15**2  # the directions stay


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_beams_that_vary_are_levelled_along_their_own_directions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, ranges = np.arange(5.0), rng.uniform(1, 5, (5, 12))
    fans = [Fan(12, first, 0.1) for first in rng.uniform(-3, 3, 5).tolist()]
    pitch, roll = rng.uniform(-0.15, 0.15, (2, 5))
    found = levelled(scans(t, ranges, fans=fans), tilting(t, np.column_stack((pitch, roll))), Leaning(0.3), [])
    for k, fan in enumerate(fans):
        space = ranges[k][:, None] * beams_in_space(fan.angles(12), pitch[k], roll[k])
        np.testing.assert_allclose(found.ranges[k], np.hypot(space[:, 0], space[:, 1]), rtol=1e-12)


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_returns_of_the_floor_are_left_out_and_no_others(seed: int) -> None:
    """Beams end at the floor, well above it, or nowhere."""
    rng = np.random.default_rng(seed)
    t, remarks = np.arange(8.0), list[str]()
    pitch, roll = rng.uniform(-0.15, 0.15, (2, 8))
    made = scans(t, np.full((8, 60), 25.0), 0.4)
    floor = np.zeros(made.ranges.shape, bool)
    for k in range(8):
        down = -beams_in_space(made.scanner.angles + 0.4, pitch[k], roll[k])[:, 2]
        reaches = np.where(down > 0, 0.3 / np.maximum(down, 1e-9), np.inf)
        floor[k] = (reaches < 24) & (rng.random(60) < 0.7)
        walls = np.minimum(20.0, 0.8 * reaches)  # there they are 6 cm above it
        made.ranges[k] = np.where(floor[k], reaches, np.maximum(walls, 0.2))
    made.ranges[:, 7] = np.nan
    found = levelled(made, tilting(t, np.column_stack((pitch, roll))), RAISED, remarks)
    floor[:, 7] = True
    np.testing.assert_array_equal(np.isnan(found.ranges), floor)
    floor[:, 7] = False
    assert floor.any(axis=1).all()
    share = 100 * floor.sum() / (8 * 59)
    assert remarks == [
        f"scans: {share:.2g} % of the returns are of the floor, as the robot leans: they are left out, in 8 of 8 scans"
    ]


@pytest.mark.parametrize("sd", [1e-4, 3e-3])
def test_a_return_just_above_the_floor_counts_as_of_it(sd: float) -> None:
    """Up to its bumps and what the levels leave open."""
    t = np.arange(3.0)
    farthest = (0.3 - BUMPS) / (np.sin(0.1) + SURE * sd)
    for away, left_out in ((1.03 * farthest, True), (0.97 * farthest, False)):
        made = replace(scans(t, np.full((3, 1), away)), scanner=Scanner(np.zeros(1), np.zeros(3)))
        found = levelled(made, tilting(t, np.column_stack((np.full(3, 0.1), np.zeros(3))), sd), RAISED, [])
        assert np.isnan(found.ranges).all() == left_out


def test_scans_beyond_the_tilt_are_left_out_with_a_remark() -> None:
    t, remarks = np.arange(10.0), list[str]()
    angles = np.zeros((10, 2))
    angles[4:7] = 0.1, -0.1
    found = levelled(scans(t, np.ones((10, 5))), tilting(t, angles), Leaning(0.12), remarks)
    np.testing.assert_array_equal(found.t, [0, 1, 2, 3, 7, 8, 9])
    said = "scans: the robot leans by more than max_tilt, 0.12 rad, at 3 of 10 scans, the first at 4 s"
    assert remarks[0].startswith(said)
    all_steep = tilting(t, np.full((10, 2), 0.2))
    refused(
        "at 10 of 10 scans, expected at least two", levelled, scans(t, np.ones((10, 5))), all_steep, Leaning(0.1), []
    )


def test_a_level_robot_has_the_ranges_it_had() -> None:
    t, made = np.arange(4.0), scans(np.arange(4.0), np.random.default_rng(0).uniform(1, 5, (4, 9)))
    found = levelled(made, tilting(t, np.zeros((4, 2))), Leaning(0.1, 0.3), [])
    np.testing.assert_array_equal(found.ranges, made.ranges)
    assert found.notes[LEVELS]["of"] == "scans"


def test_scans_without_levels_stay_as_they_are() -> None:
    t, made = np.arange(4.0), scans(np.arange(4.0), np.full((4, 9), 24.0))
    later = replace(made, t=t + 100)
    found = levelled(later, tilting(t, np.full((4, 2), 0.05)), Leaning(0.01, 0.3), [])
    np.testing.assert_array_equal(found.ranges, made.ranges)


def test_scans_whose_level_is_not_known_stay_and_are_counted() -> None:
    t, remarks = np.arange(6.0), list[str]()
    by = replace(tilting(t, np.full((6, 2), 0.1)), unsure=t == 3)
    made = scans(np.array([0.5, 1.5, 2.5, 3.5, 4.5, 7.0]), np.full((6, 10), 2.0))
    found = levelled(made, by, Leaning(), remarks)
    stay = np.array([False, False, True, True, False, True])
    np.testing.assert_array_equal(found.ranges[stay], made.ranges[stay])
    assert (found.ranges[~stay] < made.ranges[~stay]).all()
    unfelt, unsure = remarks
    assert "no readings around the times of 1 of 6 scans, which are not levelled: their ranges are those of a" in unfelt
    assert "at the times of 2 of 6 scans, which are not levelled" in unsure

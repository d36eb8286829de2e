"""The made-up floor: its beams against geometry done otherwise, and its drive."""

import numpy as np
import pytest

from slamduel.bench.plan.load import load
from slamduel.core.se2 import Array, between
from slamduel.datasets.rendering._casting import cast
from slamduel.datasets.worlds.floor_plan import DOOR, floor_plan
from slamduel.datasets.worlds.laser_floor import NO_RETURN, Options, record
from tiers import first_quick


def test_beams_end_where_lines_and_circles_are_met() -> None:
    walls = np.array([[2.0, -5.0, 2.0, 5.0], [-1.0, 3.0, 4.0, 3.0]])
    discs = np.array([[1.0, 0.0, 0.25]])
    angles = np.array([0.0, np.arctan2(1, 2), np.pi / 2, np.pi, np.arctan2(3, -1) + 0.01])
    found = cast(walls, discs, 0.0, 0.0, np.stack((np.cos(angles), np.sin(angles)), -1), 9.0)
    assert np.abs(found - [0.75, np.sqrt(5), 3.0, 9.0, 9.0]).max() < 1e-12


@pytest.mark.parametrize("seed", first_quick(range(5)))
def test_the_robot_meets_no_wall(seed: int) -> None:
    """Without noise every beam is longer than the robot is wide; doors are open and free."""
    recording, truth = record(Options(laps=1, people=3, range_sd=0.0), np.random.default_rng(seed))
    returned = recording.ranges[recording.ranges < NO_RETURN]
    assert returned.min() > 0.2
    plan = floor_plan(36.0, 22.0, 5.0, np.random.default_rng(seed).spawn(4)[0])
    assert len(plan.doors) > 10
    for door in plan.doors:  # nothing crosses the middle of a door, from 0.3 m before it to 0.3 m behind
        for share in np.linspace(-0.3, 0.3, 7):
            assert not _crossed(plan.walls, door.at + share * door.inward, 0.8 * DOOR / 2 * np.abs(door.inward[::-1]))
    assert np.hypot(*between(truth.poses[:-1], truth.poses[1:])[:, :2].T).max() < 0.11


def _crossed(walls: Array, at: Array, half: Array) -> bool:
    """Tells if a wall cuts the segment from at - half to at + half."""
    a, b = at - half, at + half
    for x0, y0, x1, y1 in walls:
        c, d = np.array([x0, y0]), np.array([x1, y1])

        def side(p: Array, q: Array, r: Array) -> float:
            return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

        if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
            return True
    return False


def test_one_log_for_each_seed_with_its_truth() -> None:
    log, truth = load("laser-floor[laps=0.3,people=2]", seed=3)
    again, _ = load("laser-floor[laps=0.3,people=2]", seed=3)
    other, _ = load("laser-floor[laps=0.3,people=2]", seed=4)
    assert log.digest == again.digest != other.digest
    assert (truth.t == log.t).all()
    assert len(log.ids) == 0
    assert log.notes["laser"]["scans"] > 5 * len(log) / 2

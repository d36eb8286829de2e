"""The rendered robot in a building: its drive, markers and people, and the sensors that its log has."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.rendering._casting import cast
from slamduel.datasets.worlds.aruco_room import Options, aruco_room, matching, recorded
from slamduel.datasets.worlds.laser_floor import TICK
from slamduel.datasets.worlds.rendered_world import World, world
from slamduel.frontend.laser.log import build_log
from slamduel.frontend.laser.recording import matched
from slamduel.frontend.several.scan_motions import scan_motions
from tiers import first_quick

IN_BUILDING = Options(building=True, seconds=120.0, markers=50, frame_rate=1.0)
SHORT = Options(seconds=4.0, frame_rate=1.0, scan_rate=5.0)


def built(seed: int, options: Options = IN_BUILDING) -> World:
    return world(options, options.seconds, np.random.default_rng(seed))


def away(inside: World, at: Array, directions: Array) -> Array:
    """How far the next wall is along unit vectors, from a point (2,)."""
    return cast(inside.room.outlines, np.zeros((0, 3)), float(at[0]), float(at[1]), directions, 50.0)


ANGLES = np.linspace(0.0, 6.28, 360)
AROUND = np.array([[np.cos(angle), np.sin(angle)] for angle in ANGLES.tolist()])


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_the_robot_keeps_clear_of_walls_and_drives_smoothly(seed: int) -> None:
    inside = built(seed)
    t = np.linspace(0.0, IN_BUILDING.seconds, int(2 * IN_BUILDING.seconds / TICK) + 1)
    poses, way = inside.drive(t)
    for pose in poses[::100]:
        assert away(inside, pose, AROUND).min() > 0.2
    speed, turning = np.diff(way) / (TICK / 2), wrap(np.diff(poses[:, 2])) / (TICK / 2)
    assert 0.9 * IN_BUILDING.speed < speed.max() <= IN_BUILDING.speed + 1e-9
    assert np.abs(np.diff(speed)).max() < 0.1 * IN_BUILDING.speed + 1e-9  # TICK over the motors' LAG
    assert np.abs(turning).max() < 1.1
    np.testing.assert_allclose(np.hypot(*np.diff(poses[:, :2], axis=0).T), np.diff(way), atol=1e-9)
    assert way[-1] > 0.4 * IN_BUILDING.speed * IN_BUILDING.seconds  # it turns on the spot, too, but never stops


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_markers_are_on_the_floor_of_the_corridor_or_on_its_walls(seed: int) -> None:
    inside = built(seed)
    assert [marker.id for marker in inside.room.markers] == list(range(50))
    for marker in inside.room.markers:
        place, up = marker.pose[:2, 3], marker.pose[2, 3]
        normal = marker.pose[:2, 2]
        if up == 0:
            assert away(inside, place, AROUND).min() > 0.1
            continue
        assert np.hypot(*normal) == pytest.approx(1)
        before = place + 0.05 * normal
        assert away(inside, before, -normal[None])[0] == pytest.approx(0.05)
        assert away(inside, before, normal[None])[0] > 0.8
        beside = np.array([-normal[1], normal[0]]) * 0.1
        for sign in (-1, 1):
            assert away(inside, before + sign * beside, -normal[None])[0] == pytest.approx(0.05)


def test_people_walk_in_the_corridor_and_step_aside() -> None:
    inside = built(0)
    drawn = [inside.people(float(t)) for t in range(60)]
    assert max(len(one) for one in drawn) == 4 * 4  # legs, body and head of four
    for t, one in enumerate(drawn):
        x, y, _ = inside.drive(np.array([float(t)]))[0][0].tolist()
        bodies = one[one[:, 4] == 1.5, :2]
        assert (np.hypot(*(bodies - [x, y]).T) > 0.3).all()
    assert len(built(0, replace(IN_BUILDING, people=0)).people(3.0)) == 0
    moved = np.abs(drawn[0][:, :2] - drawn[1][:, :2]).max() if len(drawn[0]) == len(drawn[1]) else 1.0
    assert moved > 0.3


def test_options_of_one_world_are_refused_in_the_other() -> None:
    rng = np.random.default_rng(0)
    refused("building=true and boxes=2, expected one of them", built, 0, replace(IN_BUILDING, boxes=2))
    refused("found option people=3, expected it beside building=true", built, 0, Options(people=3))
    refused("sensors=laser, expected it beside scan_rate", aruco_room, Options(sensors="laser"), rng)
    bad = replace(SHORT, sensors="laser", outliers=0.1)
    refused("sensors=laser and outliers=0.1, expected one of them", aruco_room, bad, rng)


def test_each_sensor_has_the_same_drive() -> None:
    made = {
        name: aruco_room(replace(SHORT, sensors=name), generator("aruco-room", 2))
        for name in ("both", "markers", "laser")
    }
    both, markers, laser = (made[name].log for name in ("both", "markers", "laser"))
    np.testing.assert_array_equal(both.z, markers.z)
    np.testing.assert_array_equal(both.t[both.sighting_step], markers.t[markers.sighting_step])
    assert len(markers.loop_to) == len(laser.ids) == 0
    assert len(both) == len(markers) + len(laser)
    scans = recorded(SHORT, generator("aruco-room", 2)).scans
    assert scans is not None
    np.testing.assert_array_equal(laser.delta, build_log(scans, matching(SHORT)).delta)
    for one in made.values():
        rows = np.searchsorted(made["both"].truth.t, one.truth.t)
        np.testing.assert_array_equal(made["both"].truth.poses[rows], one.truth.poses)
        np.testing.assert_array_equal(one.truth.t, one.log.t)


def first_headings(seed: int, dense: float) -> Array:
    """Errors (m,) of the headings that the scans tell near the start of a building, rad."""
    options = replace(IN_BUILDING, seconds=12.0, scan_rate=5.0, speed=0.6)
    _, truth, scans, *_ = recorded(options, generator("aruco-room", seed))
    assert scans is not None
    front_end = matched(scans, replace(matching(options), dense_start=dense, step=0.5, turn=0.4))
    told = scan_motions(front_end)
    poses = truth.poses[np.searchsorted(truth.t, [step.t for step in front_end.steps])]
    first = told.to == 0
    return wrap(told.delta[first, 2] - wrap(poses[told.at[first], 2] - poses[0, 2]))


@pytest.mark.slow
def test_a_dense_start_tells_the_first_headings_better() -> None:
    """A submap of one scan has single points on walls far down a corridor, to which those of the next are drawn."""
    sparse, dense = (np.concatenate([first_headings(seed, metres) for seed in range(10)]) for metres in (0.0, 2.0))
    assert len(dense) > 30
    assert np.sqrt((dense**2).mean()) < 0.8 * np.sqrt((sparse**2).mean())

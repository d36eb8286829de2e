"""Scans of a robot that leans: horizontal ranges, and none of scans beyond a tilt."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from refusals import refused
from slamduel.core.factors import Prior
from slamduel.core.se2 import Array
from slamduel.datasets.cache import generator
from slamduel.datasets.recordings.recording import open_recording
from slamduel.datasets.recordings.several import OpenedSeveral, open_several
from slamduel.datasets.recordings.write import write
from slamduel.datasets.scans.tilted import levelled, levels_of
from slamduel.datasets.worlds.aruco_room import MATCHING, Options, recorded
from slamduel.frontend.inertial.levels import Levels
from slamduel.frontend.inertial.tilts import Tilts, leaned
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.laser.scanner import Scanner
from tiers import first_quick


def tilting(t: Array, angles: Array) -> Tilts:
    zero = np.zeros(len(t))
    return Tilts(
        t, angles, np.full((len(t), 2), 1e-3), np.zeros(len(t) - 1, bool), np.full(2, 0.1), np.zeros(2),
        Levels(zero, zero, zero, zero, 0.1, 0.3),
    )  # fmt: skip


def scans(t: Array, ranges: Array, heading: float = 0.0) -> LaserRecording:
    angles = np.linspace(-2, 2, ranges.shape[1])
    scanner = Scanner(angles, np.array([0.1, 0.0, heading]))
    return LaserRecording("scans", scanner, t, ranges, None, Prior(np.zeros(3), np.eye(3)), {})


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_ranges_along_the_floor_are_those_of_beams_in_space(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(6.0)
    pitch, roll = rng.uniform(-0.15, 0.15, (2, 6))
    made = scans(t, rng.uniform(1, 5, (6, 40)), float(rng.uniform(-3, 3)))
    found = levelled(made, tilting(t, np.column_stack((pitch, roll))), 0.3, [])
    at = made.scanner.angles + made.scanner.pose[2]
    beams = np.column_stack((np.cos(at), np.sin(at), 0 * at))
    for k in range(6):
        space = made.ranges[k][:, None] * (beams @ leaned(pitch[k], roll[k]).T)
        np.testing.assert_allclose(found.ranges[k], np.hypot(space[:, 0], space[:, 1]), rtol=1e-6)
        moved = np.arctan2(space[:, 1], space[:, 0]) - at
        assert np.abs(np.arctan2(np.sin(moved), np.cos(moved))).max() < 0.15**2  # the directions stay


def test_scans_beyond_the_tilt_are_left_out_with_a_remark() -> None:
    t, remarks = np.arange(10.0), list[str]()
    angles = np.zeros((10, 2))
    angles[4:7] = 0.1, -0.1
    found = levelled(scans(t, np.ones((10, 5))), tilting(t, angles), 0.12, remarks)
    np.testing.assert_array_equal(found.t, [0, 1, 2, 3, 7, 8, 9])
    said = "scans: the robot leans by more than 0.12 rad, [laser] max_tilt, at 3 of 10 scans, the first at 4 s"
    assert remarks[0].startswith(said)
    all_steep = tilting(t, np.full((10, 2), 0.2))
    refused("at 10 of 10 scans, expected at least two", levelled, scans(t, np.ones((10, 5))), all_steep, 0.1, [])


def test_a_level_robot_has_the_ranges_it_had() -> None:
    t, made = np.arange(4.0), scans(np.arange(4.0), np.random.default_rng(0).uniform(1, 5, (4, 9)))
    np.testing.assert_array_equal(levelled(made, tilting(t, np.zeros((4, 2))), 0.1, []).ranges, made.ranges)
    later = replace(made, t=t + 100)
    np.testing.assert_array_equal(levelled(later, tilting(t, np.full((4, 2), 0.05)), 0.01, []).ranges, made.ranges)


def test_robot_toml_asks_for_it(tmp_path: Path) -> None:
    options = Options(seconds=4.0, frame_rate=1.0, scan_rate=5.0, imu=True)
    recording, truth, made, imu, *_ = recorded(options, generator("aruco-room", 1))
    write({tmp_path / "drive": "frames"}, recording, truth, imu, made, MATCHING)
    robot = tmp_path / "drive" / "robot.toml"
    plain = open_several(tmp_path / "drive")
    robot.write_text(robot.read_text().replace("[laser]", "[laser]\nmax_tilt = 0.03"))
    opened = open_several(tmp_path / "drive")
    assert isinstance(opened, OpenedSeveral)
    assert isinstance(plain, OpenedSeveral)
    assert opened.scans is not None
    assert plain.scans is not None
    assert 2 <= len(opened.scans.recording.t) < len(plain.scans.recording.t) == 20
    assert "leans by more than 0.03 rad, [laser] max_tilt" in " ".join(opened.scans.remarks)
    (tmp_path / "drive" / "imu.csv").unlink()
    robot.write_text(
        "\n".join(robot.read_text().split("[imu]")[:1]) + robot.read_text()[robot.read_text().index("[laser]") :]
    )
    refused("max_tilt needs levels by gravity, and there are no inertial readings", open_several, tmp_path / "drive")
    frames = open_recording(tmp_path / "drive")
    refused("there are no inertial readings", levels_of, "x", None, frames.recording.motion, [])

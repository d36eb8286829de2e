"""robot.toml: it is read, refused by file, line and key where it is wrong, and what is written reads back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from refusals import refusal, refused
from slamduel.core.factors import Prior
from slamduel.datasets.depth.robot import read_depth_robot
from slamduel.datasets.recordings.robot import Robot, read_robot, write_robot
from slamduel.datasets.recordings.robot_camera import FrameSource
from slamduel.datasets.recordings.rosbag import Topics
from slamduel.datasets.robot_limits import LIMITS
from slamduel.datasets.scans.robot import read_laser_robot
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import from_rpy, mounting
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.markers.noise import PropagatedNoise, ProportionalNoise
from slamduel.frontend.wheels.commands import Commands
from slamduel.frontend.wheels.encoder import Encoder, Floors
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.track import TrackNoise

CALIBRATION = """%YAML:1.0
---
image_width: 160
image_height: 120
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [150.5, 0., 79.5, 0., 149.5, 59.5, 0., 0., 1.]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [-0.2, 0.06, 0.001, -0.002, 0.01]
"""

FULL = """
name = "cart"
[camera]
calibration = "calibration.yaml"
mounting = {xyz = [0.1, -0.02, 0.3], rpy = [0.0, 0.2, -0.1]}
time_offset = -0.25
exposure = 0.02
readout = 0.03
[markers]
dictionary = "4X4_50"
side = 0.16
sides = {7 = 0.2}
max_range = 4
[encoder]
left = 1.5e-4
right = 1.6e-4
base = 0.36
k = 0.01
noise = "distance"
interval = 0.05
curve = "arc"
floors = {position = 1e-3}
counter_bits = 16
max_speed = 2.0
[odometry]
forward = 0.03
turning_by_turn = 0.05
[drift]
position = 0.4
turning = 0.6
[noise]
model = "proportional"
k_range = 0.03
floor_bearing = 0.02
sway = 0.015
[prior]
pose = [1.0, 2.0, 0.5]
sd = [0.1, 0.2, 0.3]
[topics]
image = "/camera/image_raw"
[frames]
source = "drive.mkv"
fps = 30
start = 5.0
[commands]
full = 0.7
base = 0.3
delay = 0.1
turning = 0.05
"""


def folder_with(folder: Path, words: str, calibration: str = CALIBRATION) -> Path:
    (folder / "calibration.yaml").write_text(calibration)
    (folder / "robot.toml").write_text(words)
    return folder / "robot.toml"


def assert_same(found: Robot, expected: Robot) -> None:
    plain = (
        "name",
        "time_offset",
        "exposure",
        "readout",
        "max_range",
        "max_distance",
        "encoder",
        "counter_bits",
        "max_speed",
    )
    for name in (*plain, "track_noise", "commands", "drift", "noise", "topics", "frames"):
        assert getattr(found, name) == getattr(expected, name), name
    np.testing.assert_allclose(found.mounting, expected.mounting, atol=1e-15)
    for one, other in ((found.markers, expected.markers),):
        assert (one.dictionary, one.side, dict(one.sides)) == (other.dictionary, other.side, dict(other.sides))
    assert (found.prior is None) == (expected.prior is None)
    if found.prior is not None and expected.prior is not None:
        np.testing.assert_array_equal(found.prior.pose, expected.prior.pose)
        np.testing.assert_array_equal(found.prior.cov, expected.prior.cov)
    assert (found.camera is None) == (expected.camera is None)
    if found.camera is not None and expected.camera is not None:
        for name in ("width", "height", "focal", "centre", "distortion", "model", "readout"):
            assert getattr(found.camera, name) == getattr(expected.camera, name), name
        np.testing.assert_allclose(found.camera.mounting, expected.camera.mounting, atol=1e-15)


def test_everything_is_read(tmp_path: Path) -> None:
    placed = from_rpy((0.1, -0.02, 0.3), (0.0, 0.2, -0.1))
    distortion = (-0.2, 0.06, 0.001, -0.002, 0.01)
    expected = Robot(
        name="cart",
        markers=Markers("4X4_50", 0.16, {7: 0.2}),
        camera=Camera(160, 120, (150.5, 149.5), (79.5, 59.5), distortion, placed, readout=0.03),
        mounting=placed,
        time_offset=-0.25,
        exposure=0.02,
        readout=0.03,
        max_range=4.0,
        encoder=Encoder(1.5e-4, 1.6e-4, 0.36, 0.01, "distance", 0.05, "arc", Floors(position=1e-3)),
        counter_bits=16,
        max_speed=2.0,
        track_noise=TrackNoise(forward=0.03, turning_by_turn=0.05),
        commands=Commands(0.7, 0.3, 0.1, TrackNoise(0.1, 0.05, 0.3)),
        drift=Drift(0.4, 0.6),
        noise=ProportionalNoise(k_range=0.03, floor_bearing=0.02, sway=0.015),
        prior=Prior(np.array([1.0, 2.0, 0.5]), np.diag(np.square([0.1, 0.2, 0.3]))),
        topics=Topics(image="/camera/image_raw"),
        frames=FrameSource("drive.mkv", 30.0, 5.0),
    )
    assert_same(read_robot(folder_with(tmp_path, FULL)), expected)


def test_markers_are_all_that_has_to_be_said(tmp_path: Path) -> None:
    folder = tmp_path / "my-cart"
    folder.mkdir()
    found = read_robot(folder_with(folder, '[markers]\ndictionary = "4X4_50"\nside = 0.1\n'))
    assert_same(found, Robot("my-cart", Markers("4X4_50", 0.1)))
    np.testing.assert_array_equal(found.mounting, mounting(0, 0, 0, 0))


@pytest.mark.parametrize("words", [FULL, '[markers]\ndictionary = "4X4_50"\nside = 0.1\n[odometry]\nmax_speed = 9\n'])
def test_what_is_written_reads_back(tmp_path: Path, words: str) -> None:
    robot = read_robot(folder_with(tmp_path, words))
    (tmp_path / "again").mkdir()
    write_robot(tmp_path / "again" / "robot.toml", robot)
    assert_same(read_robot(tmp_path / "again" / "robot.toml"), replace(robot))
    assert (tmp_path / "again" / "calibration.yaml").exists() == (robot.camera is not None)


def test_a_distance_from_the_camera_replaces_the_usual_range(tmp_path: Path) -> None:
    markers = '[markers]\ndictionary = "4X4_50"\nside = 0.1\n'
    robot = read_robot(folder_with(tmp_path, markers + "max_distance = 3.0\n"))
    assert (robot.max_range, robot.max_distance) == (np.inf, 3.0)
    write_robot(tmp_path / "robot.toml", robot)
    assert "max_range" not in (tmp_path / "robot.toml").read_text()
    assert read_robot(tmp_path / "robot.toml").max_range == np.inf
    refused(r"max_distance: found 3000, .* \(3 if this is in millimetres\)",
            read_robot, folder_with(tmp_path, markers + "max_distance = 3000\n"))  # fmt: skip


def test_markers_of_nobody_are_asked_for_where_they_are_needed(tmp_path: Path) -> None:
    robot = read_robot(folder_with(tmp_path, FULL.replace('dictionary = "4X4_50"', "").replace("side = 0.16", "")))
    assert (robot.markers.dictionary, np.isnan(robot.markers.side)) == ("", True)
    assert robot.lacks["dictionary"].endswith("line 9: markers has no 'dictionary', expected a text in quotes.")
    assert robot.lacks["side"].endswith("line 9: markers has no 'side', expected a number above 0.")
    write_robot(tmp_path / "robot.toml", robot)
    assert list(read_robot(tmp_path / "robot.toml").lacks) == ["dictionary", "side"]
    assert not read_robot(folder_with(tmp_path, FULL)).lacks


def test_an_encoder_without_k_has_a_default_that_is_said(tmp_path: Path) -> None:
    wheels = '[markers]\ndictionary = "4X4_50"\nside = 0.1\n[encoder]\nleft = 1e-3\nright = 1e-3\nbase = 0.3\n'
    robot = read_robot(folder_with(tmp_path, wheels))
    assert robot.encoder == Encoder(1e-3, 1e-3, 0.3, 0.02, "distance")
    assert robot.assumed["encoder"].startswith("nothing was measured of the wheels' noise: stated as k = 0.02")
    assert read_robot(folder_with(tmp_path, wheels + 'noise = "distance"\n')).encoder == robot.encoder
    assert "encoder" not in read_robot(folder_with(tmp_path, wheels + "k = 0.02\n")).assumed
    refused("encoder has no 'k'", read_robot, folder_with(tmp_path, wheels + 'noise = "proportional"\n'))


def test_ids_to_ignore_are_read_and_written(tmp_path: Path) -> None:
    words = FULL.replace("max_range = 4", "max_range = 4\nignore = [3, 49]")
    robot = read_robot(folder_with(tmp_path, words))
    assert robot.markers.ignore == (3, 49)
    (tmp_path / "again").mkdir()
    write_robot(tmp_path / "again" / "robot.toml", robot)
    assert read_robot(tmp_path / "again" / "robot.toml").markers.ignore == (3, 49)
    for wrong in ("[3, 3]", "3", '"3;4"', "[-1]", "[true]", "[1.5]"):
        file = folder_with(tmp_path, words.replace("[3, 49]", wrong))
        refused(r"line 14: markers\.ignore: found .*, expected a list of different whole numbers", read_robot, file)
    file = folder_with(tmp_path, words.replace("49", "50"))
    refused("markers: ignore: found id 50, expected one of 4X4_50, 0 to 49", read_robot, file)


def test_either_noise_has_a_sway(tmp_path: Path) -> None:
    other = FULL.replace('"proportional"', '"propagated"').replace("k_range = 0.03\n", "")
    noise = read_robot(folder_with(tmp_path, other)).noise
    assert noise == PropagatedNoise(floor_bearing=0.02, sway=0.015)


def test_a_mounting_may_be_a_matrix(tmp_path: Path) -> None:
    rows = "[[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 0.3], [0, 0, 0, 1]]"
    words = FULL.replace("{xyz = [0.1, -0.02, 0.3], rpy = [0.0, 0.2, -0.1]}", f"{{matrix = {rows}}}")
    np.testing.assert_allclose(read_robot(folder_with(tmp_path, words)).mounting, mounting(0.1, 0, 0.3, 0), atol=1e-15)


def test_an_image_size_that_the_calibration_leaves_out(tmp_path: Path) -> None:
    sizeless = "\n".join(line for line in CALIBRATION.split("\n") if not line.startswith("image_"))
    words = FULL.replace("exposure = 0.02", "size = [320, 240]")
    camera = read_robot(folder_with(tmp_path, words, sizeless)).camera
    assert (camera.width, camera.height) == (320, 240)
    refused(r"calibration\.yaml: found no image_width", read_robot, folder_with(tmp_path, FULL, sizeless))


REFUSALS = [
    ('name = "cart"', "name = 3", "line 2: name: found 3, expected a text in quotes."),
    ("[drift]", "[drfit]", "line 28: drfit: there is no such key; did you mean 'drift'?"),
    ("left = 1.5e-4", "left = 0", "line 15: encoder.left: found 0, expected metres per count, a number other than 0."),
    ("left = 1.5e-4", "", "line 14: encoder has no 'left', expected a number."),
    ("base = 0.36", "base = -0.36", "line 17: encoder.base: found -0.36, expected a number above 0."),
    ("k = 0.01", "k = -1", "line 18: encoder.k: found -1, expected a number at least 0."),
    ('noise = "distance"', 'noise = "far"', "line 19: encoder.noise: found 'far', expected one of 'proportional',"),
    ("{position = 1e-3}", "{positon = 1e-3}", "line 22: encoder.floors.positon: there is no such key; did you mean"),
    ("counter_bits = 16", "counter_bits = 12", "line 23: encoder.counter_bits: found 12, expected one of 8, 16, 32."),
    ("counter_bits = 16", "counterbits = 16", "line 23: encoder.counterbits: there is no such key; did you mean"),
    ("max_speed = 2.0", "max_speed = 0", "line 24: encoder.max_speed: found 0, expected a number above 0."),
    ("forward = 0.03", "max_speed = 3.0", "line 26: odometry.max_speed: found 3.0, expected [encoder]'s 2, or nothing"),
    ("forward = 0.03", "forward = -3", "line 26: odometry.forward: found -3, expected a number at least 0."),
    ("turning = 0.6", "", "line 28: drift has no 'turning', expected a number above 0."),
    ("exposure = 0.02", "exposure = -0.02", "line 7: camera.exposure: found -0.02, expected a number at least 0."),
    ("readout = 0.03", "readout = -1", "line 8: camera.readout: found -1, expected a number at least 0."),
    ("readout = 0.03", "readout = 30", "line 8: camera.readout: found 30, expected seconds from 0 to 0.5 (0.03"),
    ("exposure = 0.02", "size = [3.5, 2]", "line 7: camera.size: found [3.5, 2], expected width and height in whole"),
    ('"calibration.yaml"', '"else.yaml"', "line 4: camera.calibration: there is no file "),
    ("[0.0, 0.2, -0.1]", "[0.0, 0.2]", "line 5: camera.mounting.rpy: found [0.0, 0.2], expected 3 numbers."),
    ("rpy =", "yaw =", "line 5: camera.mounting.yaw: there is no such key; expected one of matrix, rpy, xyz."),
    ("rpy = [0.0, 0.2, -0.1]", "matrix = [[1]]", "line 5: camera.mounting.matrix: is given beside xyz or rpy"),
    ("xyz = [0.1, -0.02, 0.3], rpy = [0.0, 0.2, -0.1]", "matrix = [[1]]", "line 5: camera.mounting.matrix: found"),
    ('dictionary = "4X4_50"', 'dictionary = "4X4_51"', "line 10: markers.dictionary: marker dictionary: there is no"),
    ("side = 0.16", "side = 0", "line 11: markers.side: found 0, expected a number above 0."),
    ("side = 0.16", "side = 160", "line 9: markers: side: found 160, expected metres"),
    ("{7 = 0.2}", "{seven = 0.2}", "line 12: markers.sides.seven: is not a marker's id, expected a whole number."),
    ("{7 = 0.2}", "{7 = -1}", "line 12: markers.sides.7: found -1, expected a number above 0."),
    ('model = "proportional"', 'model = "true"', "line 32: noise.model: found 'true', expected one of 'proportional',"),
    ("k_range = 0.03", "k_rang = 0.03", "line 33: noise.k_rang: there is no such key; did you mean 'k_range'?"),
    ("sway = 0.015", "sway = -0.015", "line 35: noise.sway: found -0.015, expected a number at least 0."),
    ("2.0, 0.5]", "2.0, 50.0]", "line 37: prior.pose: found [1.0, 2.0, 50.0], expected a heading from -pi to pi"),
    ("sd = [0.1, 0.2", "sd = [0.1, 0", "line 38: prior.sd: found [0.1, 0, 0.3], expected 3 numbers above 0."),
    ("image =", "imgae =", "line 40: topics.imgae: there is no such key; did you mean 'image'?"),
    ("fps = 30", "fps = 0", "line 43: frames.fps: found 0, expected a number above 0."),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), REFUSALS)
def test_what_cannot_be_used_is_refused_by_file_line_and_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FULL
    path = folder_with(tmp_path, FULL.replace(old, new, 1))
    assert refusal(read_robot, path).startswith(f"{path}, {message}")


ODD = [
    ("exposure = 0.02", "exposure = 10.0", "camera.exposure: 10, seconds, 0 to 0.5, 0.01, milliseconds"),
    ("exposure = 0.02", "exposure = 8000", "camera.exposure: 8000, seconds, 0 to 0.5, 0.008, microseconds"),
    ("[0.0, 0.2, -0.1]", "[0, 20, 0]", "camera.mounting.rpy: 20, radians, -1.58 to 1.58, 0.349, degrees"),
    ("[0.0, 0.2, -0.1]", "[180, 0, 0]", "camera.mounting.rpy: 180, radians, -3.15 to 3.15, 3.14, degrees"),
    ("[0.0, 0.2, -0.1]", "[0, 0, -90]", "camera.mounting.rpy: -90, radians, -3.15 to 3.15, -1.57, degrees"),
    ("[0.1, -0.02, 0.3]", "[120, 0, 9]", "camera.mounting.xyz: 120, metres, -5 to 5, 0.12, millimetres"),
    ("[0.1, -0.02, 0.3]", "[0, 0, 30]", "camera.mounting.xyz: 30, metres, -5 to 5, 0.3, centimetres"),
    ("left = 1.5e-4", "left = 6250", "encoder.left: 6250, metres per count, -1 to 1, 0.00016, counts per metre"),
    ("base = 0.36", "base = 360", "encoder.base: 360, metres, 0.01 to 10, 0.36, millimetres"),
    ("base = 0.36", "base = 36", "encoder.base: 36, metres, 0.01 to 10, 0.36, centimetres"),
    ("k = 0.01", "k = 10", "encoder.k: 10, metres per root metre or a share, 0 to 0.5, 0.01, millimetres"),
    ("{position = 1e-3}", "{heading = 5}", "encoder.floors.heading: 5, radians, 0 to 0.8, 0.0873, degrees"),
    ("max_speed = 2.0", "max_speed = 2e3", "encoder.max_speed: 2000, metres per second, 0 to 100, 2, millimetres"),
    ("max_range = 4", "max_range = 4000", "markers.max_range: 4000, metres, 0 to 100, 4, millimetres"),
    ("turning = 0.6", "turning = 30", "drift.turning: 30, radians per root second, 0 to 20, 0.524, degrees"),
    ("k_range = 0.03", "k_range = 3", "noise.k_range: 3, a share of 1, 0 to 1, 0.03, percent"),
    ("sway = 0.015", "sway = 0.5", "noise.sway: 0.5, radians, 0 to 0.2, 0.00873, degrees"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), ODD)
def test_a_number_that_no_robot_has_is_refused_with_the_unit_meant(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in FULL
    found, unit, limits, meant, other = said.split(", ")
    message = refusal(read_robot, folder_with(tmp_path, FULL.replace(old, new, 1)))
    key, value = found.split(": ")
    assert message.endswith(f"{key}: found {value}, expected {unit} from {limits} ({meant} if this is in {other}).")


def test_every_measure_is_of_a_key_that_a_robot_toml_may_have(tmp_path: Path) -> None:
    """One that is not would never be checked."""
    known = {
        "camera",
        "markers",
        "encoder",
        "odometry",
        "commands",
        "drift",
        "noise",
        "frames",
        "depth",
        "laser",
        "imu",
    }
    assert {key.partition(".")[0] for key in LIMITS} == known
    for key in LIMITS:
        table, *rest = key.split(".")
        words = "".join(f"{one} = {{ " for one in rest[:-1]) + f"{rest[-1]} = 'a text'" + " }" * len(rest[:-1])
        (tmp_path / "robot.toml").write_text(f"[{table}]\n{words}\n")
        read = {"depth": read_depth_robot, "laser": read_laser_robot}.get(table, read_robot)
        assert "no such key" not in refusal(read, tmp_path / "robot.toml"), key


def test_no_robot_toml(tmp_path: Path) -> None:
    refused(r"robot\.toml: there is no such file", read_robot, tmp_path / "robot.toml")

"""`bench render` of a robot with every sensor: read back, its factors are those of the simulated world."""

import shutil
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import refused as refused_command
from command import run
from recording_logs import of
from refusals import refused
from slamduel import load
from slamduel.bench.commands import detect as command_detect
from slamduel.bench.commands import noise as command_noise
from slamduel.bench.commands import render as command_render
from slamduel.core.factors import Dataset, Log
from slamduel.core.se2 import between, wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.fixes.geodetic import degrees, metres
from slamduel.datasets.recordings.write import write
from slamduel.datasets.worlds.aruco_room import BY_DEPTH, Options, aruco_room, recorded
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import drive as along
from slamduel.frontend.depth.log import looked_at
from slamduel.frontend.several.delays import delay, turned, turning
from slamduel.frontend.several.log import related_of
from tiers import first_quick

KINDS = ("frames", "ros1", "ros2", "mcap", "video")
WORLD = "seconds=8,frame_rate=2,scan_rate=5,depth=true,imu=true,gps=0.5,gps_sd=0.05,gps_x=0.2,compass=1,compass_sd=0.05"
SENSORS = "markers+laser+depth+wheels+gyro+compass+gps"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One drive as each kind of recording."""
    home = tmp_path_factory.mktemp("whole") / "out"
    drive = f"aruco-room[{WORLD},gyro=0.01]"
    assert run(command_render, drive, "--seed", "3", "--out", home, "--as", ",".join(KINDS), "--quiet") == 0
    return {name: home / name for name in KINDS}


@pytest.fixture(scope="module")
def world() -> Dataset:
    """The same drive as `bench run` sees it."""
    return load(f"aruco-room[{WORLD},gyro=0.01]", seed=3)


@pytest.fixture
def drive(folders: dict[str, Path], tmp_path: Path) -> Path:
    """A copy of the drive in files."""
    return shutil.copytree(folders["frames"], tmp_path / "drive")


@pytest.mark.parametrize("kind", first_quick(KINDS, 1))
def test_every_kind_has_the_factors_of_the_world(kind: str, folders: dict[str, Path], world: Dataset) -> None:
    log, found = world.log, of(folders[kind], sensors=SENSORS)
    for column in ("ids", "sighting_first", "loop_first", "loop_to"):
        np.testing.assert_array_equal(getattr(found, column), getattr(log, column))
    for column in ("t", "delta", "delta_cov", "z", "z_cov", "loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)
    assert log.notes["depth"]["motions"] > 10
    assert log.notes["laser"]["motions"] > 3
    assert log.fixes is not None
    assert found.fixes is not None
    np.testing.assert_array_equal(found.fixes.step, log.fixes.step)
    placed = np.isfinite(log.fixes.z[:, 0])
    assert (placed.sum(), (~placed).sum()) == (16, 8)
    np.testing.assert_allclose(found.fixes.z[placed, :2], log.fixes.z[placed, :2], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.fixes.arm, log.fixes.arm, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.fixes.cov, log.fixes.cov, rtol=0, atol=1e-12)
    # A level errs by some 0.005 rad, and the field is 63 degrees steep.
    assert np.abs(wrap(found.fixes.z[~placed, 2] - log.fixes.z[~placed, 2])).max() < 0.03
    assert not found.remarks


def test_turns_are_those_of_the_robot(folders: dict[str, Path], world: Dataset) -> None:
    gyro, simulated = of(folders["frames"], sensors=SENSORS).gyro, world.log.gyro
    assert gyro is not None
    assert simulated is not None
    np.testing.assert_array_equal(gyro.step, simulated.step)
    turned = wrap(np.diff(along(LOOP, 0.4, world.log.t)[0][:, 2]))[gyro.step - 1]
    assert np.abs(wrap(gyro.turn - turned)).max() < 4 * np.sqrt(gyro.var.max()) + 0.002


def test_degrees_are_metres_undone() -> None:
    origin, xy = np.array([-33.0, 179.999]), np.array([[0.0, 0.0], [500.0, -300.0], [-20.0, 40.0]])
    np.testing.assert_allclose(metres(degrees(xy, origin), origin), xy, rtol=0, atol=1e-7)


def shares(log: Log) -> float:
    """The mean normalised squared error of the log's relative poses, 1 where covariances are right."""
    true = along(LOOP, 0.4, log.t)[0]
    off = log.loop_delta - between(true[log.loop_to], true[log.loop_step])
    off[:, 2] = wrap(off[:, 2])
    return float(np.einsum("ni,nij,nj->n", off, np.linalg.inv(log.loop_cov), off).mean() / 3)


@pytest.mark.parametrize("seed", first_quick(range(8), 1))
def test_motions_by_depth_are_as_exact_as_they_say(seed: int) -> None:
    options = Options(seconds=20.0, frame_rate=2.0, depth=True, imu=True)
    log = aruco_room(options, generator("aruco-room", seed)).log
    assert len(log.loop_to) > 30
    assert 0.3 < shares(log) < 2.5


@pytest.mark.parametrize("seed", first_quick(range(8), 1))
def test_a_depth_camera_that_is_late_is_found_by_the_gyro(seed: int) -> None:
    options = Options(seconds=20.0, frame_rate=4.0, depth=True, imu=True, gyro=0.01, gyro_bias=0.5, blur=0.0)
    made = recorded(options, generator("aruco-room", seed))
    assert made.depth is not None
    known = turning(made.recording.motion, made.imu)
    assert known is not None
    for late in (0.0, 0.05):
        frames = [one._replace(seconds=one.seconds + late) for one in islice(made.depth.frames, 76)]
        related = related_of(looked_at(replace(made.depth, frames=frames), BY_DEPTH))
        seen = turned(related.t, related.at, related.to, related.delta[:, 2], related.cov[:, 2, 2])
        found = delay(known, seen)
        assert found is not None
        assert found.sd < 0.01
        assert abs(found.seconds - late) < 4 * found.sd
        assert found.odd == (late > 0)


@pytest.mark.parametrize("kind", first_quick(KINDS, 1))
def test_scans_and_depth_make_a_log_without_markers(kind: str, folders: dict[str, Path], world: Dataset) -> None:
    log, both = of(folders[kind], sensors="laser+depth+wheels+gps"), world.log
    assert not len(log.ids)
    assert "markers" not in log.notes
    assert log.gyro is None
    assert log.fixes is not None
    own = {round(one, 6) for one in log.t.tolist()}
    assert own <= {round(one, 6) for one in both.t.tolist()}  # the frames without a step of their own are not there
    assert len(log.loop_to) == log.notes["laser"]["motions"] + log.notes["depth"]["motions"]
    for column in ("loop_delta", "loop_cov"):
        np.testing.assert_allclose(getattr(log, column), getattr(both, column), rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.t[log.loop_step], both.t[both.loop_step], rtol=0, atol=1e-9)
    assert shares(log) < 2.5


def test_without_wheels_scans_and_depth_are_what_tells_the_motion(drive: Path) -> None:
    with (drive / "robot.toml").open("a") as file:
        file.write("\n[drift]\nposition = 0.5\nturning = 0.5\n")
    log = of(drive, sensors="laser+depth+gyro")
    assert not log.delta[1:].any()
    assert log.gyro is not None
    assert log.notes["depth"]["motions"] > 10


def test_the_page_says_what_a_log_of_scans_and_depth_has(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (folders["mcap"], "--out", tmp_path / "log", "--sensors", "laser,depth")
    assert run(command_detect, *words) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "scans of 201 beams and 17 depth frames in 8.00 s" in said
    assert "In the log: 22 motions by wheels" in said
    assert "16 positions by GPS and 8 headings by the compass; each measurement is in one of them" in said
    assert "sightings" not in said
    assert (tmp_path / "log" / "detection.html").is_file()
    assert run(command_noise, tmp_path / "log") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "No delay of the laser is known: its turns beside those of gyro or wheels do not tell it." in told
    assert "By the turns of the gyro the stamps of the depth are" in told
    assert "depth: delay by the turns of the gyro" in told
    refused = partial(refused_command, capsys, "detect", folders["mcap"], "--out", tmp_path / "other", "--sensors")
    assert "--poses: --sensors laser,depth is without markers" in refused("laser,depth", "--poses", tmp_path / "p.csv")


@pytest.mark.parametrize(("name", "value"), [("cameras", 2), ("building", True)])
def test_depth_is_that_of_one_camera_in_the_one_room(name: str, value: Any) -> None:
    options = replace(Options(seconds=2.0, depth=True), **{name: value})
    refused(f"options depth=true and {name}=.*, expected one of them", recorded, options, np.random.default_rng(1))


def test_a_depth_image_at_no_frames_time_is_refused(tmp_path: Path) -> None:
    made = recorded(Options(seconds=1.0, frame_rate=2.0, depth=True), np.random.default_rng(1))
    assert made.depth is not None
    (first, *others) = made.depth.frames
    object.__setattr__(made.depth, "frames", [first, *(one._replace(seconds=one.seconds + 0.01) for one in others)])
    places = {tmp_path / "drive": "frames"}
    refused(
        "a depth image is at .* s, expected the time of a frame", write, places, made.recording, None, depth=made.depth
    )
    assert not (tmp_path / "drive").exists()


@pytest.mark.slow
def test_a_depth_cameras_drive_has_positions_and_headings(tmp_path: Path) -> None:
    drive = "depth-room[laps=0.3,frame_rate=2,imu=true,gps=0.5,gps_sd=0.05,compass=1,compass_sd=0.05]"
    assert (
        run(command_render, drive, "--seed", "3", "--out", tmp_path / "out", "--as", "frames,mcap,tum", "--quiet") == 0
    )
    logs = [load(str(tmp_path / "out" / kind)).log for kind in ("frames", "mcap", "tum")]
    for log in logs:
        assert log.fixes is not None
        assert log.notes["fixes"]["positions"] > 10
        true = along(LOOP, 0.4, log.t[log.fixes.step])[0]
        placed = np.isfinite(log.fixes.z[:, 0])
        assert np.abs(log.fixes.z[placed, :2] - true[placed, :2]).max() < 4.5 * 0.05 + 0.15
        assert np.abs(wrap(log.fixes.z[~placed, 2] - true[~placed, 2])).max() < 4 * 0.05 + 0.1
    for log in logs[1:]:
        np.testing.assert_allclose(log.fixes.z, logs[0].fixes.z, rtol=0, atol=1e-6)

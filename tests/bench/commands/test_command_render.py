"""`bench render`: the drive that bench run sees, as recordings."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from command import run
from slamduel import load
from slamduel.bench.commands import render as command_render
from slamduel.core.se2 import wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.depth.open import open_depth
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.worlds.aruco_room import Options, aruco_room
from slamduel.datasets.worlds.depth_room import Drive, record

SHORT = "aruco-room[seconds=1,frame_rate=2]"

render = partial(run, command_render)


@pytest.mark.slow
def test_the_drive_is_the_one_that_bench_run_sees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert render(SHORT, "--seed", "7", "--out", str(tmp_path / "drive"), "--as", "mcap") == 0
    assert capsys.readouterr().out == f"an MCAP bag (ROS 2): {tmp_path / 'drive'}\n"
    found, truth = build(open_recording(tmp_path / "drive"))
    expected = aruco_room(Options(seconds=1.0, frame_rate=2.0), generator("aruco-room", 7))
    np.testing.assert_array_equal(found.ids, expected.log.ids)
    np.testing.assert_allclose(found.z, expected.log.z, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(truth.poses, expected.truth.poses)


def test_several_formats_get_a_folder_each(tmp_path: Path) -> None:
    assert render(SHORT, "--out", str(tmp_path / "out"), "--as", "frames, video", "--quiet") == 0
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["frames", "video"]
    one, other = (build(open_recording(tmp_path / "out" / name)).log for name in ("frames", "video"))
    np.testing.assert_allclose(one.z, other.z, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["ros1", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("ros2", "mcap"))])
def test_a_drive_with_a_gyro_has_the_same_turns_as_folder_and_bag(kind: str, tmp_path: Path) -> None:
    drive = "aruco-room[seconds=4,frame_rate=2,gyro=0.05,gyro_bias=1,gyro_start=given]"
    assert render(drive, "--out", str(tmp_path), "--as", f"frames,{kind}", "--quiet") == 0
    (one, truth), (other, _) = (build(open_recording(tmp_path / name)) for name in ("frames", kind))
    assert truth is not None
    assert one.gyro is not None
    assert other.gyro is not None
    np.testing.assert_array_equal(one.gyro.step, other.gyro.step)
    for name in ("turn", "var", "dt", "walk", "bias"):
        np.testing.assert_allclose(getattr(one.gyro, name), getattr(other.gyro, name), rtol=0, atol=1e-9)
    for name in ("t", "delta", "z"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-9)
    turned = np.diff(truth.poses[:, 2])[one.gyro.step - 1]
    off = wrap(one.gyro.turn - np.deg2rad(1.0) * one.gyro.dt - turned)
    assert np.abs(off).max() < 4 * np.sqrt(one.gyro.var.max())


@pytest.mark.slow
def test_a_depth_cameras_drive_with_a_gyro_has_the_same_turns_as_folder_and_bag(tmp_path: Path) -> None:
    drive = "depth-room[laps=0.2,frame_rate=2,gyro=0.05,gyro_bias=1]"
    assert render(drive, "--out", str(tmp_path), "--as", "frames,mcap", "--quiet") == 0
    one, other = (load(str(tmp_path / name)).log.gyro for name in ("frames", "mcap"))
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one.turn, other.turn, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_a_drive_of_a_depth_camera_is_the_one_that_bench_run_sees(tmp_path: Path) -> None:
    short = "depth-room[laps=0.05,frame_rate=2,readout=0.01]"
    assert render(short, "--seed", "4", "--out", str(tmp_path / "drive"), "--as", "tum,mcap", "--quiet") == 0
    drive, _ = record(Drive(laps=0.05, frame_rate=2.0, readout=0.01), generator("depth-room", 4))
    for name in ("tum", "mcap"):
        found = open_depth(tmp_path / "drive" / name)
        for one, ours in zip(found.recording.frames, drive.frames, strict=True):
            np.testing.assert_array_equal(one.grey, ours.grey)
            np.testing.assert_array_equal(one.depth, ours.depth)

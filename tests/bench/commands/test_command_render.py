"""`bench render`: the drive that bench run sees, as recordings."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from command import run
from slamduel.bench.commands import render as command_render
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

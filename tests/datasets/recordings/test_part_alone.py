"""A file that is one part of a recording, read without the others, is remarked; a drive of another day is not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import bags
from slamduel.datasets.bags.siblings import read_alone
from slamduel.datasets.recordings.recording import open_recording
from slamduel.datasets.recordings.robot import Robot, write_robot
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.wheels.motion import Drift

SECOND = 10**9
SUFFIX = {"ros1": ".bag", "ros2": ".db3", "mcap": ".mcap"}


def files(folder: Path, kind: str, names: Sequence[str], pause: float = 0.1) -> list[Path]:
    """One file of three images for each name, each `pause` s after the one before."""
    folder.mkdir(exist_ok=True)
    made, begin = list[Path](), SECOND
    for number, name in enumerate(names):
        inside = folder / f"part {number}"
        inside.mkdir()
        stamps = [begin + k * SECOND // 10 for k in range(3)]
        said = [bags.image(stamp, np.zeros((120, 160), np.uint8)) for stamp in stamps]
        written = bags.file_of(bags.write(inside, kind, said))
        made.append(written.rename(folder / (name + SUFFIX[kind])))
        begin = stamps[-1] + round(pause * SECOND)
    return made


@pytest.mark.parametrize("kind", SUFFIX)
def test_a_part_alone_is_a_remark(tmp_path: Path, kind: str) -> None:
    for path in files(tmp_path, kind, [f"drive_{k}" for k in range(3)]):
        (remark,) = read_alone(path)
        assert remark == (
            f"{path}: is one of the 3 parts of a recording, drive_0{SUFFIX[kind]} to drive_2{SUFFIX[kind]}: the "
            "log has nothing of the others"
        )


def test_names_of_ros_1_have_their_dates(tmp_path: Path) -> None:
    names = [f"drive_2026-01-02-10-00-{10 * k:02d}_{k}" for k in range(2)]
    assert all(read_alone(path) for path in files(tmp_path, "ros1", names))


def test_what_is_no_part_has_no_remark(tmp_path: Path) -> None:
    for folder, names, pause in (
        ("one", ["drive_0"], 0.1),
        ("days", ["drive_0", "drive_1"], 3600.0),
        ("others", ["drive_0", "robot_1", "drive"], 0.1),
        ("far", ["drive_0", "drive_7"], 0.1),
    ):
        for path in files(tmp_path / folder, "mcap", names, pause):
            assert read_alone(path) == [], path
    damaged, whole = files(tmp_path / "damaged", "mcap", ["drive_0", "drive_1"])
    damaged.write_bytes(damaged.read_bytes()[:100])
    assert read_alone(whole) == []


def test_the_remark_is_the_recordings(tmp_path: Path) -> None:
    first, _ = files(tmp_path, "mcap", ["drive_0", "drive_1"])
    camera = Camera(160, 120, (150.0, 150.0), (79.5, 59.5), (), mounting(0, 0, 0.3, 0))
    write_robot(
        tmp_path / "robot.toml", Robot("cart", Markers("4X4_50", 0.1), camera, camera.mounting, drift=Drift(1, 1))
    )
    (remark,) = open_recording(first).recording.remarks
    assert "drive_0.mcap: is one of the 2 parts of a recording" in remark

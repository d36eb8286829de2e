"""Bags that were split into parts: read whole in the order of time, and what is no recording of several parts."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import bags
import floor_drives as floor
from refusals import refusal, refused
from slamduel.bench.plan.load import load
from slamduel.datasets.bags.bag import Bag
from slamduel.datasets.recordings.rosbag import Topics, read
from slamduel.datasets.scans.open import OpenedScans, open_scans
from slamduel.frontend.laser.recording import LaserRecording
from slamduel.frontend.wheels.ticks import Ticks
from tiers import first_quick

SUFFIXES = {"ros1": ".bag", "mcap": ".mcap", "ros2": ".db3"}


@cache
def drive() -> LaserRecording:
    return floor.floor_drive(0.15)


def messages() -> list[bags.Said]:
    said = [*floor.scans(drive()), *floor.odometry(drive()), *floor.mounting()]
    return sorted(said, key=lambda one: one.stamp)


def part(path: Path, kind: str, said: Sequence[bags.Said]) -> Path:
    """Writes messages into one file, whose folder has no metadata.yaml."""
    folder = path.parent / f"{path.name} as written"
    folder.mkdir(parents=True)
    written = bags.file_of(bags.write(folder, kind, said))
    written.rename(path)
    for one in sorted(folder.rglob("*"), reverse=True):
        one.rmdir() if one.is_dir() else one.unlink()
    folder.rmdir()
    return path


def split(folder: Path, kind: str, names: Sequence[str]) -> list[Path]:
    """The drive in as many parts as there are names."""
    said, cuts = messages(), np.linspace(0, len(messages()), len(names) + 1).astype(int)
    ends = zip(names, cuts[:-1], cuts[1:], strict=True)
    return [part(folder / (name + SUFFIXES[kind]), kind, said[one:other]) for name, one, other in ends]


def opened(path: Path) -> OpenedScans:
    found = open_scans(path)
    assert found is not None
    return found


def same(one: OpenedScans, other: OpenedScans) -> None:
    np.testing.assert_array_equal(one.recording.t, other.recording.t)
    np.testing.assert_array_equal(one.recording.ranges, other.recording.ranges)
    np.testing.assert_array_equal(one.recording.odometry, other.recording.odometry)


DATED = ["2026-01-02-10-00-00_0", "2026-01-02-10-00-20_1", "2026-01-02-10-00-40_2"]
NAMES = {
    "ros1": [f"drive_{k}" for k in range(12)],  # 10 comes after 9
    "mcap": ["drive_0", "drive_1", "drive_2"],
    "ros2": ["rosbag2_2026_01_02-10_00_00_0", "rosbag2_2026_01_02-10_00_00_1"],
}


@pytest.mark.parametrize("kind", first_quick(["ros1", "mcap", "ros2"], 3))
def test_the_parts_are_read_as_one_recording(kind: str, tmp_path: Path) -> None:
    whole = opened(part(tmp_path / f"whole{SUFFIXES[kind]}", kind, messages()))
    parts = split(tmp_path / "parts", kind, NAMES[kind])
    found = opened(tmp_path / "parts")
    same(found, whole)
    assert found.remarks == []
    listed = {topic.name: topic.messages for topic in Bag(tmp_path / "parts").listed()}
    assert listed == {"/scan": len(drive().t), "/odom": len(drive().t), "/tf_static": 1}
    first = opened(parts[0])
    assert 2 <= len(first.recording.t) < len(drive().t)
    np.testing.assert_array_equal(first.recording.t, whole.recording.t[: len(first.recording.t)])
    (tmp_path / "parts" / "robot.toml").write_text("[laser]\nstep = 0.4\n")
    assert opened(tmp_path / "parts").settings.step == 0.4
    (tmp_path / "parts" / "robot.toml").write_text(f'[laser]\nsource = "{parts[0].name}"\n')
    same(opened(tmp_path / "parts"), first)


@pytest.mark.parametrize("kind", ["mcap", "ros2"])
def test_parts_that_a_metadata_yaml_lists_are_read_as_one_recording(kind: str, tmp_path: Path) -> None:
    """As `ros2 bag record --max-bag-size` leaves them; a part that is listed and not there is named."""
    whole = opened(bags.write(tmp_path, "mcap folder" if kind == "mcap" else kind, messages()))
    parts = split(tmp_path / "parts", kind, ["drive_0", "drive_1", "drive_2"])
    content = YAML(typ="safe").load(tmp_path / "drive" / "metadata.yaml")
    about, names = content["rosbag2_bagfile_information"], [one.name for one in parts]
    about |= {"relative_file_paths": names, "files": [about["files"][0] | {"path": name} for name in names]}
    with (tmp_path / "parts" / "metadata.yaml").open("w") as file:
        YAML().dump(content, file)
    found = opened(tmp_path / "parts")
    same(found, whole)
    assert found.remarks == []
    alone = opened(parts[1])
    assert 2 <= len(alone.recording.t) < len(drive().t)
    assert any("is one of the 3 parts of a recording" in one for one in alone.remarks)
    parts[1].unlink()
    assert parts[1].name in refusal(open_scans, tmp_path / "parts")


@pytest.mark.parametrize("kind", first_quick(["mcap", "ros1", "ros2"]))
def test_images_and_counts_are_read_over_all_parts(kind: str, tmp_path: Path) -> None:
    pixels = np.zeros((4, 6), np.uint8)
    said = [bags.counts(k * 10**7, k, k, k, k) for k in range(1, 30)]
    said += [bags.image(k * 10**7, pixels + k) for k in range(1, 30, 2)]
    said.sort(key=lambda one: one.stamp)
    for number, rows in enumerate((slice(0, 17), slice(17, 19), slice(19, None))):
        part(tmp_path / "bag" / f"drive_{number:03d}{SUFFIXES[kind]}", kind, said[rows])
    streams = read(tmp_path / "bag", Topics())
    assert [int(frame.image[0, 0]) for frame in streams.frames if frame.image is not None] == list(range(1, 30, 2))
    assert isinstance(streams.readings, Ticks)
    np.testing.assert_array_equal(streams.readings.counts[:, 0], np.arange(1, 30))
    assert streams.remarks == []


def test_names_of_parts_may_have_their_dates(tmp_path: Path) -> None:
    for number, stem in enumerate(("", "front_")):
        split(tmp_path / str(number), "ros1", [stem + name for name in DATED])
        found = opened(tmp_path / str(number))
        assert len(found.recording.t) == len(drive().t)
        assert found.remarks == []


def test_a_folder_of_parts_is_a_dataset_and_may_be_in_that_of_robot_toml(tmp_path: Path) -> None:
    split(tmp_path / "parts" / "bag", "mcap", ["drive_0", "drive_1", "drive_2"])
    log, _ = load(tmp_path / "parts" / "bag")
    (tmp_path / "parts" / "robot.toml").write_text('[laser]\nsource = "bag"\n')
    for path in (tmp_path / "parts", tmp_path / "parts" / "bag"):
        again, _ = load(path)
        np.testing.assert_array_equal(again.delta, log.delta)
    assert len(log) > 25


def test_a_missing_part_is_a_remark(tmp_path: Path) -> None:
    parts = split(tmp_path / "bag", "ros1", [f"drive_{k}" for k in range(5)])
    parts[2].unlink()
    (remark, *rest) = opened(tmp_path / "bag").remarks
    assert "bag: of the parts of the recording, up to drive_4.bag, number 2 is missing" in remark
    assert len(rest) == 1  # the odometry's gap
    parts[0].unlink()
    (tmp_path / "bag" / "drive_5.bag.active").write_bytes(b"#ROSBAG V2.0")
    active, remark = opened(tmp_path / "bag").remarks[:2]
    assert "number 0, 2 is missing" in remark
    assert "drive_5.bag.active: was not closed, and is left out; `rosbag reindex` may repair it" in active


def test_several_recordings_are_no_parts_of_one(tmp_path: Path) -> None:
    """Drives of several days, two robots at once, another name or kind among them."""
    said = messages()
    later = [one._replace(stamp=one.stamp + 3600 * floor.NS) for one in said]
    days = tmp_path / "days"
    part(days / "drive_1.bag", "ros1", said)
    part(days / "drive_2.bag", "ros1", later)
    words = refusal(open_scans, days)
    assert "drive_2.bag begins 3.56e+03 s after the end of drive_1.bag, expected the parts of one recording" in words
    part(tmp_path / "two" / "robot_0.bag", "ros1", said)
    part(tmp_path / "two" / "robot_1.bag", "ros1", said)
    refused(r"robot_1\.bag begins .* s before the end of robot_0\.bag", open_scans, tmp_path / "two")
    split(tmp_path / "mixed", "mcap", ["drive_0", "drive_1"])
    (tmp_path / "mixed" / "robot.toml").write_text("[laser]\n")
    part(tmp_path / "mixed" / "other.mcap", "mcap", said)
    refused(r"found drive_0\.mcap, drive_1\.mcap, other\.mcap, expected one rec", open_scans, tmp_path / "mixed")


def test_a_damaged_part_is_named(tmp_path: Path) -> None:
    parts = split(tmp_path / "bag", "ros1", ["drive_0", "drive_1", "drive_2"])
    parts[1].write_bytes(parts[1].read_bytes()[:3000])
    refused(r"drive_1\.bag: is damaged or not a ROS bag", open_scans, tmp_path / "bag")


def test_a_part_without_a_message_is_nothing(tmp_path: Path) -> None:
    split(tmp_path / "bag", "ros1", ["drive_0", "drive_1"])
    part(tmp_path / "bag" / "drive_2.bag", "ros1", [])
    assert len(opened(tmp_path / "bag").recording.t) == len(drive().t)

"""Tags that another program found, as sightings: those of `bench detect --poses`, poses alone, corners, messages."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
from slamduel.bench.detect.folder import Request
from slamduel.bench.detect.markers import MarkerFindings, detect
from slamduel.core.errors import InputError
from slamduel.core.factors import REMARKS, Log
from slamduel.core.se2 import Array
from slamduel.datasets.bags import bag as bag_module
from slamduel.datasets.bags.tag_types import register
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import read_robot, write_robot
from slamduel.frontend.camera.quaternions import quaternion
from slamduel.frontend.markers.aruco import Sighting
from slamduel.frontend.markers.noise import ProportionalNoise
from slamduel.frontend.markers.pipeline import build_log, see
from tag_drives import seen_from, tag_drive, written

Edit = Callable[[dict[str, Any]], dict[str, Any]]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Log]:
    """The folder of the drive, with its poses in tags.csv in place of its frames, and the log of its frames."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MarkerFindings, "figures", lambda _: [])
        folder = written(tag_drive(), tmp_path_factory.mktemp("tags") / "drive")
        opened = open_recording(folder)
        request = Request("drive", folder.parent / "log", poses=folder / "tags.csv")
        log = detect(opened.recording, opened.truth, request, lambda _: None).log
    for one in (folder / "frames").iterdir():
        one.unlink()
    (folder / "frames").rmdir()
    return folder, log


def all_sightings() -> list[tuple[float, list[Sighting]]]:
    recording = tag_drive().recording
    return [(frame.t, see(recording, frame).sightings) for frame in recording.frames]


def log_of(folder: Path, tags: str, **changes: Any) -> Log:
    """The log of the drive with another tags.csv, and changes of its robot."""
    (folder / "other.csv").write_text(tags, encoding="utf-8")
    robot = replace(read_robot(folder / "robot.toml"), **changes)
    return build(open_recording(folder / "other.csv", robot)).log


def rows_of(path: Path, *columns: str) -> str:
    """The file's rows with some of its columns alone."""
    lines = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    places = [lines[0].index(name) for name in columns]
    return "".join(",".join(line[place] for place in places) + "\n" for line in lines)


POSE = ("t", "id", "x", "y", "z", "qx", "qy", "qz", "qw")


def test_poses_with_covariances_give_the_sightings_of_the_frames(drive: tuple[Path, Log]) -> None:
    folder, log = drive
    found = build(open_recording(folder))
    assert found.truth is not None
    read = found.log
    np.testing.assert_array_equal(read.ids, log.ids)
    assert len(read.ids) > 10
    np.testing.assert_allclose(read.z, log.z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(read.z_cov, log.z_cov, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(read.t[read.sighting_step], log.t[log.sighting_step])
    assert read.notes["counts"]["sightings beyond 3 m"] == log.notes["counts"]["sightings beyond 3 m"] > 0
    assert REMARKS not in read.notes


def test_a_clock_and_an_exposure_are_added_to_the_stamps_as_to_those_of_frames(drive: tuple[Path, Log]) -> None:
    folder, log = drive
    other = rows_of(folder / "tags.csv", *(folder / "tags.csv").read_text(encoding="utf-8").split("\n")[0].split(","))
    late = log_of(folder, other, time_offset=0.25, exposure=0.02)
    with_tags = np.unique(log.t[log.sighting_step])
    np.testing.assert_allclose(np.unique(late.t[late.sighting_step])[:3], with_tags[:3] + 0.26, atol=1e-12)


def test_poses_without_covariances_have_the_stated_noise(drive: tuple[Path, Log]) -> None:
    folder, log = drive
    poses = rows_of(folder / "tags.csv", *POSE)
    stated = ProportionalNoise(k_range=0.02)
    read = log_of(folder, poses, noise=stated, camera=None)
    np.testing.assert_allclose(read.z, log.z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(read.z_cov, stated.cov(read.z), rtol=1e-12)
    assert "has no covariances" in read.notes[REMARKS][0]
    assert list(read.notes["camera"]) == ["mounting"]
    with pytest.raises(InputError, match=r"other.csv: the pose of tag \d+ at .* m has no covariance, which \[noise\]"):
        log_of(folder, poses, camera=None)


@pytest.mark.usefixtures("no_figures")
def test_poses_with_covariances_need_neither_dictionary_nor_side(drive: tuple[Path, Log], tmp_path: Path) -> None:
    folder, log = drive
    words = (folder / "robot.toml").read_text(encoding="utf-8")
    bare = re.sub(r"(dictionary|side) = .*\n", "", words)
    assert bare.count("=") == words.count("=") - 2
    robot = folder / "bare.toml"
    robot.write_text(bare, encoding="utf-8")
    opened = open_recording(folder, read_robot(robot))
    found = detect(opened.recording, opened.truth, Request("drive", tmp_path / "log"), lambda _: None).log
    np.testing.assert_array_equal(found.ids, log.ids)
    np.testing.assert_allclose(found.z_cov, log.z_cov, rtol=1e-9, atol=1e-15)
    assert set(found.notes["markers"]) == {"max_range"}
    assert "markers of poses alone" in (tmp_path / "log" / "detection.html").read_text(encoding="utf-8")
    for rows in (rows_of(folder / "tags.csv", *POSE), corner_rows()):
        (folder / "other.csv").write_text(rows, encoding="utf-8")
        with pytest.raises(InputError, match="markers has no 'side', expected a number above 0"):
            open_recording(folder / "other.csv", read_robot(robot))


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MarkerFindings, "figures", lambda _: [])


def test_a_calibration_and_the_noise_of_corners_tell_a_covariance(drive: tuple[Path, Log]) -> None:
    """It is that of the pose whose corners are those of the given pose."""
    folder, log = drive
    poses = rows_of(folder / "tags.csv", *POSE)
    read, twice = (log_of(folder, poses, corner_sd=sd, max_range=2.5) for sd in (0.01, 0.02))
    near = log.z[:, 0] <= 2.5
    np.testing.assert_allclose(read.z, log.z[near], rtol=0, atol=1e-9)
    rocking = log_of(folder, poses, corner_sd=1e-6, max_range=2.5).z_cov
    np.testing.assert_allclose(twice.z_cov - rocking, 4 * (read.z_cov - rocking), rtol=0.05, atol=1e-12)
    assert (read.z_cov[:, 0, 0] > rocking[:, 0, 0]).all()


def corner_rows(turns: int = 0, backwards: bool = False, sd: float = 0.0) -> str:
    rng = np.random.default_rng(1)
    names = ",".join(f"{axis}{k}" for k in range(4) for axis in "uv")
    lines = [f"t,id,{names}"]
    for t, found in all_sightings():
        for one in found:
            corners = np.roll(one.corners[::-1] if backwards else one.corners, turns, axis=0)
            corners = corners + sd * rng.normal(size=(4, 2))
            lines.append(",".join(map(repr, [t, one.id, *corners.ravel().tolist()])))
    return "\n".join(lines) + "\n"


def test_corners_give_the_pose_from_any_of_them_either_way(drive: tuple[Path, Log]) -> None:
    folder, log = drive
    read = log_of(folder, corner_rows(), corner_sd=0.1)
    assert len(read.ids) == len(log.ids)
    assert np.abs(read.z[:, 0] - log.z[:, 0]).max() < 0.02  # other weights, as the corners' true errors are not alike
    for turns, backwards in ((1, False), (3, True)):
        other = log_of(folder, corner_rows(turns, backwards), corner_sd=0.1)
        np.testing.assert_allclose(other.z, read.z, rtol=1e-5)
        np.testing.assert_allclose(other.z_cov, read.z_cov, rtol=1e-2)


def test_the_errors_of_corners_are_as_stated() -> None:
    """Corners at their true places with noise of 0.2 px: the centres have a NEES of 1."""
    known, rng = tag_drive(), np.random.default_rng(5)
    detector = known.recording.detector
    nees = list[float]()
    for t, found in all_sightings():
        for one in found:
            true = seen_from(known, t, one.id)
            outline = 0.08 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
            corners = detector.camera.project(outline @ true[:3, :3].T + true[:3, 3])
            for _ in range(8):
                seen = detector.at_corners(one.id, corners + 0.2 * rng.normal(size=(4, 2)), 0.2)
                assert seen is not None
                miss = seen.centre - true[:3, 3]
                nees.append(float(miss @ np.linalg.solve(seen.centre_cov, miss)) / 3)
    assert np.mean(nees) == pytest.approx(1, abs=0.25)


def test_what_no_log_takes_is_counted(drive: tuple[Path, Log]) -> None:
    folder, log = drive
    lines = rows_of(folder / "tags.csv", *POSE).splitlines()
    first = lines[1].split(",")
    behind = [*first[:1], "40", *first[2:4], "-1", *first[5:]]
    again = [first[0], "41", *first[2:]]
    content = "\n".join([lines[0], *(",".join(row) for row in (again, again, behind)), *lines[1:]]) + "\n"
    ignored = int(log.ids[0])
    markers = replace(read_robot(folder / "robot.toml").markers, ignore=(ignored,))
    read = log_of(folder, content, noise=ProportionalNoise(), markers=markers)
    counts = read.notes["counts"]
    assert counts["same id twice in a frame"] == 2
    assert counts["behind the camera"] == 1
    assert counts[f"id {ignored} is to be left out"] >= 1
    assert not {40, 41, ignored} & set(read.ids.tolist())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,id,x,y\n0,1,0,0\n", "line 1: found the columns t,id,x,y, expected t,id,x,y,z,qx,qy,qz,qw,c_x_x"),
        ("t,id,x,y,z,qx,qy,qz,qw\n0,1.5,0,0,1,1,0,0,0\n", "line 2: id is 1.5"),
        ("t,id,x,y,z,qx,qy,qz,qw\n0,-1,0,0,1,1,0,0,0\n", "line 2: id is -1, expected 0 to"),
        ("t,id,x,y,z,qx,qy,qz,qw\n0,1,0,0,1,1,0,0,1\n", "line 2: the quaternion qx, qy, qz, qw is of length 1.41"),
        ("t,id,x,y,z,qx,qy,qz,qw\n1,1,0,0,1,1,0,0,0\n0,1,0,0,1,1,0,0,0\n", "line 3: t is 0.0, expected no earlier"),
    ],
)
def test_a_faulty_row_is_named(drive: tuple[Path, Log], content: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        log_of(drive[0], content)
    assert f"other.csv, {message}" in str(error.value)


def test_a_covariance_that_is_none_is_named(drive: tuple[Path, Log]) -> None:
    text = (drive[0] / "tags.csv").read_text(encoding="utf-8").splitlines()
    row = text[1].split(",")
    row[text[0].split(",").index("c_x_x")] = "-1"
    with pytest.raises(InputError, match=r"other.csv, line 2: the covariance of x, y, z has the eigenvalue -1"):
        log_of(drive[0], "\n".join([text[0], ",".join(row)]) + "\n")


def test_corners_need_a_calibration(drive: tuple[Path, Log]) -> None:
    with pytest.raises(InputError, match="the camera's calibration is unknown"):
        log_of(drive[0], corner_rows(), camera=None)


# messages


def said(kind: str, cov: Array | None = None) -> list[bags.Said]:
    """Odometry by the true path, and the tags of each frame, with a bundle and odd ones."""
    known = tag_drive()
    messages = [
        bags.odometry(round(1e9 * t), x, y, (0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)))
        for t, (x, y, heading) in zip(known.truth.t.tolist(), known.truth.poses.tolist(), strict=True)
    ]
    for t, found in all_sightings():
        tags = [
            bags.Tag(
                (one.id,),
                [*one.centre.tolist(), *quaternion(one.pose[:3, :3]).tolist()],
                one.corners[::-1],
                one.cov if cov is None else cov,
            )
            for one in found
        ]
        messages.append(bags.tags(round(1e9 * t), kind, tags))
    return messages


def bag_of(folder: Path, home: Path, kind: str, messages: Sequence[bags.Said], **changes: Any) -> Path:
    """A bag with the drive's robot.toml beside it."""
    folder.mkdir(exist_ok=True)
    robot = read_robot(home / "robot.toml")
    write_robot(folder / "robot.toml", replace(robot, encoder=None, **changes))
    return bags.write(folder, kind, messages)


BAGS = [("ros1", bags.APRILTAG_ROS), ("mcap folder", bags.ISAAC), ("ros2", bags.ISAAC)]


@pytest.mark.parametrize(("kind", "package"), BAGS)
def test_messages_with_covariances_give_the_sightings_of_the_frames(
    tmp_path: Path, drive: tuple[Path, Log], kind: str, package: str
) -> None:
    read = build(open_recording(bag_of(tmp_path / "bag", drive[0], kind, said(package)))).log
    np.testing.assert_array_equal(read.ids, drive[1].ids)
    np.testing.assert_allclose(read.z, drive[1].z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(read.z_cov, drive[1].z_cov, rtol=1e-9, atol=1e-15)
    assert len(read) == len(drive[1])  # frames without a tag are messages, too


def test_a_covariance_of_zeros_is_unknown(tmp_path: Path, drive: tuple[Path, Log]) -> None:
    path = bag_of(tmp_path / "bag", drive[0], "ros1", said(bags.APRILTAG_ROS, np.zeros((6, 6))))
    read = build(open_recording(path)).log
    np.testing.assert_allclose(read.z, drive[1].z, rtol=0, atol=1e-9)
    robot = replace(read_robot(tmp_path / "bag" / "robot.toml"), camera=None)
    with pytest.raises(InputError, match="has no covariance"):
        build(open_recording(path, robot))


@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap folder"])
def test_messages_of_corners_are_located_by_the_calibration(tmp_path: Path, drive: tuple[Path, Log], kind: str) -> None:
    folder, _ = drive
    path = bag_of(tmp_path / "bag", folder, kind, said(bags.APRILTAG), rectified=False, corner_sd=0.1)
    read, rows = build(open_recording(path)).log, log_of(folder, corner_rows(), corner_sd=0.1)
    np.testing.assert_array_equal(read.ids, rows.ids)
    np.testing.assert_allclose(read.z, rows.z, rtol=1e-5)
    unsaid = replace(read_robot(tmp_path / "bag" / "robot.toml"), rectified=None)
    with pytest.raises(InputError, match=r"may be of raw or of rectified images, expected \[camera\] rectified"):
        open_recording(path, unsaid)


def test_a_bundle_and_tags_with_odd_numbers_are_left_out_and_counted(tmp_path: Path, drive: tuple[Path, Log]) -> None:
    messages = said(bags.APRILTAG_ROS)
    pose = np.array([0.0, 0, 1, 1, 0, 0, 0])
    odd = [
        bags.Tag((7, 8), pose, np.zeros((4, 2))),
        bags.Tag((9,), pose * np.nan, np.zeros((4, 2))),
        bags.Tag((-3,), pose, np.zeros((4, 2))),
    ]
    messages.append(bags.tags(round(1e9 * 0.5), bags.APRILTAG_ROS, odd))
    read = build(open_recording(bag_of(tmp_path / "bag", drive[0], "ros1", messages))).log
    assert read.notes["counts"]["a bundle of several tags, which is no landmark"] == 1
    assert "2 of" in read.notes[REMARKS][0]
    assert "tags of topic /tag_detections cannot be used and are left out" in read.notes[REMARKS][0]


def test_where_a_bag_lacks_the_definition_ours_stands(
    tmp_path: Path, drive: tuple[Path, Log], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = bag_of(tmp_path / "bag", drive[0], "ros2", said(bags.ISAAC))
    monkeypatch.setattr(bag_module, "register", lambda types, name, _: register(types, name, ""))
    np.testing.assert_array_equal(build(open_recording(path)).log.ids, drive[1].ids)


def test_tags_are_taken_in_place_of_images_where_robot_toml_says_so(tmp_path: Path, drive: tuple[Path, Log]) -> None:
    picture = bags.image(round(1e9), np.full((480, 640), 90, np.uint8))
    path = bag_of(tmp_path / "bag", drive[0], "mcap folder", [*said(bags.ISAAC), picture])
    robot = read_robot(tmp_path / "bag" / "robot.toml")
    assert not len(build(open_recording(path, robot)).log.ids)
    chosen = replace(robot, topics=robot.topics._replace(tags="/tag_detections"))
    assert len(build(open_recording(path, chosen)).log.ids) == len(drive[1].ids)


def test_a_detection_shows_tags_without_images(tmp_path: Path, drive: tuple[Path, Log]) -> None:
    opened = open_recording(drive[0])
    found = detect(opened.recording, opened.truth, Request("drive", tmp_path / "log"), lambda _: None)
    assert len(found.log.ids) == len(drive[1].ids)
    assert not any("Corners fit" in sentence for sentence in found.headline())
    assert "px" not in (tmp_path / "log" / "detection.html").read_text(encoding="utf-8").split("dictionary")[0][-40:]
    assert {one["error"] for one in found.as_json("log")["markers"]} == {None}
    assert not opened.pictures
    assert build_log(open_recording(drive[0]).recording).digest == found.log.digest

"""Folders of colour and depth images: joined by their times, with what cannot be used left out and counted."""

from pathlib import Path

import numpy as np
import pytest

from depth_views import CAMERA, RATE, START, depth_at, grey_at, odometry_csv, png, robot_toml, tum_folder, usable
from fuzzing import survivors
from refusals import refusal
from slamduel.datasets.depth.folder import read_camera_truth
from slamduel.datasets.depth.open import OpenedDepth, open_depth
from slamduel.datasets.rendering.disturbances import raised, rocked
from slamduel.frontend.camera.calibration import write_opencv
from slamduel.frontend.camera.quaternions import quaternion
from slamduel.frontend.depth.recording import DepthFrame


def opened(path: Path) -> OpenedDepth:
    found = open_depth(path)
    assert found is not None
    return found


def frames_of(path: Path) -> list[DepthFrame]:
    return list(opened(path).recording.frames)


def refused(path: Path) -> str:
    return refusal(frames_of, path)


def test_a_tum_folder_is_read_with_its_own_units_and_times(tmp_path: Path) -> None:
    found = opened(tum_folder(tmp_path / "drive"))
    frames = list(found.recording.frames)
    assert [frame.seconds for frame in frames] == pytest.approx(START + np.arange(6) / RATE, abs=1e-6)
    for k, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.grey, grey_at(k))
        np.testing.assert_array_equal(frame.depth, (depth_at(k) / 1000).astype(np.float32))
        np.testing.assert_array_equal(frame.colour[:, :, 1], grey_at(k))
    assert found.length == 6
    assert found.recording.name == "depth robot"
    assert found.recording.motion is None
    np.testing.assert_allclose(found.recording.camera.mounting, CAMERA.mounting, atol=1e-12)


def test_a_recording_has_the_floors_of_a_real_camera_unless_its_robot_toml_says_otherwise(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    settings = opened(folder).settings
    assert (settings.floor, settings.turn_floor, settings.floor_share) == (0.005, 0.0026, 0.1)
    robot_toml(folder, "floor = 0.001\nfloor_share = 0")
    settings = opened(folder).settings
    assert (settings.floor, settings.turn_floor, settings.floor_share) == (0.001, 0.0026, 0.0)


def test_colour_and_depth_are_joined_with_their_nearest(tmp_path: Path) -> None:
    """Stamps as a Kinect's: depth 5 to 15 ms after or before colour, one of each missing somewhere."""
    t = START + np.arange(10) / 30
    colour = np.delete(t, 3)  # files 0 to 8
    depth = np.delete(t + np.resize([0.012, -0.006, 0.005, -0.015], 10), 6)
    found = opened(tum_folder(tmp_path / "drive", colour_at=colour, depth_times=depth))
    frames = list(found.recording.frames)
    joined = [k for k in range(10) if k not in (3, 6)]
    expected = [(int(np.searchsorted(colour, t[k])), int(np.argmin(abs(depth - t[k])))) for k in joined]
    assert len(frames) == 8
    for frame, (of_colour, of_depth) in zip(frames, expected, strict=True):
        np.testing.assert_array_equal(frame.grey, grey_at(of_colour))
        np.testing.assert_array_equal(frame.depth, (depth_at(of_depth) / 1000).astype(np.float32))
        assert frame.seconds == pytest.approx(colour[of_colour], abs=1e-6)
    assert found.recording.left_out == {"images without a depth image": 1, "depth images without an image": 1}


def test_images_too_far_apart_are_not_joined(tmp_path: Path) -> None:
    t = START + np.arange(6) / RATE
    late = np.where(np.arange(6) == 2, t + 0.03, t + 0.01)
    folder = tum_folder(tmp_path / "drive", depth_times=late)
    found = opened(folder)
    assert len(list(found.recording.frames)) == 5
    assert found.recording.left_out["images without a depth image"] == 1
    robot_toml(folder, "within = 0.04")
    assert len(frames_of(folder)) == 6
    said = refused(tum_folder(tmp_path / "far", depth_times=t + 0.05))
    assert "found 6 images without a depth image and 6 depth images without an image" in said
    assert said.endswith("expected an image and a depth image at most 0.02 s apart.")


def test_frames_outside_the_odometry_are_left_out(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    odometry_csv(folder, START + 0.15, START + 0.47)
    found = opened(folder)
    assert [round(frame.seconds - START, 6) for frame in found.recording.frames] == [0.2, 0.3, 0.4]
    assert found.recording.left_out == {"frames without odometry around them": 3}
    odometry_csv(folder, START + 50, START + 60)
    assert f"no frame is within the time of the odometry: frames are from {START} to {START + 0.5} s" in refused(folder)


def test_the_clock_and_the_exposure_move_the_frames(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    robot_toml(folder, camera="time_offset = 0.25\nexposure = 0.02")
    assert frames_of(folder)[0].seconds == pytest.approx(START + 0.26)


def test_the_truth_is_of_the_camera_and_may_cover_a_part(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    planar = np.array([[0.1, -0.2, 0.3], [0.4, 0.1, 2.8], [0.5, 0.3, -3.0]])
    cameras = [pose @ rocked(0.03, -0.02) @ CAMERA.mounting for pose in raised(planar)]
    lines = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    for k, pose in enumerate(cameras):
        numbers = [START + 0.1 + 0.1 * k, *pose[:3, 3], *quaternion(pose[:3, :3])]
        lines.append(" ".join(f"{number:.9f}" for number in numbers))
    (folder / "groundtruth.txt").write_text("\n".join(lines) + "\n")
    truth = opened(folder).truth
    np.testing.assert_allclose(truth.t, START + 0.1 + 0.1 * np.arange(3), atol=1e-9)
    np.testing.assert_allclose(truth.poses, planar, atol=1e-8)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1000.1 0 0 0 0 0 1", "line 2: found '1000.1 0 0 0 0 0 1', expected t x y z qx qy qz qw"),
        ("1000.1 0 0 x 0 0 0 1", "line 2: found '1000.1 0 0 x 0 0 0 1'"),
        ("1000.1 0 0 0 0 0 0 3", "the last four of length 1"),
        ("999.0 0 0 0 0 0 0 1", "line 2: t is 999.0 s, expected later than 1000.0 s"),
        ("1000.1 0 0 0 0 0 0 1", "at 1000.1 s the robot would lean by 110 degrees"),
    ],
)
def test_a_faulty_truth_is_refused(tmp_path: Path, line: str, said: str) -> None:
    first = " ".join(map(str, [1000.0, 0, 0, 1, *quaternion(CAMERA.mounting[:3, :3]).tolist()]))
    (tmp_path / "groundtruth.txt").write_text(f"{first}\n{line}\n")
    assert said in refusal(read_camera_truth, tmp_path, CAMERA.mounting)


def spoil(folder: Path, k: int, content: bytes | None, name: str = "depth") -> Path:
    """Replaces the k-th file of a list; None: removes it."""
    file = sorted((folder / name).iterdir())[k]
    if content is None:
        file.unlink()
    else:
        file.write_bytes(content)
    return file


WHOLE = png(5 * depth_at(0))

FAULTS = {
    "missing": (None, "depth images that are missing", "does not exist, expected the image that is listed"),
    "truncated": (WHOLE[: len(WHOLE) // 2], "depth images that cannot be decoded", "expected a whole image file"),
    "its end is missing": (WHOLE[:-12], "depth images that cannot be decoded", "expected a whole image file"),
    "empty": (b"", "depth images that cannot be decoded", "cannot be decoded"),
    "8 bits": (png(grey_at(0)), "depth images of 8 bits", "has 8 bits in a pixel, expected 16"),
    "in colour": (png(np.dstack([depth_at(0)] * 3)), "depth images of several values", "has 3 values in a pixel"),
    "all zero": (png(0 * depth_at(0)), "depth images without any depth", "has no depth anywhere, expected some"),
    "another size": (
        png(depth_at(0)[::2, ::2].copy()),
        "depth images of another size",
        "has 80x60 pixels, expected the",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_depth_image_is_left_out_and_counted(tmp_path: Path, fault: str) -> None:
    content, reason, words = FAULTS[fault]
    folder = tum_folder(tmp_path / "drive")
    file = spoil(folder, 2, content)
    found = opened(folder)
    for _ in range(2):
        assert len(list(found.recording.frames)) == 5
        assert found.recording.left_out == {reason: 1}
        (remark,) = found.recording.remarks
        assert remark.startswith(f"{folder}: 1 {reason} are left out; {file} ")
        assert words in remark


@pytest.mark.parametrize("fault", FAULTS)
def test_a_recording_of_bad_depth_images_alone_is_refused(tmp_path: Path, fault: str) -> None:
    content, _, words = FAULTS[fault]
    folder = tum_folder(tmp_path / "drive", frames=3)
    files = [spoil(folder, 0 if content is None else k, content) for k in range(3)]
    said = refused(folder)
    assert said.startswith(f"{folder}: no frame can be used; {files[0]} ")
    assert words in said


def test_bad_pictures_are_left_out_and_counted(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    spoil(folder, 1, None, "rgb")
    spoil(folder, 3, png(grey_at(0)[:60].copy()), "rgb")
    spoil(folder, 3, b"not an image", "rgb")
    found = opened(folder)
    assert len(list(found.recording.frames)) == 4
    assert found.recording.left_out == {"images that are missing": 1, "images that cannot be decoded": 1}
    spoil(folder, 4, png(grey_at(0)[:60].copy()), "rgb")
    assert len(list(found.recording.frames)) == 3
    assert found.recording.left_out["images of another size"] == 1
    assert "has 160x60 pixels, expected the 160x120 of its camera's calibration" in found.recording.remarks[-1]


def test_pictures_of_16_bits_are_read_as_8(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive", frames=2)
    spoil(folder, 0, png((256 * grey_at(0).astype(np.uint16)).astype(np.uint16)), "rgb")
    np.testing.assert_array_equal(frames_of(folder)[0].grey, grey_at(0))


def test_lists_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive")
    whole = (folder / "depth.txt").read_text()
    for text, said in (
        ("", "depth.txt: the file is empty."),
        ("# only words\n", "depth.txt: found no images"),
        ("1000.0\n", "depth.txt, line 1: found '1000.0', expected a time in seconds and a file's name."),
        ("x depth/1.png\n", "line 1: found 'x depth/1.png'"),
        ("2.0 a.png\n2.0 b.png\n", "line 2: the time is 2.0 s, expected later than 2.0 s."),
    ):
        (folder / "depth.txt").write_text(text)
        assert said in refused(folder)
    (folder / "depth.txt").unlink()
    assert refused(folder) == f"{folder}: has rgb.txt and no depth.txt, expected both lists of images."
    (folder / "depth.txt").write_text(whole)
    (folder / "rgb.txt").unlink()
    assert refused(folder) == f"{folder}: has depth.txt and no rgb.txt, expected both lists of images."


def test_a_table_of_frames_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    robot_toml(tmp_path)
    (tmp_path / "a.png").write_bytes(png(grey_at(0)))
    (tmp_path / "a-depth.png").write_bytes(png(depth_at(0)))
    for rows, said in (
        ("", "frames.csv: found no rows, expected at least one."),
        ("a.png,1.0\n", "frames.csv, line 2: found 'a.png,1.0', expected two files' names and a time in seconds."),
        ("a.png,a-depth.png,later\n", "line 2: found 'a.png,a-depth.png,later'"),
        ("a.png,a-depth.png,1\na.png,a-depth.png,1\n", "line 3: t is 1.0, expected later than 1.0."),
    ):
        (tmp_path / "frames.csv").write_text(f"image,depth,t\n{rows}")
        assert said in refused(tmp_path)
    (tmp_path / "frames.csv").write_text("image,depth,t\na.png,a-depth.png,1\n")
    (frame,) = frames_of(tmp_path)
    np.testing.assert_array_equal(frame.depth, (depth_at(0) / 1000).astype(np.float32))


def test_other_units_are_told(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive", frames=2, depth="units = 2500")
    np.testing.assert_array_equal(frames_of(folder)[0].depth, (depth_at(0) / 500).astype(np.float32))


@pytest.mark.parametrize(
    ("depth", "said"),
    [
        ("units = 0", "robot.toml, line 7: depth.units: found 0, expected a number above 0."),
        (
            "units = 0.001",
            "depth.units: found 0.001, expected units per metre from 1 to 1e+06 (1e+03 if",
        ),
        ("within = 20", "depth.within: found 20, expected seconds from 0 to 10 (0.02 if this is in milliseconds)."),
        (
            "pose = {rpy = [0, 0, 90]}",
            "depth.pose.rpy: found 90, expected radians from -3.15 to 3.15 (1.57",
        ),
        ("unit = 1000", "depth.unit: there is no such key; did you mean 'units'?"),
        ('features = "surf"', "depth.features: found 'surf', expected one of 'orb', 'sift'."),
        ("step = 100.0", "depth.step: found 100.0, expected a number from 0.02 to 10."),
        ("landmarks = true\nloops = true", "depth: options landmarks and loops: found both true"),
        ("registered = false", "[depth] registered is false, expected calibration and pose of its camera"),
        ('calibration = "calibration.yaml"', "[depth] has a calibration, expected its pose"),
        ('calibration = "calibration.yaml"\nregistered = true', "depth.registered: is true beside a calibration"),
        ('calibration = "other.yaml"', "depth.calibration: there is no file"),
        ("pose = { xyz = [1, 2] }", "depth.pose.xyz: found [1, 2], expected 3 numbers."),
    ],
)
def test_faults_of_robot_toml_are_named(tmp_path: Path, depth: str, said: str) -> None:
    assert said in refused(tum_folder(tmp_path / "drive", frames=1, depth=depth))


def test_a_folder_without_camera_or_mounting_is_refused(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive", frames=1)
    (folder / "robot.toml").write_text("[depth]\n")
    assert "images in files have no camera_info, expected [camera] calibration" in refused(folder)
    (folder / "robot.toml").write_text('[camera]\ncalibration = "calibration.yaml"\n[depth]\n')
    assert "expected [camera] mounting in robot.toml" in refused(folder)
    (folder / "robot.toml").unlink()
    assert "expected [camera] calibration" in refused(folder)


def test_counters_are_refused_beside_depth(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "drive", frames=1)
    (folder / "ticks.csv").write_text("t,left,right\n0,0,0\n2000,1,1\n")
    assert "has counts of wheels, expected odometry.csv (t,x,y,heading) beside a depth camera." in refused(folder)


def test_what_is_of_another_kind_is_left_to_others(tmp_path: Path) -> None:
    (tmp_path / "drive" / "frames").mkdir(parents=True)
    (tmp_path / "drive" / "frames.csv").write_text("frame,t\n")
    assert open_depth(tmp_path / "drive") is None
    (tmp_path / "drive" / "robot.toml").write_text('[markers]\ndictionary = "4X4_50"\nside = 0.1\n')
    assert open_depth(tmp_path / "drive") is None
    folder = tum_folder(tmp_path / "other", frames=1)
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(f'{text}\n[markers]\ndictionary = "4X4_50"\nside = 0.1\n')
    assert "depth: is given beside [markers], expected one robot.toml for each front end." in refused(folder)
    write_opencv(folder / "calibration.yaml", CAMERA)


@pytest.mark.parametrize("name", ["rgb.txt", "depth.txt", "groundtruth.txt", "odometry.csv", "robot.toml"])
def test_a_damaged_file_is_read_or_refused_with_a_sentence(tmp_path: Path, name: str) -> None:
    folder = tum_folder(tmp_path / "drive", frames=3)
    odometry_csv(folder, START - 0.2, START + 0.5)
    poses = [f"{START + k / RATE} 0 0 0.75 -0.57 0.57 -0.41 0.41" for k in range(3)]
    (folder / "groundtruth.txt").write_text("\n".join(["# truth", *poses]) + "\n")

    def read(_: Path) -> list[DepthFrame]:
        found = open_depth(folder)
        return [] if found is None else list(found.recording.frames)

    survivors(read, folder / name, 60, 1, usable)

"""Recordings on disk: whatever kind of file they are in, they become the same log, or a sentence says why not."""

import itertools
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import bags
from refusals import refused
from slamduel.core.factors import Map, Truth
from slamduel.core.se2 import Array
from slamduel.datasets.recordings import any_recording, live, write
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import Robot, read_robot, write_robot
from slamduel.datasets.recordings.robot_camera import FrameSource
from slamduel.datasets.truth import sample, write_truth
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.markers import Markers, find
from slamduel.frontend.markers.pipeline import Frame
from slamduel.frontend.wheels.encoder import Encoder
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.ticks import Ticks, readings
from tiers import first_quick

CAMERA = Camera(160, 120, (150.0, 150.0), (79.5, 59.5), (), mounting(0, 0, 0.3, 0))
ENCODER = Encoder(1e-3, 1e-3, 0.3, 0.02, "distance")
ROBOT = Robot("cart", Markers("4X4_50", 0.1), CAMERA, CAMERA.mounting, encoder=ENCODER)
TIMES = [round(0.1 * k, 6) for k in range(10)]


def picture(number: int) -> Image:
    """A frame in which marker 4, 30 px wide, goes to the right by 2 px a frame."""
    image = np.full((120, 160), 128, np.uint8)
    paper = np.pad(np.asarray(find("4X4_50").generateImageMarker(4, 30), np.uint8), 6, constant_values=255)
    left = 30 + 2 * number
    image[40 : 40 + len(paper), left : left + len(paper)] = paper
    return image


def ticks() -> str:
    rows = [(round(0.05 * k, 6), 20 * k + (k % 3), 15 * k) for k in range(21)]
    return "t,left,right\n" + "".join(f"{t},{left},{right}\n" for t, left, right in rows)


def robot_in(folder: Path, robot: Robot = ROBOT) -> Path:
    folder.mkdir(exist_ok=True)
    write_robot(folder / "robot.toml", robot)
    return folder


def frames_in(folder: Path, names: Sequence[str] | None = None, listed: bool = True, robot: Robot = ROBOT) -> Path:
    """A recording of ten pictures."""
    robot_in(folder, robot)
    names = names or [f"{k:06d}.png" for k in range(10)]
    (folder / "frames").mkdir()
    for number, name in enumerate(names):
        assert cv2.imwrite(str(folder / "frames" / name), picture(number))
    if listed:
        rows = "".join(f"{name},{t}\n" for name, t in zip(names, TIMES, strict=True))
        (folder / "frames.csv").write_text("frame,t\n" + rows)
    (folder / "ticks.csv").write_text(ticks())
    return folder


def video_in(folder: Path, name: str = "drive.mkv", codec: str = "FFV1", listed: bool = True) -> Path:
    """A recording of the same ten pictures, as a video of 10 frames a second."""
    robot_in(folder)
    four = [ord(letter) for letter in codec]
    writer = cv2.VideoWriter(str(folder / name), sum(c << 8 * k for k, c in enumerate(four)), 10.0, (160, 120))
    assert writer.isOpened()
    for number in range(10):
        writer.write(cv2.cvtColor(picture(number), cv2.COLOR_GRAY2BGR))
    writer.release()
    if listed:
        (folder / "frames.csv").write_text("frame,t\n" + "".join(f"{k},{t}\n" for k, t in enumerate(TIMES)))
    (folder / "ticks.csv").write_text(ticks())
    return folder


def robot_with(**changes: Any) -> Robot:
    return replace(ROBOT, **changes)


def counts(folder: Path, robot: Robot | None = None) -> dict[str, int]:
    return dict(build(open_recording(folder, robot)).log.notes["counts"])


def test_frames_a_video_and_every_way_to_tell_the_time_make_one_log(tmp_path: Path) -> None:
    one = open_recording(frames_in(tmp_path / "frames"))
    assert one.length == 10
    log = build(one).log
    assert log.name == "cart"
    assert log.remarks == []
    assert log.t.tolist() == TIMES
    assert log.ids.tolist() == [4] * 10
    np.testing.assert_allclose(log.z[:, 0], np.hypot(0.5, (64.5 - 79.5 + 2 * np.arange(10)) / 300), atol=0.02)
    fps = FrameSource(fps=10.0)
    seconds = [f"{t:.6f}.png" for t in TIMES]
    for folder in (
        frames_in(tmp_path / "fps", listed=False, robot=robot_with(frames=fps)),
        frames_in(tmp_path / "named", seconds, listed=False),
        video_in(tmp_path / "video"),
        video_in(tmp_path / "own stamps", listed=False),
        video_in(tmp_path / "avi", "drive.avi", listed=False),
    ):
        other = build(open_recording(folder)).log
        for name in ("t", "delta", "z"):
            np.testing.assert_allclose(getattr(other, name), getattr(log, name), 0, 1e-9, err_msg=folder.name)


def test_counts_are_interpolated_at_the_middle_of_the_exposure(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a", robot=robot_with(time_offset=0.013, exposure=0.02))
    log = build(open_recording(folder)).log
    np.testing.assert_allclose(log.t, np.array(TIMES) + 0.023, atol=1e-12)
    rows = np.loadtxt(folder / "ticks.csv", delimiter=",", skiprows=1)
    expected = ENCODER.odometry(*readings(Ticks(rows[:, 0], rows[:, 1:]), 0.123, 0.223))
    np.testing.assert_allclose(log.delta[2], expected.delta, atol=1e-12)


def test_a_rolling_shutters_frames_are_stamped_at_their_first_row(tmp_path: Path) -> None:
    """The middle row is exposed half of the readout and of the exposure later, and detection knows of the shutter."""
    folder = frames_in(tmp_path / "a", robot=robot_with(time_offset=0.01, exposure=0.02, readout=0.03))
    opened = open_recording(folder)
    assert opened.recording.detector.camera.readout == 0.03
    log = build(opened).log
    np.testing.assert_allclose(log.t, np.array(TIMES) + 0.035, atol=1e-12)
    assert log.notes["camera"]["readout"] == 0.03


@pytest.mark.parametrize(("digits", "unit"), [(19, 1e-9), (16, 1e-6), (13, 1e-3)])
def test_names_that_count_from_1970(tmp_path: Path, digits: int, unit: float) -> None:
    begin = 1_403_636_579
    names = [f"{round((begin + t) / unit)}.png" for t in TIMES]
    assert len(names[0]) - 4 == digits
    folder = frames_in(tmp_path / "a", names, listed=False, robot=robot_with(time_offset=-begin))
    np.testing.assert_allclose(build(open_recording(folder)).log.t, TIMES, rtol=0, atol=5e-7)  # doubles around 1.4e9


def test_names_are_sorted_by_their_numbers(tmp_path: Path) -> None:
    names = [f"cam_{k}.png" for k in range(3, 13)]  # as text, 10 comes before 3
    log = build(open_recording(frames_in(tmp_path, names, False, robot_with(frames=FrameSource(None, 10.0, 0.05))))).log
    assert (np.diff(log.z[:, 1]) < 0).all()
    np.testing.assert_allclose(log.t, np.array(TIMES) + 0.05)


def test_odometry_instead_of_ticks_and_a_folder_that_is_bare(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    (folder / "ticks.csv").unlink()
    rows = "".join(f"{0.1 * k},{0.05 * k},0,{0.01 * k}\n" for k in range(11))
    (folder / "odometry.csv").write_text("t,x,y,heading\n" + rows)
    log = build(open_recording(folder)).log
    np.testing.assert_allclose(np.hypot(*log.delta[1:, :2].T), 0.05, atol=1e-12)
    assert "odometry" in log.notes
    robot = read_robot(folder / "robot.toml")
    for name in ("frames.csv", "odometry.csv"):
        (folder / name).rename(folder / "frames" / name)
    (folder / "robot.toml").unlink()
    assert build(open_recording(folder / "frames", robot)).log.digest == log.digest


def test_a_robot_beside_the_recording_and_one_of_two(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    log = build(open_recording(folder)).log
    assert build(open_recording(folder / "frames")).log.digest == log.digest
    video_in(folder, "two.avi", listed=False)
    refused(r"a: found frames, two.avi, expected one recording: .*\[frames\] source", open_recording, folder)
    robot_in(folder, robot_with(frames=FrameSource("frames")))
    assert build(open_recording(folder)).log.digest == log.digest
    robot_in(folder, robot_with(frames=FrameSource("two.avi")))
    (folder / "frames.csv").unlink()
    assert build(open_recording(folder)).log.digest != log.digest
    robot_in(folder, robot_with(frames=FrameSource("three.avi")))
    refused(r"there is no .*three\.avi, which is the \[frames\] source in robot\.toml", open_recording, folder)


def test_pictures_are_grey_and_not_turned(tmp_path: Path) -> None:
    """A JPEG whose note says that the camera was on its side."""
    folder = frames_in(tmp_path / "a")
    exif = bytes.fromhex("ffe1 0022 45786966 0000 4d4d 002a 00000008 0001 0112 0003 00000001 0006 0000 00000000")
    for number in range(10):
        good, plain = cv2.imencode(".jpg", cv2.cvtColor(picture(number), cv2.COLOR_GRAY2BGR))
        assert good
        (folder / "frames" / f"{number:06d}.jpg").write_bytes(plain.tobytes()[:2] + exif + plain.tobytes()[2:])
    turned = cv2.imread(str(folder / "frames" / "000000.jpg"))
    assert turned.shape[:2] == (160, 120)  # the note is understood by those who look at it
    (folder / "frames.csv").write_text((folder / "frames.csv").read_text().replace(".png", ".jpg"))
    frames = list(open_recording(folder).recording.frames)
    assert {frame.image.shape if frame.image is not None else () for frame in frames} == {(120, 160)}
    assert counts(folder)["sightings"] == 10


def test_a_video_is_not_turned(tmp_path: Path) -> None:
    """An MP4 whose head asks for a quarter turn, in place of none."""
    folder = video_in(tmp_path / "a", "drive.mp4", "mp4v")
    none = b"".join(n.to_bytes(4, "big", signed=True) for n in (65536, 0, 0, 0, 65536, 0, 0, 0, 2**30))
    quarter = b"".join(n.to_bytes(4, "big", signed=True) for n in (0, 65536, 0, -65536, 0, 0, 0, 0, 2**30))
    content = (folder / "drive.mp4").read_bytes()
    track = content.index(none, content.index(b"tkhd"))
    (folder / "drive.mp4").write_bytes(content[:track] + quarter + content[track + len(none) :])
    _, turned = cv2.VideoCapture(str(folder / "drive.mp4")).read()
    assert turned.shape[:2] == (160, 120)  # the note is understood by those who look at it
    assert counts(folder)["sightings"] == 10


@pytest.mark.parametrize("kind", first_quick(["ros1", "ros2", "mcap"]))
def test_a_bag_that_tells_of_its_camera(tmp_path: Path, kind: write.Kind) -> None:
    source = frames_in(tmp_path / "a")
    log = build(open_recording(source)).log
    write.write({tmp_path / "b": kind}, open_recording(source).recording, None)
    for path in (tmp_path / "b" / "calibration.yaml", tmp_path / "b" / "robot.toml"):
        path.unlink()
    robot = read_robot(robot_in(tmp_path / "c", robot_with(camera=None)) / "robot.toml")
    found = build(open_recording(tmp_path / "b", robot)).log
    np.testing.assert_allclose(found.z, log.z, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.delta[1:], log.delta[1:], rtol=0, atol=1e-9)
    bag = next(path for path in (tmp_path / "b").iterdir() if path.name.startswith("drive"))
    assert build(open_recording(bag, robot)).log.digest == found.digest


def test_bad_frames_are_left_out_and_counted(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = frames_in(tmp_path / "a")
    (folder / "frames" / "000001.png").write_bytes(b"")
    whole = (folder / "frames" / "000002.png").read_bytes()
    (folder / "frames" / "000002.png").write_bytes(whole[: len(whole) // 2])
    (folder / "frames" / "000003.png").write_bytes(b"this is no picture")
    found = counts(folder)
    assert found["frames"] == 10
    assert found["frames that could not be decoded"] == 3
    assert found["sightings"] == 7
    for name in ("0", "4", "5", "6", "7", "8", "9"):
        (folder / "frames" / f"00000{name}.png").write_bytes(whole[:100])
    refused("a: none of its 10 frames can be decoded, expected at least one", counts, folder)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("name", ["drive.mkv", "drive.avi"])
def test_a_video_that_was_cut(tmp_path: Path, listed: bool, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    folder = video_in(tmp_path / "a", name, listed=listed)
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: len(whole) * 6 // 10])
    found = counts(folder)
    assert found["frames"] == 10
    assert 1 < found["frames that could not be decoded"] < 10
    assert found["sightings"] == 10 - found["frames that could not be decoded"]
    assert capfd.readouterr().err == ""


def test_a_video_of_which_some_frames_are_named(tmp_path: Path) -> None:
    folder = video_in(tmp_path / "a")
    whole = build(open_recording(folder)).log
    (folder / "frames.csv").write_text("frame,t\n2,0.2\n3,0.3\n7,0.7\n12,0.95\n")
    log = build(open_recording(folder)).log
    np.testing.assert_array_equal(log.z, whole.z[[2, 3, 7]])
    assert log.notes["counts"]["frames that could not be decoded"] == 1


def test_video_that_cannot_be_used(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = video_in(tmp_path / "a", "drive.mp4", "mp4v")
    whole = (folder / "drive.mp4").read_bytes()
    assert counts(folder)["frames"] == 10
    (folder / "drive.mp4").write_bytes(whole[: len(whole) // 2])
    refused(r"drive\.mp4: cannot be opened as a video: truncated before its index", open_recording, folder)
    (folder / "drive.mp4").write_bytes(b"")
    refused(r"drive\.mp4: the file is empty, expected a video", open_recording, folder)
    (folder / "drive.mp4").write_bytes(whole)
    for rows, message in {
        "": r"frames\.csv: found no rows",
        "0,0\n0,1\n": r"frames\.csv, line 3: frame is 0, expected numbers from 0 that increase",
        "-1,0\n": r"frames\.csv, line 2: frame is -1, expected numbers from 0",
        "0,0.5\n1,0.5\n": r"frames\.csv, line 3: t is 0\.5, expected later than 0\.5",
    }.items():
        (folder / "frames.csv").write_text("frame,t\n" + rows)
        refused(message, open_recording, folder)
    assert capfd.readouterr().err == ""


def counted(change: Callable[[Array], object]) -> Callable[[Path], None]:
    """Changes the table (n, 3) of wheel counts in place."""

    def spoil(folder: Path) -> None:
        rows = np.loadtxt(folder / "ticks.csv", delimiter=",", skiprows=1)
        change(rows)
        np.savetxt(folder / "ticks.csv", rows, delimiter=",", header="t,left,right", comments="", fmt="%.17g")

    return spoil


def begins_again(rows: Array) -> None:
    rows[:, 1:] += 10000
    rows[12:, 1:] -= rows[12, 1:]


wrapped = counted(lambda rows: np.mod(rows[:, 1:] + 65400, 65536, out=rows[:, 1:]))
reset, later = counted(begins_again), counted(lambda rows: np.add(rows[:, 0], 100, out=rows[:, 0]))


def replaced(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        content = (folder / name).read_text()
        assert old in content
        (folder / name).write_text(content.replace(old, new, 1))

    return change


def removed(*names: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for name in names:
            (folder / name).unlink()

    return change


def robot_is(**changes: Any) -> Callable[[Path], None]:
    return lambda folder: write_robot(folder / "robot.toml", robot_with(**changes))


LARGER = Camera(640, 480, (600.0, 600.0), (319.5, 239.5), (), CAMERA.mounting)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (wrapped, "a: encoder: between readings 6 and 7, .* if this counter of 16 bits wrapped, set counter_bits = 16"),
        (reset, "a: encoder: between readings 11 and 12, .* this looks like a reset"),
        (later, r"a: no frame is within .*: frames are from 0\.0 to 0\.9 s, readings from 100\.0 to .*offset"),
        (removed("ticks.csv"), r"a: the robot's motion is unknown; expected ticks\.csv, odometry\.csv or c.*\[drift\]"),
        (removed("calibration.yaml"), r"robot\.toml, line \d+: camera\.calibration: there is no file .*n\.yaml"),
        (removed("robot.toml"), r"a: found no robot\.toml"),
        (removed("frames.csv"), r"frames: the time of 000000\.png is unknown; expected .*frames\.csv.*\] fps"),
        (removed("frames/000003.png"), r"frames\.csv, line 5: there is no file .*000003\.png"),
        (robot_is(camera=None), r'a: the camera\'s calibration is unknown.*calibration = "calibration\.yaml"'),
        (robot_is(camera=LARGER), "a: frame 0 has 160x120 pixels, expected the 640x480 of the camera's calibration"),
        (robot_is(encoder=None), r"a: has wheel counts, expected \[encoder\] in robot\.toml"),
        (replaced("calibration.yaml", "camera_matrix", "camera"), "calibration.yaml: found no camera_matrix"),
        (replaced("frames.csv", "frame,t", "file,time"), "frames.csv, line 1: found 'file,time', expected the columns"),
        (replaced("frames.csv", ",0.3\n", ",0.2\n"), r"frames\.csv, line 5: t is 0\.2, expected later than 0\.2"),
        (replaced("frames.csv", ",0.3\n", ",x\n"), "frames.csv, line 5: found '000003.png,x', expected a file's name"),
        (replaced("frames.csv", ",0.3\n", ",nan\n"), "frames.csv, line 5: found '000003.png,nan', expected"),
        (replaced("frames.csv", ",0.3\n", "\n"), "frames.csv, line 5: found '000003.png', expected"),
        (replaced("ticks.csv", "\n0.1,", "\n0.05,"), r"ticks\.csv, line 4: t is 0\.05, expected later than 0\.05"),
        (replaced("ticks.csv", ",30\n", ",nan\n"), "ticks.csv, line 4: right is nan, expected a finite number"),
        (replaced("ticks.csv", ticks(), "t,left,right\n"), "ticks.csv: found no rows, expected at least one"),
        (replaced("ticks.csv", "left,", "links,"), "ticks.csv, line 1: column 'links' in place of 'left'"),
    ],
)
def test_what_cannot_be_used_is_a_sentence(tmp_path: Path, change: Callable[[Path], None], message: str) -> None:
    folder = frames_in(tmp_path / "a")
    change(folder)
    refused(message, counts, folder)


def test_more_that_cannot_be_used(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a", [f"{0.1 * k:.2f}.png" for k in range(10)], listed=False)
    cv2.imwrite(str(folder / "frames" / "0.200.png"), picture(0))
    refused(r"0\.200\.png: has the same time as 0\.20\.png, expected a later one", open_recording, folder)
    (folder / "odometry.csv").write_text("t,x,y,heading\n0,0,0,0\n")
    (folder / "frames" / "0.200.png").unlink()
    refused(r"a: has ticks\.csv as well as odometry\.csv, expected one of them", open_recording, folder)
    empty = robot_in(tmp_path / "b")
    refused("b: found none, expected one recording: a folder of frames, a video, tags.csv, or a", open_recording, empty)
    (empty / "frames").mkdir()
    refused("frames: has no pictures, expected frames in files such as 000001", open_recording, empty)
    refused("nowhere: there is no such file or folder, expected a recording", open_recording, tmp_path / "nowhere")
    refused(r"\.yaml: found a file of an unknown kind, expected a folder", open_recording, empty / "calibration.yaml")


def test_a_counter_that_wraps_is_undone_where_its_width_is_told(tmp_path: Path) -> None:
    log = build(open_recording(frames_in(tmp_path / "a"))).log
    folder = frames_in(tmp_path / "b", robot=robot_with(counter_bits=16))
    wrapped(folder)
    np.testing.assert_allclose(build(open_recording(folder)).log.delta[1:], log.delta[1:], rtol=0, atol=1e-12)


def test_frames_alone_need_drift(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a", robot=robot_with(drift=Drift(0.4, 0.6)))
    (folder / "ticks.csv").unlink()
    log = build(open_recording(folder)).log
    assert len(log) == 10
    np.testing.assert_array_equal(log.delta[1:], 0)
    np.testing.assert_allclose(log.delta_cov[1, 0, 0], 0.4**2 * 0.1, rtol=1e-4)  # and the floor


def test_truth_is_taken_to_the_times_of_the_log(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    t = np.array([0.1, 0.2, 0.25, 0.35, 0.4, 1.5])
    poses = np.stack((t, 2 * t, 3.0 + t), axis=-1)
    poses[:, 2] = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
    write_truth(folder, Truth(t, poses, Map(np.array([4]), np.array([[1.0, 2.0]]), None), None, "truth"))
    found = build(open_recording(folder)).truth
    assert found.t.tolist() == [0.1, 0.2, 0.3, 0.4]  # of what follows, nothing is known for more than 0.5 s
    np.testing.assert_array_equal(found.poses[[0, 1, 3]], poses[[0, 1, 4]])
    np.testing.assert_allclose(found.poses[2], [0.3, 0.6, 3.3 - 2 * np.pi], atol=1e-12)
    assert found.map.ids.tolist() == [4]


def test_truth_of_one_pose_and_of_none() -> None:
    one = Truth(np.array([0.5]), np.array([[1.0, 2.0, 3.0]]), None, None, "truth")
    assert sample(one, np.array([0.1, 0.5, 0.9])).t.tolist() == [0.5]
    none = Truth(np.zeros(0), np.zeros((0, 3)), None, None, "truth")
    assert sample(none, np.array([0.1])) is none


def test_a_recording_is_a_dataset(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    rng = np.random.default_rng(0)
    made = any_recording.source.make(any_recording.Options(str(folder)), rng)
    assert made.log.digest == build(open_recording(folder)).log.digest
    assert not any_recording.source.costly  # its files may change: a cache would not know
    other = robot_in(tmp_path / "b", robot_with(max_range=0.1)) / "robot.toml"
    assert len(any_recording.source.make(any_recording.Options(str(folder), str(other)), rng).log.ids) == 0
    refused(r"option path of dataset recording is not given", any_recording.source.make, any_recording.Options(), rng)
    refused(
        r"found camera:0, expected a recording, not", any_recording.source.make, any_recording.Options("camera:0"), rng
    )


class Fake:
    """A camera that gives three pictures, with a miss before the last, and then only misses."""

    def __init__(self) -> None:
        self.asked, self.released = 0, False

    def read(self) -> tuple[bool, Image | None]:
        self.asked += 1
        return (True, picture(self.asked)) if self.asked in (1, 2, 4) else (False, None)

    def release(self) -> None:
        self.released = True


def test_a_live_camera() -> None:
    fake, frames = Fake(), list[Frame]()
    refused("camera:0: gave no frame 30 times in a row, expected a", frames.extend, live.Live(fake, "camera:0", None))
    assert len(frames) == 34
    fake, frames = Fake(), list[Frame]()
    for frame in live.Live(fake, "camera:0", None):
        frames.append(frame)
        if len(frames) == 4:
            break
    assert [frame.image is None for frame in frames] == [False, False, True, False]
    assert all(before.t < after.t for before, after in itertools.pairwise(frames))
    assert fake.asked == 4
    fake = Fake()
    assert list(live.Live(fake, "camera:0", 0.0)) == []
    assert fake.released


def test_ctrl_c_ends_a_live_camera() -> None:
    before = signal.getsignal(signal.SIGINT)
    taken = 0
    for frame in live.Live(fake := Fake(), "camera:0", None):
        taken += 1
        assert frame.image is not None
        signal.raise_signal(signal.SIGINT)
    assert taken == 1
    assert fake.released
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, asking for a camera may open a window that asks back")
def test_a_camera_that_is_not_there(capfd: pytest.CaptureFixture[str]) -> None:
    drifting = robot_with(drift=Drift(0.4, 0.6))
    refused("camera:97: there is no such camera, or", open_recording, Path("camera:97"), drifting)
    refused("camera:x: found the camera number 'x'", open_recording, Path("camera:x"), ROBOT)
    refused(r"camera:0: found no robot\.toml", open_recording, Path("camera:0"))
    assert capfd.readouterr().err == ""


def test_readings_that_are_missing_and_frames_without_them_are_remarked(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    lines = (folder / "ticks.csv").read_text().splitlines()
    kept = [line for line in lines[1:] if (t := float(line.split(",")[0])) < 0.8 and not 0.1 < t < 0.65]
    (folder / "ticks.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    log = build(open_recording(folder)).log
    hole, frames = log.remarks
    assert "encoder: no reading for 0.55 s, from 0.1 to 0.65 s, where 0.05 s are usual" in hole
    assert frames == "cart: 2 of 10 frames (20 %) are before or after the encoder readings, 0 to 0.75 s, and left out"
    assert log.notes["counts"]["frames without encoder readings"] == 2
    rows = "".join(f"{0.1 * k},{0.05 * k},0,0\n" for k in range(6))
    (folder / "ticks.csv").unlink()
    (folder / "odometry.csv").write_text("t,x,y,heading\n" + rows)
    assert counts(folder)["frames without odometry"] == 4


def test_truth_of_another_clock_is_remarked(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "a")
    write_truth(folder, Truth(100 + np.arange(3.0), np.zeros((3, 3)), None, None, "truth"))
    log, truth = build(open_recording(folder))
    assert len(truth.t) == 0
    (remark,) = log.remarks
    assert remark.startswith("truth.tum has no pose at the log's times, 0.0 to 0.9 s, those of its 3 are from 100.0 to")
    assert remark.endswith("expected the same clock")


@pytest.mark.parametrize("name", ["truth.tum", "landmarks.csv", "odometry.csv"])
def test_a_link_to_nothing_or_to_itself_is_no_missing_file(tmp_path: Path, name: str) -> None:
    folder = frames_in(tmp_path / "a")
    (folder / "ticks.csv").rename(folder / "ticks") if name == "odometry.csv" else None
    (folder / name).symlink_to(folder / "nowhere")
    refused(f"{name}: is a link to nothing, expected a file", open_recording, folder)
    (folder / name).unlink()
    (folder / name).symlink_to(folder / name)
    refused(f"{name}: cannot be read", open_recording, folder)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (replace(CAMERA, focal=(300.0, 150.0)), "camera_info has fx = 150 px, the calibration in robot.toml"),
        (replace(CAMERA, width=320, height=240), "camera_info is of 160x120 pixels, the calibration in robot.toml"),
    ],
)
def test_a_bags_camera_that_contradicts_the_calibration_is_remarked(tmp_path: Path, camera: Camera, words: str) -> None:
    source = frames_in(tmp_path / "a")
    write.write({tmp_path / "b": "mcap"}, open_recording(source).recording, None)
    assert open_recording(tmp_path / "b").recording.remarks == []
    robot = read_robot(robot_in(tmp_path / "c", robot_with(camera=camera)) / "robot.toml")
    (remark,) = open_recording(tmp_path / "b", robot).recording.remarks
    assert words in remark


@pytest.mark.parametrize("given", ["camera_info", "a calibration of the whole", "a calibration of the part"])
def test_a_part_of_a_camera_binned_measures_as_the_camera(given: str, tmp_path: Path) -> None:
    """Marker 4 at twice the resolution, of whose frames the right part is sent, binned."""
    whole = replace(CAMERA, width=360, height=240, focal=(300.0, 300.0), centre=(199.5, 119.5))
    part = replace(CAMERA, focal=(150.0, 150.0), centre=((199.5 - 40 + 0.5) / 2 - 0.5, 59.5))
    info = bags.camera_info(0, whole.matrix.ravel(), [0.0] * 5)

    def windowed(new: Any) -> dict[str, Any]:
        roi = new("sensor_msgs/msg/RegionOfInterest", 40, 0, 240, 320, False)
        sizes = {"width": 360, "height": 240, "binning_x": 2, "binning_y": 2, "roi": roi}
        return info.build(new) | sizes

    stamps = [10**9 + round(1e9 * t) for t in TIMES]
    said = [bags.image(stamp, picture(k)) for k, stamp in enumerate(stamps)]
    said += [bags.counts(10**9 + 50_000_000 * k, *[20.0 * k + k % 3] * 2, *[15.0 * k] * 2) for k in range(21)]
    said += [info._replace(stamp=stamps[0], build=windowed)]
    said.sort(key=lambda one: one.stamp)
    (tmp_path / "a").mkdir()
    camera = {"camera_info": None, "a calibration of the whole": whole, "a calibration of the part": part}[given]
    path = bags.write(tmp_path / "a", "mcap", said)
    robot_in(tmp_path / "a", robot_with(camera=camera))
    opened = open_recording(path, read_robot(tmp_path / "a" / "robot.toml"))
    assert opened.recording.remarks == []
    log = build(opened).log
    expected = build(open_recording(frames_in(tmp_path / "b", robot=robot_with(camera=part)))).log
    assert len(log.ids) == 10
    np.testing.assert_allclose(log.z, expected.z, atol=1e-9)


def test_a_recording_one_level_below_is_named(tmp_path: Path) -> None:
    source = frames_in(tmp_path / "a")
    write.write({tmp_path / "b": "mcap"}, open_recording(source).recording, None)
    (tmp_path / "b").rename(tmp_path / "a" / "inner")
    outer = robot_in(tmp_path / "outer")
    (tmp_path / "a" / "inner").rename(outer / "inner")
    refused(r"outer: has no metadata\.yaml and no recording itself, but .*inner/drive.* has", open_recording, outer)


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    folder = robot_in(tmp_path / "a")
    for name in ("drive.mkv", "drive.mcap"):
        os.mkfifo(folder / name)
        refused(f"{name}: is a pipe or a device, expected a regular file", open_recording, folder / name)


def test_frames_need_a_dictionary_and_a_side(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "drive")
    words = (folder / "robot.toml").read_text()
    for key, line in (("dictionary", 'dictionary = "4X4_50"\n'), ("side", "side = 0.1\n")):
        assert line in words
        (folder / "robot.toml").write_text(words.replace(line, ""))
        refused(rf"robot\.toml, line \d+: markers has no '{key}', expected a", open_recording, folder)


def test_frames_beside_tags_are_refused_by_both_names(tmp_path: Path) -> None:
    folder = frames_in(tmp_path / "drive")
    (folder / "tags.csv").write_text("t,id,x,y,z,qx,qy,qz,qw\n0.1,4,0,0,1,1,0,0,0\n")
    refused(r"found frames, tags\.csv, expected one recording: .*\[frames\] source", open_recording, folder)
    robot_in(folder, robot_with(frames=FrameSource("frames")))
    assert open_recording(folder).pictures
    for picture_file in (folder / "frames").iterdir():
        picture_file.rename(folder / picture_file.name)
    (folder / "frames").rmdir()
    robot_in(folder)
    refused(r"drive: has 000000\.png and 9 more pictures as well as tags\.csv, expected one", open_recording, folder)
    for source, shown in ((".", True), ("tags.csv", False)):
        robot_in(folder, robot_with(frames=FrameSource(source)))
        assert open_recording(folder).pictures == shown

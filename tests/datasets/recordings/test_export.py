"""One rendered drive, written as every kind of recording there is and read back: the same sightings and motion."""

import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from refusals import refused
from slamduel.core.factors import Log, Truth
from slamduel.core.se2 import wrap
from slamduel.datasets.bags import bag
from slamduel.datasets.cache import generator
from slamduel.datasets.recordings import rosbag
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import read_robot
from slamduel.datasets.recordings.rosbag import Topics
from slamduel.datasets.recordings.write import FORMATS, write
from slamduel.datasets.recordings.write_bag import Kind
from slamduel.datasets.worlds.aruco_room import Options, record
from slamduel.frontend.camera.camera import Model
from slamduel.frontend.markers.pipeline import Frame, Recording, build_log
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.track import Poses, Track, TrackNoise
from tiers import first_quick

Drive = tuple[Recording, Truth]
EXACT = ("frames", "video", "ros1", "ros2", "mcap")


@pytest.fixture(scope="module")
def drive() -> Drive:
    recording, truth = record(Options(seconds=2.0), generator("aruco-room", 3))
    return replace(recording, frames=list(recording.frames)), truth


@pytest.fixture(scope="module")
def log(drive: Drive) -> Log:
    return build_log(drive[0])


@pytest.fixture(scope="module")
def folders(drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    home = tmp_path_factory.mktemp("exports")
    places = {home / name: name for name in FORMATS}
    write(places, *drive)
    return {name: folder for folder, name in places.items()}


@pytest.mark.parametrize("name", first_quick(EXACT, 2))
def test_lossless_formats_give_the_same_factors(name: str, drive: Drive, log: Log, folders: dict[str, Path]) -> None:
    opened = open_recording(folders[name])
    assert opened.length == len(log.t)
    for ours, theirs in zip(drive[0].frames, opened.recording.frames, strict=True):
        grey = theirs.image if theirs.image.ndim == 2 else theirs.image[:, :, 1]
        np.testing.assert_array_equal(grey, ours.image)
    found, truth = build(opened)
    assert len(log.ids) > 30
    np.testing.assert_array_equal(found.ids, log.ids)
    np.testing.assert_array_equal(found.sighting_step, log.sighting_step)
    for column in ("t", "z", "z_cov", "delta", "delta_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(log, column), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.prior.pose, log.prior.pose, atol=1e-15)
    np.testing.assert_allclose(found.prior.cov, log.prior.cov, rtol=1e-12)
    np.testing.assert_array_equal(truth.poses, drive[1].poses)
    np.testing.assert_array_equal(truth.map.xy, drive[1].map.xy)


def test_a_rolling_shutter_is_written_and_read(tmp_path: Path) -> None:
    made, truth = record(Options(seconds=0.5, readout=0.04, noise="propagated"), generator("aruco-room", 3))
    made = replace(made, frames=list(made.frames))
    write({tmp_path / "a": "frames"}, made, truth)
    robot = read_robot(tmp_path / "a" / "robot.toml")
    assert (robot.readout, robot.time_offset) == (0.04, -0.02)
    expected, found = build_log(made), build(open_recording(tmp_path / "a")).log
    np.testing.assert_array_equal(found.ids, expected.ids)
    for column in ("t", "z", "z_cov"):
        np.testing.assert_allclose(getattr(found, column), getattr(expected, column), 0, 1e-7)  # stamps are rounded
    told = (tmp_path / "a" / "robot.toml").read_text()
    (tmp_path / "a" / "robot.toml").write_text(told.replace("readout = 0.04", "").replace("time_offset = -0.02", ""))
    ignored = build(open_recording(tmp_path / "a")).log
    assert np.abs(ignored.z - expected.z).max() > 1e-3


def test_lossy_video_is_within_the_noise(log: Log, folders: dict[str, Path]) -> None:
    found = build(open_recording(folders["mp4"])).log
    np.testing.assert_array_equal(found.t, log.t)
    exact = {key: row for row, key in enumerate(zip(log.sighting_step, log.ids, strict=True))}
    lossy = {key: row for row, key in enumerate(zip(found.sighting_step, found.ids, strict=True))}
    both = exact.keys() & lossy.keys()
    # A marker at the edge of being seen may go either way.
    assert len(exact) - len(both) <= 0.1 * len(exact)
    assert len(lossy) - len(both) <= 0.1 * len(exact)
    misses = np.array([found.z[lossy[key]] - log.z[exact[key]] for key in both])
    cov = np.array([log.z_cov[exact[key]] for key in both])
    # 2 would be as much as the stated noise itself; what the codec adds has to be far from doubling it.
    squares = np.einsum("ki,kij,kj->k", misses, np.linalg.inv(cov), misses)
    assert 0 < squares.mean() < 0.5


@pytest.mark.parametrize("name", ["frames", "ros1", "ros2", "mcap"])
def test_summed_up_poses_go_out_and_come_back(name: str, drive: Drive, tmp_path: Path) -> None:
    recording, truth = drive
    t = truth.t
    poses = truth.poses + np.array([1.0, 2.0, 0.0])
    recording = replace(recording, motion=Track(t, poses, TrackNoise(forward=0.03)))
    write({tmp_path / "out": name}, recording, None)
    opened = open_recording(tmp_path / "out")
    assert opened.truth is None
    motion = opened.recording.motion
    assert isinstance(motion, Track)
    assert motion.noise == TrackNoise(forward=0.03)
    np.testing.assert_array_equal(motion.t, t)
    np.testing.assert_array_equal(motion.poses[:, :2], poses[:, :2])
    np.testing.assert_allclose(wrap(motion.poses[:, 2] - poses[:, 2]), 0, atol=1e-15)
    expected = recording.motion.odometry(t[2], t[5])
    found = motion.odometry(t[2], t[5])
    np.testing.assert_allclose(found.delta, expected.delta, atol=1e-12)
    np.testing.assert_allclose(found.cov, expected.cov, atol=1e-12)


def some(recording: Recording, images: list[Any]) -> Recording:
    """`recording` with other frames, half a second apart."""
    return replace(recording, frames=[Frame(0.5 * k, image) for k, image in enumerate(images)])


RNG = np.random.default_rng(5)


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("shape", [(480, 640), (480, 640, 3)])
def test_every_pixel_comes_back(name: str, shape: tuple[int, ...], drive: Drive, tmp_path: Path) -> None:
    images = [RNG.integers(0, 256, shape, np.uint8) for _ in range(3)]
    write({tmp_path / "out": name}, some(drive[0], [images[0], None, *images[1:]]), None)
    found = list(open_recording(tmp_path / "out").recording.frames)
    assert [frame.t for frame in found] == [0, 1, 1.5]
    for frame, image in zip(found, images, strict=True):
        if frame.image.ndim == image.ndim:
            np.testing.assert_array_equal(frame.image, image)
        else:  # made grey on reading, where OpenCV's decoder of pictures rounds in its own way
            grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(int)
            assert np.abs(frame.image - grey).max() <= (1 if name == "frames" else 0)
    if name == "frames":
        first = cv2.imread(str(tmp_path / "out" / "frames" / "000000.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(first, images[0])


@pytest.mark.parametrize("name", FORMATS)
def test_one_frame_without_motion_is_a_recording(name: str, drive: Drive, tmp_path: Path) -> None:
    still = replace(some(drive[0], [np.zeros((480, 640), np.uint8)]), motion=Drift(0.2, 0.3))
    write({tmp_path / "out": name}, still, None)
    found = open_recording(tmp_path / "out").recording
    assert found.motion == Drift(0.2, 0.3)
    assert [frame.t for frame in found.frames] == [0]


@pytest.mark.parametrize("name", FORMATS)
def test_whole_or_not_at_all(name: str, drive: Drive, tmp_path: Path) -> None:
    def breaks() -> Iterator[Frame]:
        yield from list(drive[0].frames)[:3]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write({tmp_path / "out": name}, replace(drive[0], frames=breaks()), None)
    refused("no frame with an image", write, {tmp_path / "out": name}, some(drive[0], [None, None]), None)
    assert list(tmp_path.iterdir()) == []


def test_what_is_there_stays(drive: Drive, tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "mine").write_text("mine")
    refused("b: exists and is not an empty folder", write, {tmp_path / "a": "frames", tmp_path / "b": "mcap"}, *drive)
    assert [one.name for one in tmp_path.rglob("*")] == ["b", "mine"]
    (tmp_path / "file").write_text("x")
    refused("file", write, {tmp_path / "file" / "in": "frames"}, *drive)


AGAIN = r"frame 2 is at 0\.5 s, expected later than 0\.5 s"
REFUSED: list[Any] = [
    *((kind, (480, 640), (0.0, 0.5, 0.5), AGAIN) for kind in ("frames", "video", "mp4", "ros1")),
    *((kind, (480, 641), (0.0, 0.5), "of 641x480 pixels, expected even") for kind in ("video", "mp4")),
    *((kind, (481, 640), (0.0, 0.5), "of 640x481 pixels, expected even") for kind in ("video", "mp4")),
    ("ros1", (480, 640), (-1.0,), r"found a time of -1\.0 s"),
]


@pytest.mark.parametrize(("kind", "shape", "times", "words"), REFUSED)
def test_frames_that_a_format_cannot_hold_are_refused(
    kind: str, shape: tuple[int, int], times: Any, words: str, drive: Drive, tmp_path: Path
) -> None:
    """Out of order, of odd size in a video, before 1970 in a bag."""
    odd = replace(drive[0], frames=[Frame(t, np.zeros(shape, np.uint8)) for t in times])
    refused(words, write, {tmp_path / "out": kind}, odd, None)
    assert list(tmp_path.iterdir()) == []


def test_the_truth_is_written_where_it_is_known(drive: Drive, tmp_path: Path) -> None:
    recording = some(drive[0], [np.zeros((480, 640), np.uint8)] * 2)
    write({tmp_path / "frames": "frames"}, recording, drive[1])
    others = {"video": "drive.mkv", "mp4": "drive.mp4", "mcap": "drive.mcap"}
    write({tmp_path / kind: kind for kind in others}, recording, None)
    files = {str(one.relative_to(tmp_path)) for one in tmp_path.glob("*/*")}
    assert files >= {"frames/frames", "frames/truth.tum", *(f"{kind}/{file}" for kind, file in others.items())}
    assert not any(f"{kind}/truth.tum" in files for kind in others)
    refused("format: found 'gif', expected one of frames", write, {tmp_path / "new": "gif"}, recording, None)
    assert tomllib.loads((tmp_path / "mcap" / "robot.toml").read_text())["name"] == "aruco-room"


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize(("model", "length"), [("fisheye", 4), *(("pinhole", k) for k in (0, 4, 8, 14))])
def test_bags_tell_of_any_camera(kind: Kind, model: Model, length: int, drive: Drive, tmp_path: Path) -> None:
    recording = some(drive[0], [np.zeros((480, 640), np.uint8)])
    distortion = tuple(0.01 * (k + 1) for k in range(length))
    camera = replace(recording.detector.camera, model=model, distortion=distortion)
    detector = replace(recording.detector, camera=camera)
    write({tmp_path / "out": kind}, replace(recording, detector=detector), None)
    path = next(one for one in (tmp_path / "out").iterdir() if one.name.startswith("drive"))
    found = rosbag.read(path, Topics()).camera
    assert (found.width, found.height, found.focal, found.centre) == (640, 480, camera.focal, camera.centre)
    assert found.model == model
    assert found.distortion[:length] == distortion
    assert not any(found.distortion[length:])


def test_bags_hold_what_ros_calls_it(folders: dict[str, Path]) -> None:
    for name in ("ros1", "ros2", "mcap"):
        path = next(one for one in folders[name].iterdir() if one.name.startswith("drive"))
        listed = {(topic.name, topic.type) for topic in bag.Bag(path).listed()}
        assert listed == {
            ("/camera/camera_info", "sensor_msgs/msg/CameraInfo"),
            ("/camera/image_raw", "sensor_msgs/msg/Image"),
            ("/encoder", "geometry_msgs/msg/QuaternionStamped"),
        }
        refused("/odom", rosbag.read, path, Topics(odometry="/odom"))
        assert not isinstance(rosbag.read(path, Topics()).readings, Poses)

"""ROS bags of depth cameras: every encoding and kind of bag, cameras placed by tf, and what is refused."""

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bags
import depth_views as views
from bags import KINDS, Said
from depth_views import CAMERA, MOUNTING, RATE, SIZE, START, depth_at, grey_at, png, stamp, usable
from fuzzing import survivors
from refusals import refusal
from slamduel.datasets.depth.open import OpenedDepth, open_depth
from slamduel.datasets.depth.registering import Registration
from slamduel.datasets.recordings.any_recording import Options, make
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import from_rpy, mounting
from slamduel.frontend.depth.recording import DepthFrame
from slamduel.frontend.wheels.track import Track
from tiers import first_quick

IMAGE, DEPTH, INFO = "/camera/rgb/image_raw", "/camera/depth/image_raw", "/camera/rgb/camera_info"
TF = bags.transforms(stamp(START - 0.1), views.mounted(), topic="/tf_static")


def in_order(said: Sequence[Said]) -> list[Said]:
    return sorted(said, key=lambda one: one.stamp)


def drive(
    frames: int = 6, kind: str = "16UC1", colour: str = "mono8", other: Sequence[Said] = (TF,), depth_topic: str = DEPTH
) -> list[Said]:
    said = [views.info_message(INFO), *other, *views.odometry_messages(frames)]
    for k in range(frames):
        said += [views.image_message(k, IMAGE, colour), views.image_message(k, depth_topic, kind)]
    return sorted(said, key=lambda one: one.stamp)


def opened(folder: Path, said: Sequence[Said], kind: str = "mcap", robot: str | None = None) -> OpenedDepth:
    folder.mkdir(exist_ok=True)
    path = bags.write(folder, kind, said)
    if robot is not None:
        (folder / "robot.toml").write_text(robot)
    found = open_depth(path, folder / "robot.toml" if robot is not None else None)
    assert found is not None
    return found


def frames_of(found: OpenedDepth) -> list[DepthFrame]:
    return list(found.recording.frames)


def refused(folder: Path, said: Sequence[Said], robot: str | None = None, kind: str = "mcap") -> str:
    return refusal(lambda: frames_of(opened(folder, said, kind, robot)))


def assert_all(frames: Sequence[DepthFrame], count: int = 6, atol: float = 0.0) -> None:
    assert len(frames) == count
    for k, frame in enumerate(frames):
        assert frame.seconds == pytest.approx(START + k / RATE, abs=1e-9)
        np.testing.assert_array_equal(frame.grey, grey_at(k))
        np.testing.assert_allclose(frame.depth, (depth_at(k) / 1000).astype(np.float32), rtol=0, atol=atol)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("encoding", first_quick(["16UC1", "mono16", "32FC1"]))
def test_every_bag_and_encoding_gives_the_same_frames(tmp_path: Path, kind: str, encoding: str) -> None:
    found = opened(tmp_path, drive(kind=encoding), kind)
    assert_all(frames_of(found))
    assert_all(frames_of(found))
    np.testing.assert_allclose(found.recording.camera.mounting, MOUNTING, atol=1e-9)
    assert found.recording.camera.focal == CAMERA.focal
    assert found.length == 6
    motion = found.recording.motion
    assert isinstance(motion, Track)
    np.testing.assert_allclose(motion.odometry(START + 0.1, START + 0.3).delta, [0.1, 0, 0], atol=1e-9)
    assert found.recording.remarks == []
    assert found.recording.notes["topics"] == {"image": IMAGE, "depth": DEPTH, "odometry": "/odom"}


def test_colours_are_kept_beside_the_grey(tmp_path: Path) -> None:
    frames = frames_of(opened(tmp_path, drive(colour="bgr8")))
    assert_all(frames)
    assert all(frame.colour is not None and frame.colour.shape == (*SIZE[::-1], 3) for frame in frames)


def test_compressed_depth_of_millimetres(tmp_path: Path) -> None:
    topic = f"{DEPTH}/compressedDepth"
    said = [one for one in drive() if one.topic != DEPTH]
    content = [bytes(12) + png(depth_at(k)) for k in range(6)]
    for form in ("16UC1; compressedDepth", "16UC1; compressedDepth png"):
        given = [views.compressed_depth(k, topic, content[k], form) for k in range(6)]
        assert_all(frames_of(opened(tmp_path / form[-3:], in_order(said + given))))


@pytest.mark.parametrize("form", ["png", "16UC1; png compressed ", "mono16; png compressed"])
def test_depth_may_be_a_plain_png_file(form: str, tmp_path: Path) -> None:
    topic = f"{DEPTH}/compressed"
    said = [one for one in drive() if one.topic != DEPTH]
    given = [views.compressed_depth(k, topic, png(depth_at(k)), form) for k in range(6)]
    given[2] = views.compressed_depth(2, topic, png(depth_at(2))[:-30], form)
    given[4] = views.compressed_depth(4, topic, png((depth_at(4) // 256).astype(np.uint8)), form)
    found = opened(tmp_path, in_order(said + given))
    assert [frame.seconds for frame in frames_of(found)] == pytest.approx([START + k / RATE for k in (0, 1, 3, 5)])
    np.testing.assert_array_equal(frames_of(found)[0].depth, (depth_at(0) / 1000).astype(np.float32))
    assert found.recording.left_out["depth images that cannot be decoded"] == 1
    assert found.recording.left_out["depth images of 8 bits"] == 1


def test_compressed_images_of_8_bits_are_no_depth(tmp_path: Path) -> None:
    """Beside depth there are grey and coloured ones."""
    said = [one for one in drive() if one.topic != IMAGE]
    topic = f"{IMAGE}/compressed"
    given = [views.compressed_depth(k, topic, png(grey_at(k)), "mono8; png compressed ") for k in range(6)]
    assert_all(frames_of(opened(tmp_path, in_order(said + given))))


def test_compressed_depth_of_inverse_depths(tmp_path: Path) -> None:
    """As ROS's transport quantises metres: the value of a depth z is a / z + b, rounded; 0 is none."""
    topic, a, b = f"{DEPTH}/compressedDepth", 40_000.0, 12.0
    said = [one for one in drive() if one.topic != DEPTH]
    given = list[Said]()
    for k in range(6):
        z = depth_at(k) / 1000
        z[5:9] = 0
        values = np.where(z > 0, np.rint(a / np.where(z > 0, z, 1.0) + b), 0).astype(np.uint16)
        content = struct.pack("<iff", 1, a, b) + png(values)
        given.append(views.compressed_depth(k, topic, content, "32FC1; compressedDepth png"))
    for k, frame in enumerate(frames_of(opened(tmp_path, in_order(said + given)))):
        z = depth_at(k) / 1000
        assert not frame.depth[5:9].any()
        kept = np.r_[0:5, 9 : SIZE[1]]
        # Half a step of the inverse is z^2 / 2 a.
        assert (np.abs(frame.depth - z)[kept] <= 0.51 * z[kept] ** 2 / a + 1e-6).all()


def test_big_endian_and_padded_rows_are_read(tmp_path: Path) -> None:
    said = [one for one in drive() if one.topic != DEPTH]
    for k in range(6):
        swapped = np.zeros((SIZE[1], SIZE[0] + 3), ">u2")
        swapped[:, : SIZE[0]] = depth_at(k)
        one = views.raw_message(START + k / RATE, DEPTH, "16UC1", swapped)
        said.append(changed(one, width=SIZE[0], is_bigendian=1))
    assert_all(frames_of(opened(tmp_path, sorted(said, key=lambda one: one.stamp))))


def test_not_a_number_and_infinite_depths_are_none(tmp_path: Path) -> None:
    said = [one for one in drive(frames=2) if one.topic != DEPTH]
    pixels = np.full(SIZE[::-1], 1.5, np.float32)
    pixels[0, :4] = np.nan, np.inf, -1.0, 0.0
    said += [views.raw_message(START + k / RATE, DEPTH, "32FC1", pixels) for k in range(2)]
    frame = frames_of(opened(tmp_path, sorted(said, key=lambda one: one.stamp)))[0]
    assert not frame.depth[0, :4].any()
    assert (frame.depth.ravel()[4:] == 1.5).all()


def test_the_footprint_is_the_origin_on_the_floor(tmp_path: Path) -> None:
    """base_link is 0.1 m above base_footprint, and the camera placed from there."""
    up = bags.Transform("base_footprint", "base_link", (0.0, 0.0, 0.1))
    tf = bags.transforms(stamp(START), up, views.mounted(), topic="/tf_static")
    found = opened(tmp_path, drive(other=[tf]))
    np.testing.assert_allclose(found.recording.camera.mounting[2, 3], MOUNTING[2, 3] + 0.1, atol=1e-9)
    (rest,) = (bags.transforms(stamp(START), views.mounted(), topic="/tf_static"),)
    assert opened(tmp_path / "b", drive(other=[rest])).recording.camera.mounting[2, 3] == pytest.approx(0.75)


def test_robot_toml_places_the_camera_and_says_where_tf_differs(tmp_path: Path) -> None:
    toml = "[camera]\nmounting = { xyz = [0.12, 0.0, 0.95], rpy = [0, 0.35, 0] }\n[depth]\n"
    found = opened(tmp_path, drive(), robot=toml)
    assert found.recording.camera.mounting[2, 3] == 0.95
    (remark,) = found.recording.remarks
    assert "[camera] mounting, which is used, differs by 0.2 m and" in remark
    same = toml.replace("0.95", "0.75").replace("0.35", f"{np.deg2rad(20):.17g}")
    assert opened(tmp_path / "b", drive(), robot=same).recording.remarks == []
    assert_all(frames_of(opened(tmp_path / "c", drive(other=[]), robot=toml)))


def test_a_camera_that_nobody_places_is_refused(tmp_path: Path) -> None:
    said = refused(tmp_path, drive(other=[]))
    assert "tf does not tell where camera_optical is on base_link, expected [camera] mounting in robot.toml." in said


BODY = mounting(0, 0, 0, 0)
BESIDE = BODY.T @ from_rpy((0.0, 0.025, 0.0), (0.0, 0.0, 0.01))
IR = Camera(80, 60, (73.0, 73.0), (39.5, 29.5), (), np.eye(4))
IR_INFO = "/camera/depth/camera_info"


def beside(robot_knows: bool = False) -> list[Said]:
    """A bag whose depth is of a second camera, placed by tf."""
    tf = [views.mounted(), *([] if robot_knows else [views.mounted("camera_optical", "ir_optical", BESIDE)])]
    said = [views.info_message(INFO), views.info_message(IR_INFO, IR, "ir_optical"), *views.odometry_messages()]
    said.append(bags.transforms(stamp(START), *tf, topic="/tf_static"))
    for k in range(6):
        said.append(views.image_message(k, IMAGE))
        small = depth_at(k)[::2, ::2].copy()
        said.append(views.raw_message(START + k / RATE, DEPTH, "16UC1", small, "ir_optical"))
    return sorted(said, key=lambda one: one.stamp)


@pytest.mark.parametrize("robot_knows", [False, True])
def test_depth_of_a_second_camera_is_registered(tmp_path: Path, robot_knows: bool) -> None:
    toml = "[depth]\npose = { xyz = [0.0, 0.025, 0.0], rpy = [0, 0, 0.01] }\n" if robot_knows else None
    found = opened(tmp_path, beside(robot_knows), robot=toml)
    assert found.recording.depth_camera.focal == IR.focal
    frames = frames_of(found)
    expected = Registration(IR, found.recording.camera, BESIDE)
    for k, frame in enumerate(frames):
        assert frame.depth.shape == SIZE[::-1]
        ours = expected.registered((depth_at(k)[::2, ::2] / 1000).astype(np.float32))
        np.testing.assert_allclose(frame.depth, ours, atol=1e-4)
        assert (frame.depth > 0).mean() > 0.8


def test_depth_of_a_second_camera_without_its_place_or_calibration_is_refused(tmp_path: Path) -> None:
    said = refused(tmp_path, beside(robot_knows=True))
    assert "the depth is of another camera, ir_optical, and tf does not tell where that is in camera_optical" in said
    without = [one for one in beside() if one.topic != IR_INFO]
    # The only calibration left is that of the other camera.
    assert "80x60 pixels, expected the 160x120 of its camera's calibration" in refused(tmp_path / "b", without)
    nothing = [one for one in beside() if one.type != bags.CAMERA_INFO]
    assert "has no topic of sensor_msgs/CameraInfo for /camera/rgb/image_raw, exp" in refused(tmp_path / "c", nothing)


@pytest.mark.parametrize("name", ["/camera/depth_registered/image_raw", "/camera/aligned_depth_to_color/image_raw"])
def test_topics_of_registered_depth_are_known_by_their_names(tmp_path: Path, name: str) -> None:
    said = [one._replace(frame="other_optical") if one.topic == name else one for one in drive(depth_topic=name)]
    found = opened(tmp_path, said)
    assert found.recording.depth_camera is None
    assert_all(frames_of(found))


def test_the_camera_of_each_topic_is_the_one_beside_it(tmp_path: Path) -> None:
    other = views.info_message("/other/camera_info", replace(CAMERA, focal=(99.0, 99.0)))
    found = opened(tmp_path, in_order([*drive(), other]))
    assert found.recording.camera.focal == CAMERA.focal


def test_rectified_images_have_no_distortion(tmp_path: Path) -> None:
    distorted = replace(CAMERA, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
    projection = np.array([[150.0, 0, 80, 0], [0, 151, 60, 0], [0, 0, 1, 0]])
    info = changed(views.info_message(INFO, distorted), p=projection.ravel())
    said = [info if one.topic == INFO else one for one in drive()]
    assert opened(tmp_path, said).recording.camera.distortion == distorted.distortion
    said = [one._replace(topic="/camera/rgb/image_rect") if one.topic == IMAGE else one for one in said]
    camera = opened(tmp_path / "b", said).recording.camera
    assert not any(camera.distortion)
    assert (camera.focal, camera.centre) == ((150.0, 151.0), (80.0, 60.0))


def test_single_bad_messages_are_left_out_and_counted(tmp_path: Path) -> None:
    """An image and a depth image at absurd times, and a pose that is none."""
    said = list[Said]()
    for one in drive():
        moved = {(IMAGE, stamp(START + 0.1)): 2 * 10**18, (DEPTH, stamp(START + 0.3)): 10**9 * 10**9}.get(
            (one.topic, one.stamp)
        )
        said.append(one if moved is None else one._replace(stamp=moved, received=one.stamp))
    row = next(k for k, one in enumerate(said) if one.type == bags.ODOMETRY and one.stamp > stamp(START))
    said[row] = bags.odometry(said[row].stamp, np.nan, 0.0, (0.0, 0.0, 0.0, 1.0))
    found = opened(tmp_path, said)
    for _ in range(2):  # as often as the frames are read
        frames = frames_of(found)
        assert [frame.seconds for frame in frames] == pytest.approx([START + k / RATE for k in (0, 2, 4, 5)])
        of_odometry, *of_images = found.recording.remarks
        assert "1 of 21 messages of topic /odom cannot be used and are left out; the first, message" in of_odometry
        for topic, number in ((IMAGE, 2), (DEPTH, 4)):
            words = (
                f"1 of 6 images of topic {topic} cannot be used and are left out; the first, image {number}, is stamp"
            )
            assert sum(words in remark for remark in of_images) == 1
        assert len(of_images) == 2


def test_the_images_may_be_a_part_of_the_camera_binned(tmp_path: Path) -> None:
    """Of a camera of twice the resolution, from 30 and 10 pixels on."""
    width, height = 2 * SIZE[0], 2 * SIZE[1]
    whole = replace(CAMERA, width=width + 50, height=height + 20, focal=(300.0, 300.0), centre=(190.0, 125.0))

    def windowed(new: Any) -> dict[str, Any]:
        roi = new("sensor_msgs/msg/RegionOfInterest", 30, 10, height, width, False)
        return views.info_message(INFO, whole).build(new) | {"binning_x": 2, "binning_y": 2, "roi": roi}

    said = [one._replace(build=windowed) if one.topic == INFO else one for one in drive()]
    found = opened(tmp_path, said)
    camera = found.recording.camera
    assert (camera.width, camera.height) == SIZE
    np.testing.assert_allclose([*camera.focal, *camera.centre], [150, 150, 79.75, 57.25])
    assert_all(frames_of(found))


def test_several_topics_of_a_kind_have_to_be_chosen(tmp_path: Path) -> None:
    extra = [views.image_message(k, "/left/image_raw") for k in range(6)]
    said = in_order([*drive(), *extra])
    assert "expected [topics] image to name the one to use." in refused(tmp_path, said)
    named = f'[depth]\n[topics]\nimage = "{IMAGE}"\ndepth = "{DEPTH}"\n'
    assert_all(frames_of(opened(tmp_path / "b", said, robot=named)))
    wrong = named.replace(IMAGE, "/camera/image")
    assert "has no images in the topic '/camera/image', which [topics] " in refused(tmp_path / "c", said, wrong)


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    no_depth = [one for one in drive() if one.topic != DEPTH]
    toml = "[depth]\n"
    assert "has no topic with depth images (16UC1, mono16, 32FC1 or compre" in refused(tmp_path, no_depth, toml)
    no_image = [one for one in drive() if one.topic != IMAGE]
    assert "has no topic with images, of 8 bits or in colour; found" in refused(tmp_path / "b", no_image, toml)
    no_info = [one for one in drive() if one.topic != INFO]
    said = refused(tmp_path / "c", no_info)
    assert f"has no topic of sensor_msgs/CameraInfo for {IMAGE}, expected one, or [camera] calibration" in said
    uncalibrated = changed(views.info_message(INFO), k=np.zeros(9))
    said = refused(tmp_path / "d", [uncalibrated if one.topic == INFO else one for one in drive()])
    assert f"topic {INFO} is there, but is all zero, of an uncalibrated camera, expected its focal length." in said


def test_a_bag_without_odometry_says_so(tmp_path: Path) -> None:
    found = opened(tmp_path, [one for one in drive() if one.type != bags.ODOMETRY])
    assert found.recording.motion is None
    assert_all(frames_of(found))
    (remark,) = found.recording.remarks
    assert "has no odometry, neither a topic of it nor a transform of tf from 'odom'" in remark


def test_odometry_may_be_in_tf_alone(tmp_path: Path) -> None:
    said = [one for one in drive() if one.type != bags.ODOMETRY]
    moving = [
        bags.transforms(stamp(t), bags.Transform("odom", "base_link", (0.5 * (t - START), 0.0, 0.0)))
        for t in np.arange(START - 0.1, START + 0.7, 0.05).tolist()
    ]
    found = opened(tmp_path, in_order(said + moving))
    assert_all(frames_of(found))
    np.testing.assert_allclose(found.recording.motion.odometry(START, START + 0.4).delta, [0.2, 0, 0], atol=1e-9)
    assert found.recording.notes["topics"]["odometry"] == "tf from odom to base_link"


def changed(said: Said, **fields: Any) -> Said:
    """The message with other fields."""
    return said._replace(build=lambda new: said.build(new) | fields)


def bad(kind: str, pixels: np.ndarray) -> Said:
    return views.raw_message(START + 0.2, DEPTH, kind, pixels)


BAD = {
    "8 bits": (bad("mono8", grey_at(2)), "depth images of 8 bits"),
    "in colour": (bad("rgb8", np.dstack([grey_at(2)] * 3)), "depth images of other encodings"),
    "all zero": (bad("16UC1", 0 * depth_at(2)), "depth images without any depth"),
    "another size": (bad("16UC1", depth_at(2)[:60].copy()), "depth images of another size"),
    "too short": (changed(bad("16UC1", depth_at(2)), data=np.zeros(1000, np.uint8)), "depth images that are too short"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_bad_depth_image_is_left_out_and_counted(tmp_path: Path, fault: str) -> None:
    spoilt, reason = BAD[fault]
    said = [spoilt if one.topic == DEPTH and one.stamp == stamp(START + 0.2) else one for one in drive()]
    found = opened(tmp_path, said)
    assert [round(RATE * (frame.seconds - START)) for frame in frames_of(found)] == [0, 1, 3, 4, 5]
    assert found.recording.left_out == {reason: 1}
    (remark,) = found.recording.remarks
    assert f"1 {reason} are left out; message 3 of topic {DEPTH} " in remark


@pytest.mark.parametrize("content", [b"", bytes(12), bytes(12) + png(depth_at(0))[:900], bytes(12) + b"nothing"])
def test_damaged_compressed_depth_is_left_out(tmp_path: Path, content: bytes) -> None:
    topic = f"{DEPTH}/compressedDepth"
    said = [one for one in drive() if one.topic != DEPTH]
    whole = [bytes(12) + png(depth_at(k)) for k in range(6)]
    whole[4] = content
    said += [views.compressed_depth(k, topic, whole[k], "16UC1; compressedDepth png") for k in range(6)]
    found = opened(tmp_path, sorted(said, key=lambda one: one.stamp))
    assert len(frames_of(found)) == 5
    assert found.recording.left_out == {"depth images that cannot be decoded": 1}


def test_colour_without_depth_is_counted(tmp_path: Path) -> None:
    said = [one for one in drive() if not (one.topic == DEPTH and one.stamp >= stamp(START + 0.3))]
    found = opened(tmp_path, said)
    assert_all(frames_of(found), 3)
    assert found.recording.left_out == {"images without a depth image": 3}


def test_the_dataset_recording_reads_a_bag_by_itself(tmp_path: Path) -> None:
    """The wheels alone: the pictures are noise, in which nothing is found again."""
    path = bags.write(tmp_path, "ros2", drive())
    log, truth = make(Options(path=str(path)), np.random.default_rng(0))
    assert log.name == "drive"
    assert len(log) >= 2
    assert truth is None


@pytest.mark.parametrize("kind", first_quick(KINDS))
def test_a_damaged_bag_is_read_or_refused_with_a_sentence(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path, kind, drive(frames=3, colour="bgr8"))

    def read(_: Path) -> list[DepthFrame]:
        found = open_depth(path)
        return [] if found is None else frames_of(found)

    survivors(read, bags.file_of(path), 6, 0, usable)

"""Readers of bags, against bags written message by message, and everything that may be wrong with one."""

import re
import sqlite3
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from ruamel.yaml import YAML

import bags
from fuzzing import survivors
from refusals import refused
from slamduel.datasets.bags import images
from slamduel.datasets.recordings.rosbag import Topics, read
from slamduel.datasets.recordings.streams import Streams
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.wheels.ticks import Ticks
from slamduel.frontend.wheels.track import Poses
from tiers import first_quick

MS = 10**6
NAMELESS = Topics()


def picture(value: int, shape: tuple[int, ...] = (4, 6)) -> Any:
    return (np.arange(np.prod(shape)).reshape(shape) + value).astype(np.uint8)


def drive(frames: int = 5) -> list[bags.Said]:
    said = [bags.counts(20 * MS * k, 10.0 * k, 12.0 * k, 20.0 * k, 22.0 * k) for k in range(1, 12)]
    said += [bags.image(40 * MS * (k + 1), picture(k)) for k in range(frames)]
    return sorted(said, key=lambda one: one.stamp)


def frames(streams: Streams) -> list[tuple[float, Any]]:
    return [(frame.t, frame.image) for frame in streams.frames]


# --- images -----------------------------------------------------------------------------------------------------------


def raw(encoding: str, pixels: Any, step: int | None = None, bigendian: int = 0, **other: Any) -> Any:
    height, width = pixels.shape[:2]
    kind = pixels.dtype.newbyteorder(">" if bigendian else "<")
    rows = pixels.reshape(height, -1).astype(kind).view(np.uint8)
    stride = rows.shape[1] if step is None else step
    padded = np.full((height, stride), 99, np.uint8)
    padded[:, : rows.shape[1]] = rows
    content = {"height": height, "width": width, "encoding": encoding, "step": stride, "is_bigendian": bigendian}
    return images.raw(SimpleNamespace(**(content | {"data": padded.ravel()} | other)))


BGR = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
ALPHA = np.full((4, 6, 1), 7, np.uint8)


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("mono8", BGR[:, :, 0], BGR[:, :, 0]),
        ("8UC1", BGR[:, :, 0], BGR[:, :, 0]),
        ("mono16", BGR[:, :, 0] * np.uint16(256) + np.uint16(200), BGR[:, :, 0]),
        ("16UC1", BGR[:, :, 0] * np.uint16(256), BGR[:, :, 0]),
        ("bgr8", BGR, BGR),
        ("8UC3", BGR, BGR),
        ("rgb8", BGR[:, :, ::-1], BGR),
        ("rgb16", BGR[:, :, ::-1] * np.uint16(256), BGR),
        ("bgra8", np.dstack((BGR, ALPHA)), BGR),
        ("rgba8", np.dstack((BGR[:, :, ::-1], ALPHA)), BGR),
    ],
)
@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("bigendian", [0, 1])
def test_raw_images_come_back_exactly(encoding: str, pixels: Any, expected: Any, padding: int, bigendian: int) -> None:
    width = pixels[0].size * pixels.itemsize
    np.testing.assert_array_equal(raw(encoding, np.ascontiguousarray(pixels), width + padding, bigendian), expected)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_are_told_apart(pattern: str) -> None:
    colour = {"b": 30, "g": 120, "r": 210}
    cell = np.array([colour[letter] for letter in pattern], np.uint8).reshape(2, 2)
    mosaic = np.tile(cell, (4, 5))
    for image in (raw(f"bayer_{pattern}8", mosaic), raw(f"bayer_{pattern}16", mosaic * np.uint16(256))):
        assert image.shape == (8, 10, 3)
        assert (image == [30, 120, 210]).all()
    content = cv2.imencode(".png", mosaic)[1]
    as_png = images.compressed(SimpleNamespace(format=f"bayer_{pattern}8; png compressed", data=content))
    assert as_png is not None
    assert (as_png == [30, 120, 210]).all()


YUV = [("yuv422", "uyvy"), ("uyvy", "uyvy"), ("yuyv", "yuyv"), ("yuv422_yuy2", "yuyv")]


@pytest.mark.parametrize(("encoding", "order"), YUV)
def test_yuv(encoding: str, order: str) -> None:
    y, u, v = 120, 90, 170  # ITU-R BT.601, of reduced range
    red = 1.164 * (y - 16) + 1.596 * (v - 128)
    green = 1.164 * (y - 16) - 0.813 * (v - 128) - 0.391 * (u - 128)
    blue = 1.164 * (y - 16) + 2.018 * (u - 128)
    pixels = np.tile(np.array([{"y": y, "u": u, "v": v}[letter] for letter in order], np.uint8), (4, 3))
    image = raw(encoding, pixels.reshape(4, 6, 2))
    assert image.shape == (4, 6, 3)
    np.testing.assert_allclose(image.reshape(-1, 3), np.tile([blue, green, red], (24, 1)), atol=1.5)


@pytest.mark.parametrize("encoding", ["nv21", "nv12", "NV12"])
@pytest.mark.parametrize("form", ["rows of the image", "rows of both planes", "padded", "a step of both planes"])
def test_images_of_two_planes(encoding: str, form: str) -> None:
    """Each of four parts of the picture has its colour, whatever a driver takes for its rows."""
    parts = np.array([[[120, 90, 170], [200, 128, 128]], [[60, 140, 120], [90, 110, 160]]])  # y, u, v
    yuv = parts.repeat(2, axis=0).repeat(4, axis=1)
    colours = yuv[::2, ::2, 1:] if encoding.lower() == "nv12" else yuv[::2, ::2, :0:-1]
    planes = np.vstack((yuv[:, :, 0], colours.reshape(2, 8))).astype(np.uint8)
    if form == "padded":
        planes = np.pad(planes, ((0, 0), (0, 8)))
    content = {"height": 4, "width": 8, "encoding": encoding, "step": planes.shape[1], "data": planes.ravel()}
    content |= {"height": 6} if form == "rows of both planes" else {}
    content |= {"step": 12} if form == "a step of both planes" else {}
    image = images.raw(SimpleNamespace(**content, is_bigendian=0))
    assert image is not None
    assert image.shape == (4, 8, 3)
    y, u, v = (yuv[..., k].astype(float) for k in range(3))
    red, blue = (1.164 * (y - 16) + by * (colour - 128) for by, colour in ((1.596, v), (2.018, u)))
    green = 1.164 * (y - 16) - 0.813 * (v - 128) - 0.391 * (u - 128)
    np.testing.assert_allclose(image, np.stack((blue, green, red), axis=-1), atol=2)


def test_planes_of_the_wrong_size_are_no_image() -> None:
    good = {"height": 4, "width": 8, "encoding": "nv12", "step": 8, "is_bigendian": 0, "data": np.zeros(48, np.uint8)}
    assert images.raw(SimpleNamespace(**good)) is not None
    for fault in ({"data": np.zeros(47, np.uint8)}, {"width": 7}, {"height": 3}, {"height": 0}, {"height": 2**31}):
        assert images.raw(SimpleNamespace(**(good | fault))) is None


@pytest.mark.parametrize(
    "fault",
    [
        {"data": np.zeros(23, np.uint8)},
        {"step": 5},
        {"height": 0},
        {"width": 0},
        {"encoding": "32FC1"},
        {"height": 2**31},
        {"encoding": "bayer_rggb8", "width": 1, "height": 1},
    ],
)
def test_images_that_cannot_be(fault: dict[str, Any]) -> None:
    good = {"height": 4, "width": 6, "encoding": "mono8", "step": 6, "is_bigendian": 0, "data": np.zeros(24, np.uint8)}
    assert images.raw(SimpleNamespace(**good)) is not None
    image = images.raw(SimpleNamespace(**(good | fault)))
    assert image is None or image.shape[:2] == (1, 1)


def test_compressed_images(capfd: pytest.CaptureFixture[str]) -> None:
    def decoded(content: Any, form: str = "") -> Any:
        return images.compressed(SimpleNamespace(format=form, data=np.frombuffer(bytes(content), np.uint8)))

    smooth = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (40, 60), np.uint8), (0, 0), 4)
    png, jpeg = (cv2.imencode(kind, smooth)[1] for kind in (".png", ".jpg"))
    np.testing.assert_array_equal(decoded(png, "mono8; png compressed "), smooth)
    assert np.abs(decoded(jpeg, "mono8; jpeg compressed bgr8").astype(int) - smooth).max() < 8
    np.testing.assert_array_equal(decoded(cv2.imencode(".png", smooth * np.uint16(256))[1]), smooth)
    np.testing.assert_array_equal(decoded(cv2.imencode(".png", BGR)[1], "png"), BGR)
    np.testing.assert_array_equal(decoded(cv2.imencode(".png", np.dstack((BGR, ALPHA)))[1]), BGR)
    assert decoded(b"") is None
    assert decoded(b"no picture") is None
    assert decoded(png[:50]) is None
    assert capfd.readouterr().err == ""


# --- what a bag holds -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", bags.KINDS)
def test_the_original_systems_topics(tmp_path: Path, kind: str) -> None:
    k = [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
    said = [*drive(), bags.camera_info(40 * MS, k, [0.1, -0.2, 0.001, 0.002, 0.05])]
    path = bags.write(tmp_path, kind, sorted(said, key=lambda one: one.stamp))
    streams = read(path, NAMELESS)
    assert streams.length == 5
    for _ in range(2):  # each time from the beginning
        found = frames(streams)
        assert [t for t, _ in found] == [0.04, 0.08, 0.12, 0.16, 0.2]
        for index, (_, image) in enumerate(found):
            np.testing.assert_array_equal(image, picture(index))
    assert isinstance(streams.readings, Ticks)
    np.testing.assert_array_equal(streams.readings.t, [20 * k / 1000 for k in range(1, 12)])
    np.testing.assert_array_equal(streams.readings.counts, [[11 * k, 21 * k] for k in range(1, 12)])
    camera = streams.camera
    assert (camera.width, camera.height, camera.focal, camera.centre) == (640, 480, (500, 510), (320, 240))
    assert camera.distortion == (0.1, -0.2, 0.001, 0.002, 0.05)
    np.testing.assert_array_equal(camera.mounting, np.eye(4))


@pytest.mark.parametrize("kind", bags.KINDS)
def test_odometry_and_compressed_images(tmp_path: Path, kind: str) -> None:
    content = [cv2.imencode(".png", picture(k))[1].tobytes() for k in range(3)]
    headings = [0.0, 0.5, 3.0, -3.0]
    said = [bags.compressed(100 * MS * (k + 1), content[k], "mono8; png compressed ") for k in range(3)]
    for k, a in enumerate(headings):
        said.append(bags.odometry(100 * MS * (k + 1), k, 2.0 * k, (0.0, 0.0, -np.sin(a / 2), -np.cos(a / 2))))
    streams = read(bags.write(tmp_path, kind, sorted(said, key=lambda one: one.stamp)), NAMELESS)
    for index, (_, image) in enumerate(frames(streams)):
        np.testing.assert_array_equal(image, picture(index))
    assert isinstance(streams.readings, Poses)
    np.testing.assert_array_equal(streams.readings.t, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(streams.readings.poses[:, :2], [[0, 0], [1, 2], [2, 4], [3, 6]])
    np.testing.assert_allclose(streams.readings.poses[:, 2], headings, atol=1e-15)
    assert streams.camera is None


@pytest.mark.parametrize("kind", bags.KINDS)
def test_a_message_without_a_time_has_that_of_reception_on_the_clock_of_the_others(tmp_path: Path, kind: str) -> None:
    said = [
        bags.image(30 * MS, picture(1), received=1000 * MS),
        bags.image(10 * MS, picture(0), received=1010 * MS),  # late
        bags.image(30 * MS, picture(1), received=1020 * MS),  # again
        bags.image(0, picture(2), received=1030 * MS),
        bags.counts(3 * MS, 3, 3, 3, 3, received=1031 * MS),
        bags.counts(1 * MS, 1, 1, 1, 1, received=1032 * MS),
        bags.counts(1 * MS, 2, 2, 2, 2, received=1033 * MS),
        bags.counts(0, 4, 4, 4, 4, received=1034 * MS),
    ]
    streams = read(bags.write(tmp_path, kind, said), NAMELESS)
    found = frames(streams)
    assert [t for t, _ in found] == [0.01, 0.03, 0.04]
    for index, (_, image) in enumerate(found):
        np.testing.assert_array_equal(image, picture(index))
    assert isinstance(streams.readings, Ticks)
    np.testing.assert_array_equal(streams.readings.t, [0.001, 0.002, 0.003])
    np.testing.assert_array_equal(streams.readings.counts[:, 0], [2, 4, 3])
    of_readings, of_images = streams.remarks
    assert "1 of 4 messages of topic" in of_readings
    assert "have the time 0 in their headers" in of_readings
    assert "1 of 4 messages of topic" in of_images


@pytest.mark.parametrize("kind", bags.KINDS)
def test_without_any_time_in_the_headers_that_of_reception_counts(tmp_path: Path, kind: str) -> None:
    said = [bags.image(0, picture(k), received=(1000 + 10 * k) * MS) for k in range(3)]
    streams = read(bags.write(tmp_path, kind, said), NAMELESS)
    assert [t for t, _ in frames(streams)] == [1.0, 1.01, 1.02]
    assert streams.remarks == []


def test_times_since_1970_are_rounded_once(tmp_path: Path) -> None:
    stamp = 1_700_000_000_123_456_789
    streams = read(bags.write(tmp_path, "ros1", [bags.image(stamp, picture(0))]), NAMELESS)
    assert frames(streams)[0][0] == 1_700_000_000.123456789


def test_images_are_decoded_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bags.write(tmp_path, "mcap", drive(frames=8))
    decoded = list[int]()
    plain = images.raw
    monkeypatch.setattr(images, "raw", lambda message: decoded.append(1) or plain(message))
    walk = iter(read(path, NAMELESS).frames)
    for number in range(1, 4):
        next(walk)
        assert len(decoded) == number


@pytest.mark.parametrize("kind", bags.KINDS)
def test_an_image_that_will_not_decode_is_a_frame_without_one(tmp_path: Path, kind: str) -> None:
    said = [bags.image(1, picture(0)), bags.image(2, picture(0), encoding="sepia"), bags.image(3, picture(0))]
    found = frames(read(bags.write(tmp_path, kind, said), NAMELESS))
    assert [image is None for _, image in found] == [False, True, False]


def changed(path: Path, statement: str) -> None:
    with sqlite3.connect(path / "drive.db3") as connection:
        assert connection.execute(statement).rowcount > 0
    connection.close()


def test_a_message_cut_short_is_a_frame_without_image(tmp_path: Path) -> None:
    said = [bags.image(MS * k, picture(0), received=MS * (1000 + k)) for k in (1, 2, 3)]
    path = bags.write(tmp_path, "ros2", said)
    changed(path, "UPDATE messages SET data = substr(data, 1, 30) WHERE timestamp = 1002000000")
    found = frames(read(path, NAMELESS))
    assert [(t, image is None) for t, image in found] == [(0.001, False), (0.002, True), (0.003, False)]


def test_wraps_are_undone_before_counters_are_averaged(tmp_path: Path) -> None:
    # The second left counter wraps two readings after the first.
    true = np.array([[65500 + 20 * k, 65460 + 20 * k, 5 * k, 5 * k] for k in range(8)])
    said = [bags.image(1, picture(0))]
    said += [bags.counts(MS * (k + 1), *map(float, row % 2**16)) for k, row in enumerate(true)]
    streams = read(bags.write(tmp_path, "mcap", said), NAMELESS, counter_bits=16)
    assert isinstance(streams.readings, Ticks)
    np.testing.assert_array_equal(np.diff(streams.readings.counts, axis=0), np.tile([20, 5], (7, 1)))


def test_bags_without_definitions_and_with_unknown_types(tmp_path: Path) -> None:
    path = bags.write(tmp_path, "ros2", drive())
    changed(path, "DELETE FROM message_definitions")
    assert len(frames(read(path, NAMELESS))) == 5

    old = bags.write(tmp_path, "ros1", drive())
    custom = tmp_path / "custom.bag"
    with Writer1(custom) as writer:
        connection = writer.add_connection("/bumper", "my_msgs/msg/Bump", msgdef="Missing[] what", md5sum="0" * 32)
        writer.write(connection, 5, b"\1\2\3")
    refused(r"no topic with images.*/bumper \(my_msgs/Bump, 1 messages\)", read, custom, NAMELESS)
    refused(r"\[topics\] image: found /bumper .*expected messages of sensor", read, custom, Topics(image="/bumper"))
    assert len(frames(read(old, NAMELESS))) == 5


# --- topics -----------------------------------------------------------------------------------------------------------


def test_a_choice_of_topics_is_asked_for(tmp_path: Path) -> None:
    said = [
        bags.image(1, picture(0), topic="/left/image"),
        bags.image(2, picture(1), topic="/right/image"),
        bags.counts(3, 5, 5, 5, 5),
        bags.odometry(4, 0, 0, (0, 0, 0, 1)),
        bags.camera_info(5, [500.0, 0, 320, 0, 510, 240, 0, 0, 1], [0.0] * 5, topic="/left/camera_info"),
        bags.camera_info(6, [501.0, 0, 320, 0, 510, 240, 0, 0, 1], [0.0] * 5, topic="/right/camera_info"),
    ]
    path = bags.write(tmp_path, "mcap", said)
    choice = r"/left/image \(sensor_msgs/Image, 1 messages\), /right/image .* \[topics\] image to name"
    refused(choice, read, path, NAMELESS)
    refused(r"both /encoder .* and /odom .* \[topics\] encoder or odometry", read, path, Topics(image="/right/image"))
    refused("names both encoder and odometry", read, path, Topics("/right/image", "/encoder", "/odom"))
    streams = read(path, Topics("right/image", "/encoder"))
    np.testing.assert_array_equal(frames(streams)[0][1], picture(1))
    assert isinstance(streams.readings, Ticks)
    assert streams.camera.focal[0] == 501  # of the two, the one beside the images
    assert isinstance(read(path, Topics("/left/image", odometry="/odom")).readings, Poses)
    refused(r"has no topic '/front', which \[topics\] image names; found /enc", read, path, Topics(image="/front"))
    refused(r"\[topics\] encoder: found /odom \(nav_msgs/Odometry", read, path, Topics("/left/image", encoder="/odom"))


def test_of_two_calibrations_apart_from_the_images_one_has_to_be_named(tmp_path: Path) -> None:
    k = [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
    said = [bags.image(1, picture(0)), bags.camera_info(2, k, [0.0] * 5, "/a/i"), bags.camera_info(3, k, [], "/b/i")]
    path = bags.write(tmp_path, "ros2", said)
    refused(r"\[topics\] camera_info", read, path, NAMELESS)
    assert read(path, Topics(camera_info="/a/i")).camera is not None


WINDOWS = {
    "whole": ((0, 0), (0, 0), (0, 0), (640, 480)),
    "said in full": ((0, 0), (640, 480), (1, 1), (640, 480)),
    "binned": ((0, 0), (0, 0), (2, 2), (320, 240)),
    "binned across": ((0, 0), (640, 480), (4, 1), (160, 480)),
    "a part": ((100, 60), (200, 120), (0, 0), (200, 120)),
    "a part, binned": ((100, 60), (200, 120), (2, 4), (100, 30)),
    "binned, and the calibration is of it": ((0, 0), (0, 0), (2, 2), (640, 480)),
}


@pytest.mark.parametrize("kind", first_quick(bags.KINDS))
@pytest.mark.parametrize("form", ["raw", "png"])
@pytest.mark.parametrize("which", WINDOWS)
def test_images_may_be_a_part_of_the_camera_or_binned(which: str, form: str, kind: str, tmp_path: Path) -> None:
    """A pixel of the images is where the mean of its pixels is in the whole camera."""
    corner, part, binning, size = WINDOWS[which]
    k, d = [500.0, 0, 321.5, 0, 510.0, 239.5, 0, 0, 1], [-0.2, 0.05, 1e-3, -2e-3, 0.01]
    info = bags.camera_info(5 * MS, k, d)

    def changed(new: Any) -> dict[str, Any]:
        roi = new("sensor_msgs/msg/RegionOfInterest", *corner, *part[::-1], False)
        return info.build(new) | {"roi": roi, "binning_x": binning[0], "binning_y": binning[1]}

    pixels = np.zeros(size[::-1], np.uint8)
    sent = bags.image(5 * MS, pixels)
    if form == "png":
        sent = bags.compressed(5 * MS, cv2.imencode(".png", pixels)[1].tobytes(), "png", "/image")
    streams = read(bags.write(tmp_path, kind, [info._replace(build=changed), sent]), NAMELESS)
    assert streams.camera is not None
    camera = streams.camera if streams.window is None else streams.window.of(streams.camera)
    assert (camera.width, camera.height) == size
    whole = Camera(640, 480, (500.0, 510.0), (321.5, 239.5), tuple(d), np.eye(4))
    if size == (640, 480):
        assert (camera.focal, camera.centre) == (whole.focal, whole.centre)
        return
    for u, v in ((0, 0), (size[0] - 1, size[1] - 1), (31, 22)):
        across, down = (start + by * at + np.arange(by) for start, by, at in zip(
            corner, (max(one, 1) for one in binning), (u, v), strict=True
        ))  # fmt: skip
        ray = whole.undistort(np.array([[across.mean(), down.mean()]]))
        np.testing.assert_allclose(camera.undistort(np.array([[float(u), float(v)]])), ray, atol=1e-9)


@pytest.mark.parametrize(("corner", "part", "binning"), [((600, 0), (200, 100), (1, 1)), ((0, 0), (0, 0), (700, 1))])
def test_a_part_that_is_not_of_the_camera_is_refused(corner: Any, part: Any, binning: Any, tmp_path: Path) -> None:
    info = bags.camera_info(5 * MS, [500.0, 0, 320, 0, 500, 240, 0, 0, 1], [0.0] * 5)

    def changed(new: Any) -> dict[str, Any]:
        roi = new("sensor_msgs/msg/RegionOfInterest", *corner, *part[::-1], False)
        return info.build(new) | {"roi": roi, "binning_x": binning[0], "binning_y": binning[1]}

    path = bags.write(tmp_path, "ros2", [info._replace(build=changed), bags.image(5 * MS, picture(0))])
    refused("topic /camera_info: found a region of interest of .*expected a part of the 640x480", read, path, NAMELESS)


def test_a_camera_that_was_never_calibrated_is_none(tmp_path: Path) -> None:
    said = [bags.image(1, picture(0)), bags.camera_info(2, np.zeros(9), [])]
    assert read(bags.write(tmp_path, "ros1", said), NAMELESS).camera is None


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (
            [bags.odometry(4 * MS, 0, 0, (0, 0, 0, 0))],
            "/odom cannot be .* 0.004 s, has an orientation whose quat.* length 0",
        ),
        ([bags.odometry(4 * MS, 0, 0, (0.6, 0, 0, 0.8))], "/odom cannot be used.* is tilted by 74 degrees"),
        (
            [bags.odometry(4 * MS, np.nan, 0, (0, 0, 0, 1))],
            "/odom cannot be used.* has the place .nan, .*, expected metres",
        ),
        (
            [bags.counts(4 * MS, 1, np.inf, 0, 0)],
            "/encoder cannot be used.* at 0.004 s, has the counts .*inf.* expected whole",
        ),
        ([bags.counts(k, 0, 0.6, 0.8, 0) for k in (1, 2)], "/encoder holds orientations, expected the wheels'"),
        ([bags.counts(7, k, k, k, k) for k in (1, 2, 3)], "3 messages of topic /encoder have only 1 distinct times"),
        ([bags.image(2, picture(1), encoding="32FC1", topic="/d")], r"none of the 1 images of topic /d .*'32FC1'"),
        ([bags.compressed(2, b"nothing", "h264")], "none of the 1 images of topic /image/compressed .*'h264'"),
    ],
)
def test_readings_that_cannot_be(tmp_path: Path, said: list[bags.Said], message: str) -> None:
    images = [one for one in said if "image" in one.type.lower()]
    path = bags.write(tmp_path, "mcap", said if images else [bags.image(1, picture(0)), *said])
    refused(f"{re.escape(str(path))}: .*{message}", lambda: frames(read(path, NAMELESS)))


def test_single_bad_messages_are_left_out_and_counted(tmp_path: Path) -> None:
    """Counts that are no numbers, and images at absurd times: before all others, between them, and after them."""
    said = drive(12)
    counts = [one for one in said if one.topic == "/encoder"]
    shots = [one for one in said if one.topic == "/image"]
    counts[3] = bags.counts(counts[3].stamp, 1e256, 1, 1, 1)
    counts[7] = bags.counts(counts[7].stamp, np.nan, 1, 1, 1)
    for row, stamp in ((0, 7), (9, shots[9].stamp - 500 * MS), (5, shots[5].stamp + 10**9 * 10**9)):
        shots[row] = shots[row]._replace(stamp=stamp + 10**18, received=shots[row].stamp)
    shots = [one if one.stamp > 10**17 else one._replace(stamp=one.stamp + 10**18, received=one.stamp) for one in shots]
    shots[0] = shots[0]._replace(stamp=7)
    streams = read(bags.write(tmp_path, "ros1", in_order_of_reception(counts, shots)), NAMELESS)
    found = frames(streams)
    for (t, image), k in zip(found, (1, 2, 3, 4, 6, 7, 8, 10, 11), strict=True):
        assert abs(t - (10**9 + 0.04 * (k + 1))) < 1e-6
        np.testing.assert_array_equal(image, picture(k))
    assert isinstance(streams.readings, Ticks)
    assert len(streams.readings.t) == len(counts) - 2
    of_counts, of_images = streams.remarks
    assert "2 of 11 messages of topic /encoder cannot be used and are left out; the first, message 4, at 0.08 s" in (
        of_counts
    )
    assert "3 of 12 images of topic /image cannot be used and are left out; the first, image 1, is stamped" in of_images


def test_counts_of_zero_in_the_middle_of_a_drive_are_left_out(tmp_path: Path) -> None:
    """A counter that wraps forth and back is none of them, nor is one that begins again."""
    said = [bags.counts(20 * MS * k, *(1000.0 + 10 * k for _ in range(4))) for k in range(40)]
    shots = [bags.image(40 * MS * (k + 1), picture(k)) for k in range(3)]
    wrapped = [bags.counts(20 * MS * k, *[float((k % 2) * 65530)] * 4) for k in range(40)]
    restarted = [*said[:20], *(bags.counts(20 * MS * k, *[10.0 * (k - 20)] * 4) for k in range(20, 40))]
    spoilt = [*said[:13], bags.counts(said[13].stamp, 0, 0, 0, 0), *said[14:]]
    for number, (counts, lost) in enumerate(((spoilt, 1), (wrapped, 0), (restarted, 0))):
        (tmp_path / str(number)).mkdir()
        bag = bags.write(tmp_path / str(number), "ros1", in_order_of_reception(counts, shots))
        streams = read(bag, NAMELESS)
        assert isinstance(streams.readings, Ticks)
        assert len(streams.readings.t) == 40 - lost
        assert len(streams.remarks) == lost


def in_order_of_reception(*streams: list[bags.Said]) -> list[bags.Said]:
    said = [one for stream in streams for one in stream]
    return sorted(said, key=lambda one: one.stamp if one.received is None else one.received)


# --- bags that are none -----------------------------------------------------------------------------------------------


REPAIRS = ("rosbag reindex", "ros2 bag reindex", "mcap recover", "mcap recover")


@pytest.mark.parametrize(("kind", "repair"), [*zip(bags.KINDS, REPAIRS, strict=True)])
def test_truncated(tmp_path: Path, kind: str, repair: str) -> None:
    large = [bags.image(10 * MS * k, picture(k, (60, 80))) for k in range(1, 60)]
    path = bags.write(tmp_path, kind, sorted([*large, *drive(frames=0)], key=lambda one: one.stamp))
    assert len(frames(read(path, NAMELESS))) == 59
    content = bags.file_of(path).read_bytes()
    for share in (0.0, 0.01, 0.6, 0.999):
        bags.file_of(path).write_bytes(content[: int(share * len(content))])
        refused(f"^{path}: is damaged or not a ROS bag .*{repair}", lambda: frames(read(path, NAMELESS)))


@pytest.mark.parametrize("kind", bags.KINDS)
def test_empty(tmp_path: Path, kind: str) -> None:
    refused("contains no messages", read, bags.write(tmp_path, kind, []), NAMELESS)


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive.db3"])
@pytest.mark.parametrize("content", [b"", b"no bag", b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", bytes(range(256)) * 40])
def test_no_bag(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    refused("is damaged or not a ROS bag", read, tmp_path / name, NAMELESS)


def test_an_unindexed_bag_is_to_be_reindexed(tmp_path: Path) -> None:
    path = bags.write(tmp_path, "ros1", drive())
    content = bytearray(path.read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    content[at : at + 8] = bytes(8)  # as a recorder that was killed leaves it
    path.write_bytes(content)
    refused(r"not indexed.*`rosbag reindex`", read, path, NAMELESS)


@pytest.mark.parametrize("content", ["", "[1", "rosbag2_bagfile_information: 3", "{}"])
def test_a_folder_without_usable_metadata(tmp_path: Path, content: str) -> None:
    path = bags.write(tmp_path, "ros2", drive())
    (path / "metadata.yaml").write_text(content)
    refused("`ros2 bag reindex`", read, path, NAMELESS)
    (path / "metadata.yaml").unlink()
    refused(r"has no metadata\.yaml, expected the folder of a ROS 2 bag.*`ros2 bag reindex`", read, path, NAMELESS)
    assert len(frames(read(path / "drive.db3", NAMELESS))) == 5
    refused("there is no such file or folder", read, tmp_path / "other.bag", NAMELESS)


@pytest.mark.parametrize("kind", first_quick(bags.KINDS))
def test_damage_within_ends_in_a_sentence_or_in_bad_frames(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path, kind, drive())

    def usable(found: list[tuple[float, Any]]) -> None:
        assert all(image is None or image.dtype == np.uint8 for _, image in found)

    survivors(lambda _: frames(read(path, NAMELESS)), bags.file_of(path), 40, 0, usable)


# --- metadata.yaml ----------------------------------------------------------------------------------------------------


def edited(path: Path, old: str, new: str) -> None:
    words = (path / "metadata.yaml").read_text()
    assert re.search(old, words), words
    (path / "metadata.yaml").write_text(re.sub(old, new, words))


@pytest.mark.parametrize("kind", ["ros2", "mcap folder"])
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("storage_identifier: .*", "storage_identifier: ''"),
        ("storage_identifier: .*", "storage_identifier:"),
        ("storage_identifier: .*", "storage_identifier: unknown"),
        (r"type_description_hash:\s+\S+", "type_description_hash: RIHS01_" + "0" * 64),
    ],
)
def test_metadata_that_differs_in_what_no_message_needs(tmp_path: Path, kind: str, old: str, new: str) -> None:
    path = bags.write(tmp_path, kind, drive())
    edited(path, old, new)
    streams = read(path, NAMELESS)
    assert len(frames(streams)) == streams.length == 5
    assert isinstance(streams.readings, Ticks)
    assert len(streams.readings.t) == 11


@pytest.mark.parametrize("kind", ["ros2", "mcap folder"])
def test_a_quality_of_service_edited_by_hand(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path, kind, drive())
    content = YAML(typ="safe").load(path / "metadata.yaml")
    for topic in content["rosbag2_bagfile_information"]["topics_with_message_count"]:
        profile = "- history: 1\n  depth: 3\n  reliability: 1\n  durability: 2\n  deadline:\n    sec: 1\n    nsec: 0\n"
        profile += "  lifespan:\n    sec: 1\n    nsec: 0\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 1\n"
        topic["topic_metadata"]["offered_qos_profiles"] = (
            profile + "    nsec: 0\n  avoid_ros_namespace_conventions: false"
        )
    with (path / "metadata.yaml").open("w") as file:
        YAML().dump(content, file)
    streams = read(path, NAMELESS)
    assert len(frames(streams)) == 5
    assert isinstance(streams.readings, Ticks)


@pytest.mark.parametrize("kind", ["ros2", "mcap folder"])
@pytest.mark.parametrize(
    ("old", "new"),
    [("name: /encoder", "name: /counts"), ("type: geometry_msgs/msg/Quat.*", f"type: {bags.ODOMETRY}")],
)
def test_metadata_of_other_topics_than_the_files_have(tmp_path: Path, kind: str, old: str, new: str) -> None:
    path = bags.write(tmp_path, kind, drive())
    edited(path, old, new)
    message = r"metadata\.yaml does not fit its files: none of the 11 messages of topic /(encoder|counts) that it lists"
    refused(f"{message} is in them.*`ros2 bag reindex`", read, path, NAMELESS)

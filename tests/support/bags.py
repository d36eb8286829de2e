"""Small ROS bags for the tests, written message by message."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("ros1", "ros2", "mcap", "mcap folder")

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
COUNTS = "geometry_msgs/msg/QuaternionStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
TWIST, STAMPED_TWIST = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
SCAN = "sensor_msgs/msg/LaserScan"
ECHOES = "sensor_msgs/msg/MultiEchoLaserScan"
APRILTAG = "apriltag_msgs/msg/AprilTagDetectionArray"
APRILTAG_ROS = "apriltag_ros/msg/AprilTagDetectionArray"
ISAAC = "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray"
IMU, MAGNETIC = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"
NAVSAT = "sensor_msgs/msg/NavSatFix"
TRANSFORMS, FIRST_TRANSFORMS = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"


_TAGS = {
    APRILTAG: "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\nPoint centre\n"
    "Point[4] corners\nfloat64[9] homography",
    APRILTAG_ROS: "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\nint32[2] pix_tl\n"
    "int32[2] pix_tr\nint32[2] pix_br\nint32[2] pix_bl",
    ISAAC: "string family\nint32 id\ngeometry_msgs/Point center\ngeometry_msgs/Point[4] corners\n"
    "geometry_msgs/PoseWithCovarianceStamped pose",
}
"""Definitions of single tags, as their packages have them."""


class Said(NamedTuple):
    """A message: `build(new)` makes its content, `new(type, *values)` a part of it."""

    topic: str
    type: str
    stamp: int  # ns, of the header
    build: Callable[[Any], dict[str, Any]]
    received: int | None = None  # ns; None: at once
    frame: str = "frame"


def write(folder: Path, kind: str, messages: Iterable[Said]) -> Path:
    """Writes a bag and returns its path."""
    old = kind == "ros1"
    types = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    if old:
        for name in (TRANSFORMS, FIRST_TRANSFORMS):
            types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    for name, one in _TAGS.items():
        package = name.split("/")[0]
        array = "std_msgs/Header header\nAprilTagDetection[] detections"
        types.register(
            {
                **(get_types_from_msg("float64 x\nfloat64 y", f"{package}/msg/Point") if name == APRILTAG else {}),
                **get_types_from_msg(one, f"{package}/msg/AprilTagDetection"),
                **get_types_from_msg(array, name),
            }
        )
    plugin = StoragePlugin.SQLITE3 if kind == "ros2" else StoragePlugin.MCAP
    path = folder / ("drive.bag" if old else "drive")
    writer: Any = Writer1(path) if old else Writer2(path, version=8, storage_plugin=plugin)
    connections = dict[str, Any]()

    def new(type_name: str, *values: Any) -> Any:
        return types.types[type_name](*values)

    with writer:
        for said in messages:
            if said.topic not in connections:
                connections[said.topic] = writer.add_connection(said.topic, said.type, typestore=types)
            header = _header(new, old, said.stamp, said.frame)
            content = said.build(new)
            if old and said.type == CAMERA_INFO:
                content = {name.upper() if name in "dkrp" else name: value for name, value in content.items()}
            if said.type in (TRANSFORMS, FIRST_TRANSFORMS):
                content = {"transforms": [_stamped(new, old, said.stamp, one) for one in content["transforms"]]}
            elif said.type != TWIST:
                content["header"] = header
            message = types.types[said.type](**content)
            encode = types.serialize_ros1 if old else types.serialize_cdr
            received = said.stamp if said.received is None else said.received
            writer.write(connections[said.topic], received, encode(message, said.type))
    return path / "drive.mcap" if kind == "mcap" else path


def file_of(path: Path) -> Path:
    """The file that has a bag's messages."""
    return next(one for one in [path, *path.glob("*.db3"), *path.glob("*.mcap")] if one.is_file())


def _header(new: Any, old: bool, stamp: int, frame: str) -> Any:
    time = new("builtin_interfaces/msg/Time", *divmod(stamp, 10**9))
    return new("std_msgs/msg/Header", *([0] if old else []), time, frame)


def _stamped(new: Any, old: bool, stamp: int, one: "Transform") -> Any:
    parts = new("geometry_msgs/msg/Vector3", *one.place), _quaternion(new, one.turn)
    header = _header(new, old, stamp, one.parent)
    return new("geometry_msgs/msg/TransformStamped", header, one.child, new("geometry_msgs/msg/Transform", *parts))


class Transform(NamedTuple):
    """A transform of tf: the place of `child` in the axes of `parent`."""

    parent: str
    child: str
    place: tuple[float, float, float]
    turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w


def transforms(stamp: int, *given: Transform, topic: str = "/tf") -> Said:
    return Said(topic, TRANSFORMS, stamp, lambda new: {"transforms": given})


def scan(stamp: int, ranges: Any, topic: str = "/scan", **changes: Any) -> Said:
    """A scan of `ranges` from -90 to 90 degrees; `changes` are of its other numbers."""
    step = np.float32(np.pi / max(len(ranges) - 1, 1))
    content = {"angle_min": np.float32(-np.pi / 2), "angle_increment": step, "time_increment": 0.0, "scan_time": 0.0}
    content |= {"range_min": 0.05, "range_max": 80.0} | changes
    content.setdefault("angle_max", content["angle_min"] + (len(ranges) - 1) * content["angle_increment"])
    numbers = {name: float(value) for name, value in content.items()}
    arrays = {"ranges": np.asarray(ranges, np.float32), "intensities": np.zeros(0, np.float32)}
    return Said(topic, SCAN, stamp, lambda new: numbers | arrays, frame="laser")


def imu(
    stamp: int, gyro: Any, accel: Any, topic: str = "/imu", frame: str = "imu", received: int | None = None, **cov: Any
) -> Said:
    """Rates and accelerations (3,); `cov` are covariances by the beginning of their names, -1 in front: not given."""

    def build(new: Any) -> dict[str, Any]:
        content = {"orientation": _quaternion(new, (0.0, 0.0, 0.0, 0.0))}
        for name, values in (("angular_velocity", gyro), ("linear_acceleration", accel)):
            content[name] = new("geometry_msgs/msg/Vector3", *map(float, values))
        given = {"orientation": -1.0} | cov
        for name in ("orientation", "angular_velocity", "linear_acceleration"):
            content[f"{name}_covariance"] = np.diag(np.full(3, given.get(name, 0.0))).ravel()
        return content

    return Said(topic, IMU, stamp, build, received, frame)


def magnetic(stamp: int, field: Any, topic: str = "/mag") -> Said:
    """A field (3,), T."""

    def build(new: Any) -> dict[str, Any]:
        vector = new("geometry_msgs/msg/Vector3", *map(float, field))
        return {"magnetic_field": vector, "magnetic_field_covariance": np.zeros(9)}

    return Said(topic, MAGNETIC, stamp, build, frame="imu")


def echoes(one: Said, seen: Any, topic: str = "/scan") -> Said:
    """The scan `one` with several echoes in its beams, (b,) arrays."""

    def build(new: Any) -> dict[str, Any]:
        content = one.build(new)
        beams = [new("sensor_msgs/msg/LaserEcho", np.asarray(beam, np.float32)) for beam in seen]
        return content | {"ranges": beams, "intensities": []}

    return one._replace(type=ECHOES, topic=topic, build=build)


def image(stamp: int, pixels: Any, received: int | None = None, topic: str = "/image", encoding: str = "mono8") -> Said:
    height, width = pixels.shape[:2]
    content = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0, "step": width}
    content |= {"data": np.ascontiguousarray(pixels, np.uint8).ravel()}
    return Said(topic, IMAGE, stamp, lambda new: content, received)


def compressed(stamp: int, content: bytes, kind: str = "jpeg", topic: str = "/image/compressed") -> Said:
    return Said(topic, COMPRESSED, stamp, lambda new: {"format": kind, "data": np.frombuffer(content, np.uint8)})


def counts(stamp: int, *four: float, topic: str = "/encoder", received: int | None = None) -> Said:
    return Said(topic, COUNTS, stamp, lambda new: {"quaternion": new("geometry_msgs/msg/Quaternion", *four)}, received)


def twist(stamp: int, v: float, omega: float, topic: str = "/cmd_vel", *, stamped: bool = False) -> Said:
    """A command, with a header or without."""

    def build(new: Any) -> dict[str, Any]:
        parts = [new("geometry_msgs/msg/Vector3", *three) for three in ((v, 0.0, 0.0), (0.0, 0.0, omega))]
        whole = {"linear": parts[0], "angular": parts[1]}
        return {"twist": new("geometry_msgs/msg/Twist", *parts)} if stamped else whole

    return Said(topic, STAMPED_TWIST if stamped else TWIST, stamp, build)


def odometry(
    stamp: int,
    x: float,
    y: float,
    turn: tuple[float, float, float, float],
    topic: str = "/odom",
    base: str = "base_link",
) -> Said:
    def build(new: Any) -> dict[str, Any]:
        pose = new("geometry_msgs/msg/Pose", new("geometry_msgs/msg/Point", x, y, 0.0), _quaternion(new, turn))
        still = new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = new("geometry_msgs/msg/Twist", still, still)
        return {
            "child_frame_id": base,
            "pose": new("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            "twist": new("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        }

    return Said(topic, ODOMETRY, stamp, build)


def _quaternion(new: Any, turn: tuple[float, float, float, float]) -> Any:
    return new("geometry_msgs/msg/Quaternion", *turn)


def camera_info(stamp: int, k: Any, d: Any, topic: str = "/camera_info", model: str = "plumb_bob") -> Said:
    return Said(
        topic,
        CAMERA_INFO,
        stamp,
        lambda new: {
            "height": 480,
            "width": 640,
            "distortion_model": model,
            "d": np.array(d, float),
            "k": np.array(k, float),
            "r": np.eye(3).ravel(),
            "p": np.zeros(12),
            "binning_x": 0,
            "binning_y": 0,
            "roi": new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False),
        },
    )


def tags(stamp: int, kind: str, found: Iterable["Tag"], topic: str = "/tag_detections") -> Said:
    """Tags as the package of type `kind` publishes them; apriltag_ros in ROS 1, Isaac's in ROS 2."""
    return Said(topic, kind, stamp, lambda new: {"detections": [_TAG_BUILDERS[kind](new, stamp, one) for one in found]})


class Tag(NamedTuple):
    """A tag of a message: several ids are a bundle."""

    ids: tuple[int, ...]
    pose: Any  # x, y, z, qx, qy, qz, qw
    corners: Any  # (4, 2) px
    cov: Any = np.zeros((6, 6))


def _stamped_pose(new: Any, stamp: int, one: Tag, old: bool) -> Any:
    pose = new("geometry_msgs/msg/Pose", new("geometry_msgs/msg/Point", *one.pose[:3]), _quaternion(new, one.pose[3:]))
    both = new("geometry_msgs/msg/PoseWithCovariance", pose, np.array(one.cov, float).ravel())
    return new("geometry_msgs/msg/PoseWithCovarianceStamped", _header(new, old, stamp, "camera"), both)


def _apriltag(new: Any, stamp: int, one: Tag) -> Any:
    corners = [new("apriltag_msgs/msg/Point", *corner) for corner in np.asarray(one.corners, float).tolist()]
    centre, homography = new("apriltag_msgs/msg/Point", 0.0, 0.0), np.zeros(9)
    numbers = "36h11", one.ids[0], 0, 0.0, 50.0
    return new("apriltag_msgs/msg/AprilTagDetection", *numbers, centre, corners, homography)


def _apriltag_ros(new: Any, stamp: int, one: Tag) -> Any:
    ids, sizes = np.array(one.ids, np.int32), np.full(len(one.ids), 0.16)
    pixels = (np.zeros(2, np.int32) for _ in range(4))
    return new("apriltag_ros/msg/AprilTagDetection", ids, sizes, _stamped_pose(new, stamp, one, True), *pixels)


def _isaac(new: Any, stamp: int, one: Tag) -> Any:
    point = "geometry_msgs/msg/Point"
    corners = [new(point, u, v, 0.0) for u, v in np.asarray(one.corners, float).tolist()]
    name = "isaac_ros_apriltag_interfaces/msg/AprilTagDetection"
    return new(name, "tag36h11", one.ids[0], new(point, 0.0, 0.0, 0.0), corners, _stamped_pose(new, stamp, one, False))


_TAG_BUILDERS: dict[str, Callable[[Any, int, Tag], Any]] = {
    APRILTAG: _apriltag, APRILTAG_ROS: _apriltag_ros, ISAAC: _isaac,
}  # fmt: skip


def navsat(
    stamp: int,
    latitude: float,
    longitude: float,
    topic: str = "/fix",
    *,
    status: int = 0,
    cov: tuple[float, float, float] = (1.0, 0.0, 1.0),
    kind: int = 2,
) -> Said:
    """A position; `cov` is of east, of both, and of north, m^2, and `kind` says how it is known."""
    east, both, north = cov

    def build(new: Any) -> dict[str, Any]:
        return {
            "status": new("sensor_msgs/msg/NavSatStatus", status, 1),
            "latitude": latitude,
            "longitude": longitude,
            "altitude": 0.0,
            "position_covariance": np.array([east, both, 0.0, both, north, 0.0, 0.0, 0.0, 1.0]),
            "position_covariance_type": kind,
        }

    return Said(topic, NAVSAT, stamp, build)

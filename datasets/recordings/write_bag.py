"""Writes a drive as a ROS bag: raw images, the camera's calibration with each, counters or poses, an IMU and a scanner.

The topics and types are those that `rosbag` reads; headers have the same times as the bag.
"""

import shutil
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.camera.camera import Camera
from ...frontend.inertial.imu import Imu
from ...frontend.laser.recording import LaserRecording
from ...frontend.markers.aruco import Image
from ...frontend.wheels.motion import Motion
from ...frontend.wheels.ticks import Wheels
from ...frontend.wheels.track import Track
from ..bags.cameras import CAMERA_INFO, COMPRESSED, IMAGE
from ..bags.odometry import ODOMETRY
from ..fixes.gps_messages import NAVSAT
from ..inertial.imu_messages import IMU, MAGNETIC, NOT_GIVEN
from ..scans.scan_messages import SCAN
from .rosbag import ENCODER, Topics

Kind = Literal["ros1", "ros2", "mcap"]

NAMES: dict[Kind, str] = {"ros1": "drive.bag", "ros2": "drive", "mcap": "drive.mcap"}
"""Name of the bag's file or folder."""

TOPICS = Topics(image="/camera/image_raw", encoder="/encoder", odometry="/odom", camera_info="/camera/camera_info")


def topics_of(camera: str) -> Topics:
    """The topics of an only camera, or of the one of several that is called `camera`."""
    if not camera:
        return TOPICS
    return TOPICS._replace(image=f"/{camera}/image_raw", camera_info=f"/{camera}/camera_info")


IMU_TOPIC, SCAN_TOPIC, MAGNETIC_TOPIC, GPS_TOPIC = "/imu", "/scan", "/mag", "/fix"

DEPTH, DEPTH_INFO = "/camera/depth_registered/image_raw", "/camera/depth_registered/camera_info"
"""Topics of depth images and their camera."""


class Positions(NamedTuple):
    """Positions by a GPS receiver."""

    t: Array  # (f,) s
    degrees: Array  # (f, 2) latitude and longitude
    sd: Array  # (f,) m, of east and of north


Encoding = Literal["16UC1", "32FC1", "compressedDepth"]

ENCODINGS: dict[Kind, Encoding] = {"ros1": "32FC1", "ros2": "16UC1", "mcap": "compressedDepth"}
"""Encoding of depth images by the kind of bag: a different one in each."""


class BagWriter:
    """Writes one bag; a context manager. Times are s; messages must be written in order."""

    def __init__(
        self,
        folder: Path,
        kind: Kind,
        motion: Motion | None,
        imu: Imu | None = None,
        scans: LaserRecording | None = None,
        positions: Positions | None = None,
    ) -> None:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_typestore

        self._folder, self._kind, self._motion, self._imu, self._scans = folder, kind, motion, imu, scans
        moved = motion.t if isinstance(motion, Wheels | Track) else np.zeros(0)
        self._moved = len(moved)  # readings of the motion, before those of the IMU and the scans
        inertial, scanned, placed = (np.zeros(0) if one is None else one.t for one in (imu, scans, positions))
        self._felt = len(moved) + len(inertial)
        self._scanned, self._positions = self._felt + len(scanned), positions
        times = np.concatenate((moved, inertial, scanned, placed))
        self._order = np.argsort(times, kind="stable")
        self._times = times[self._order]
        self._written = 0  # readings
        self._types = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
        self._connections = dict[str, Any]()
        self._writer: Any
        if kind == "ros1":
            self._writer, self._encode = Writer1(folder / NAMES[kind]), self._types.serialize_ros1
        else:
            plugin = StoragePlugin.SQLITE3 if kind == "ros2" else StoragePlugin.MCAP
            self._writer = Writer2(folder / NAMES["ros2"], version=8, storage_plugin=plugin)
            self._encode = self._types.serialize_cdr

    def __enter__(self) -> "BagWriter":
        self._writer.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.__exit__(kind, error, trace)
        if self._kind == "mcap" and kind is None:
            inside = self._folder / NAMES["ros2"]
            (inside / NAMES["mcap"]).replace(self._folder / NAMES["mcap"])
            shutil.rmtree(inside)

    def image(self, t: float, image: Image, topic: str | None = TOPICS.image) -> None:
        """A frame, grey or BGR."""
        self._image(t, topic, image, "mono8" if image.ndim == 2 else "bgr8")

    def depth(self, t: float, depth: NDArray[np.float32], encoding: Encoding) -> None:
        """A depth image (h, w), m; as integers, in whole mm."""
        if encoding == "32FC1":
            self._image(t, DEPTH, depth, encoding)
            return
        mm = np.rint(1000 * depth.astype(np.float64)).astype("<u2")
        if encoding == "16UC1":
            self._image(t, DEPTH, mm, encoding)
            return
        _, png = cv2.imencode(".png", mm, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        content = np.concatenate((np.zeros(12, np.uint8), png.ravel()))
        self._write(t, f"{DEPTH}/compressedDepth", COMPRESSED, format="16UC1; compressedDepth png", data=content)

    def _image(self, t: float, topic: str | None, image: NDArray[Any], encoding: str) -> None:
        height, width = image.shape[:2]
        pixels = np.frombuffer(np.ascontiguousarray(image).tobytes(), np.uint8)
        self._write(
            t, topic, IMAGE, height=height, width=width, encoding=encoding, is_bigendian=0,
            step=pixels.size // height, data=pixels,
        )  # fmt: skip

    def camera_info(self, t: float, camera: Camera, topic: str | None = TOPICS.camera_info) -> None:
        """A camera's calibration."""
        name, coefficients = _distortion(camera)
        projection = np.column_stack((camera.matrix, np.zeros(3)))
        numbers = {"d": coefficients, "k": camera.matrix.ravel(), "r": np.eye(3).ravel(), "p": projection.ravel()}
        if self._kind == "ros1":
            numbers = {letter.upper(): value for letter, value in numbers.items()}
        whole = self._message("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        self._write(
            t, topic, CAMERA_INFO, height=camera.height, width=camera.width, distortion_model=name,
            binning_x=0, binning_y=0, roi=whole, **numbers,
        )  # fmt: skip

    def readings(self, t: float) -> None:
        """The readings of counters or integrated poses, of an IMU and a scanner, up to `t`, from those before on."""
        upto = int(np.searchsorted(self._times, t, "right"))
        for row in self._order[self._written : upto].tolist():
            if row < self._moved:
                self._reading(row)
            elif row < self._felt:
                self._inertial(row - self._moved)
            elif row < self._scanned:
                self._scan(row - self._felt)
            else:
                self._position(row - self._scanned)
        self._written = upto

    def _inertial(self, row: int) -> None:
        assert self._imu is not None
        imu, unknown = self._imu, np.zeros(9)
        nothing = np.concatenate(([NOT_GIVEN], np.zeros(8)))
        sensed = imu.gyro[row], np.zeros(3) if imu.accel is None else imu.accel[row]
        rate, force = (self._message("geometry_msgs/msg/Vector3", *one.tolist()) for one in sensed)
        self._write(
            imu.t[row], IMU_TOPIC, IMU, orientation=self._message("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
            orientation_covariance=nothing, angular_velocity=rate, angular_velocity_covariance=unknown,
            linear_acceleration=force, linear_acceleration_covariance=nothing if imu.accel is None else unknown,
        )  # fmt: skip

        if imu.mag is not None and np.isfinite(imu.mag[row]).all():
            field = self._message("geometry_msgs/msg/Vector3", *imu.mag[row].tolist())
            self._write(imu.t[row], MAGNETIC_TOPIC, MAGNETIC, magnetic_field=field, magnetic_field_covariance=unknown)

    def _position(self, row: int) -> None:
        assert self._positions is not None
        found = self._positions
        latitude, longitude = found.degrees[row].tolist()
        self._write(
            found.t[row], GPS_TOPIC, NAVSAT, status=self._message("sensor_msgs/msg/NavSatStatus", 0, 1),
            latitude=latitude, longitude=longitude, altitude=0.0,
            position_covariance=float(found.sd[row]) ** 2 * np.eye(3).ravel(), position_covariance_type=2,
        )  # fmt: skip

    def _scan(self, row: int) -> None:
        assert self._scans is not None
        scanner, ranges = self._scans.scanner, self._scans.ranges[row].astype(np.float32)
        angles = scanner.angles
        self._write(
            self._scans.t[row], SCAN_TOPIC, SCAN, angle_min=float(angles[0]), angle_max=float(angles[-1]),
            angle_increment=float(angles[1] - angles[0]), time_increment=0.0, scan_time=0.0, range_min=0.0,
            range_max=scanner.most, ranges=ranges, intensities=np.zeros(0, np.float32),
        )  # fmt: skip

    def _reading(self, row: int) -> None:
        motion = self._motion
        if isinstance(motion, Wheels):
            left, right = motion.ticks.counts[row].tolist()
            counts = self._message("geometry_msgs/msg/Quaternion", left, left, right, right)
            self._write(motion.t[row], TOPICS.encoder, ENCODER, quaternion=counts)
        if isinstance(motion, Track):
            x, y, heading = motion.poses[row].tolist()
            place = self._message("geometry_msgs/msg/Point", x, y, 0.0)
            turn = self._message("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
            still = self._message("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
            unknown = np.zeros(36)
            pose = self._message("geometry_msgs/msg/Pose", place, turn)
            twist = self._message("geometry_msgs/msg/Twist", still, still)
            self._write(
                motion.t[row], TOPICS.odometry, ODOMETRY, child_frame_id="base_link",
                pose=self._message("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
                twist=self._message("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
            )  # fmt: skip

    def _message(self, type_name: str, *values: Any) -> Any:
        return self._types.types[type_name](*values)

    def _write(self, t: float, topic: str | None, type_name: str, **content: Any) -> None:
        """Writes a message of `content` and a header, at `t`."""
        assert topic is not None
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, type_name, typestore=self._types)
        if not 0 <= t < 2**32:
            raise InputError(f"found a time of {t} s, expected one from 0 to 2^32 s, as bags have them.")
        nanoseconds = round(t * 1e9)
        stamp = self._message("builtin_interfaces/msg/Time", *divmod(nanoseconds, 10**9))
        count = {"seq": 0} if self._kind == "ros1" else {}
        frame = (
            "odom"
            if type_name == ODOMETRY
            else "camera"
            if type_name in (IMAGE, COMPRESSED, CAMERA_INFO)
            else "laser"
            if type_name == SCAN
            else "base_link"
        )
        header = self._types.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **count)
        message = self._types.types[type_name](header=header, **content)
        self._writer.write(self._connections[topic], nanoseconds, self._encode(message, type_name))


def _distortion(camera: Camera) -> tuple[str, Array]:
    """ROS's name of the distortion model and as many coefficients as it requires, zeros included."""
    if camera.model == "fisheye":
        name, length = "equidistant", 4
    else:
        name, length = ("plumb_bob", 5) if len(camera.distortion) <= 5 else ("rational_polynomial", 8)
    return name, np.pad(np.array(camera.distortion, float), (0, max(length - len(camera.distortion), 0)))

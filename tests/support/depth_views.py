"""A depth camera's drive of a few frames in a plain room, as files and bags that the tests spoil."""

from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import bags
from bags import Said
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.boxes import Box
from slamduel.datasets.rendering.cameras import MOUNTING
from slamduel.datasets.rendering.depth import true_depth
from slamduel.datasets.rendering.disturbances import raised
from slamduel.datasets.rendering.lens import through
from slamduel.datasets.rendering.room import Room
from slamduel.frontend.camera.calibration import write_opencv
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.depth.recording import DepthFrame

SIZE = (160, 120)
CAMERA = Camera(*SIZE, (144.0, 144.0), (79.5, 59.5), (), MOUNTING)
ROOM = Room(6.0, 5.0, 2.5, 0.16, (), (Box(np.array([1.3, 0.2, 0.3]), (0.4, 0.5, 0.5)),))
START, RATE = 1000.0, 10.0
"""s, of the first frame, and frames per second."""

ROBOT = """\
name = "depth robot"
[camera]
calibration = "calibration.yaml"
mounting = {{ xyz = [0.12, 0.0, 0.75], rpy = [0.0, 0.3490658503988659, 0.0] }}
{camera}
[depth]
{depth}
"""


@cache
def depth_at(k: int) -> NDArray[np.uint16]:
    """(h, w) mm, the k-th frame's depth."""
    depth = true_depth(ROOM, through(CAMERA), raised(pose_at(k)[None])[0] @ MOUNTING)
    return np.rint(1000 * depth).astype(np.uint16)


def pose_at(k: int) -> Array:
    """(3,) the robot's k-th pose: it drives ahead."""
    return np.array([0.05 * k, 0.0, 0.0])


@cache
def grey_at(k: int) -> NDArray[np.uint8]:
    """(h, w) the k-th frame: a picture of its own."""
    return np.random.default_rng(k).integers(0, 256, SIZE[::-1]).astype(np.uint8)


def png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def tum_folder(
    folder: Path, frames: int = 6, colour_at: Array | None = None, depth_times: Array | None = None, depth: str = ""
) -> Path:
    """A folder in TUM's layout, with robot.toml, of images at those times; the k-th file shows the k-th frame."""
    folder.mkdir(parents=True, exist_ok=True)
    times = {"rgb": colour_at, "depth": depth_times}
    for name, given in times.items():
        t = START + np.arange(frames) / RATE if given is None else given
        (folder / name).mkdir()
        lines = [f"# {name}", "# file: 'made.bag'", "# timestamp filename"]
        for k, time in enumerate(t.tolist()):
            shown = np.dstack([grey_at(k)] * 3) if name == "rgb" else 5 * depth_at(k)
            (folder / name / f"{time:.6f}.png").write_bytes(png(shown))
            lines.append(f"{time:.6f} {name}/{time:.6f}.png")
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    robot_toml(folder, depth)
    return folder


def robot_toml(folder: Path, depth: str = "", camera: str = "") -> Path:
    """The robot's description, with its camera's calibration."""
    write_opencv(folder / "calibration.yaml", CAMERA)
    (folder / "robot.toml").write_text(ROBOT.format(camera=camera, depth=depth))
    return folder / "robot.toml"


def odometry_csv(folder: Path, first: float = START - 1, last: float = START + 10) -> None:
    """Odometry of standing still before the drive, and of driving ahead from its start on."""
    t = np.arange(first, last, 0.05)
    rows = [f"{time!r},{0.05 * RATE * max(time - START, 0.0)!r},0.0,0.0" for time in t.tolist()]
    (folder / "odometry.csv").write_text("\n".join(["t,x,y,heading", *rows]) + "\n")


def usable(frames: list[DepthFrame]) -> None:
    """Frames whose pixels have a grey level and a depth of 0 or more, or none."""
    for frame in frames:
        assert frame.grey.shape == frame.depth.shape
        assert np.isfinite(frame.depth).all()
        assert (frame.depth >= 0).all()


def stamp(t: float) -> int:
    """ns."""
    return round(t * 1e9)


def image_message(
    k: int, topic: str, kind: str = "mono8", frame: str = "camera_optical", t: float | None = None
) -> Said:
    """The k-th image or depth image as sensor_msgs/Image."""
    pixels = grey_at(k) if kind == "mono8" else np.dstack([grey_at(k)] * 3) if kind == "bgr8" else depth_at(k)
    if kind == "32FC1":
        pixels = np.where(depth_at(k) > 0, depth_at(k) / 1000, np.nan).astype(np.float32)
    return raw_message(START + k / RATE if t is None else t, topic, kind, pixels, frame)


def raw_message(t: float, topic: str, kind: str, pixels: NDArray[np.generic], frame: str = "camera_optical") -> Said:
    height, width = pixels.shape[:2]
    content = {"height": height, "width": width, "encoding": kind, "is_bigendian": 0}
    content |= {"step": pixels.nbytes // height, "data": np.frombuffer(pixels.tobytes(), np.uint8)}
    return Said(topic, bags.IMAGE, stamp(t), lambda new: content, frame=frame)


def compressed_depth(k: int, topic: str, content: bytes, form: str, frame: str = "camera_optical") -> Said:
    data = {"format": form, "data": np.frombuffer(content, np.uint8)}
    return Said(topic, bags.COMPRESSED, stamp(START + k / RATE), lambda new: data, frame=frame)


def info_message(topic: str, camera: Camera = CAMERA, frame: str = "camera_optical") -> Said:
    plain = bags.camera_info(0, camera.matrix.ravel(), np.pad(camera.distortion, (0, 5 - len(camera.distortion))))

    def build(new: Any) -> dict[str, Any]:
        return plain.build(new) | {"height": camera.height, "width": camera.width}

    return Said(topic, bags.CAMERA_INFO, stamp(START), build, frame=frame)


def mounted(parent: str = "base_link", child: str = "camera_optical", pose: Array = MOUNTING) -> bags.Transform:
    """tf's transform of a camera."""
    from slamduel.datasets.recordings.write_depth import quaternion

    x, y, z = pose[:3, 3].tolist()
    a, b, c, d = quaternion(pose[:3, :3]).tolist()
    return bags.Transform(parent, child, (x, y, z), (a, b, c, d))


def odometry_messages(frames: int = 6) -> list[Said]:
    upright = (0.0, 0.0, 0.0, 1.0)
    times = np.arange(START - 0.2, START + frames / RATE + 0.2, 0.05).tolist()
    return [bags.odometry(stamp(t), 0.05 * RATE * max(t - START, 0.0), 0.0, upright) for t in times]

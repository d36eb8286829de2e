"""Detects a recording's kind, and opens its streams and those of the files beside it."""

from collections.abc import Iterable
from pathlib import Path

from ...core.errors import InputError
from ...core.factors import Truth
from ...core.files import check_regular
from ...frontend.markers.pipeline import Frame
from ..bags.bag import is_bag, is_whole
from ..bags.siblings import read_alone
from ..readings import FILES, Readings, read_readings
from ..robot_files import ROBOT, recording_in
from ..tags.tags_csv import TAGS, read_tags
from ..truth import PLACES, POSES, read_truth
from . import frames_folder, live, rosbag, video
from .frames_folder import FRAMES, pictures
from .robot import Robot
from .streams import Streams
from .video import VIDEOS

_KINDS = "a folder of frames, a video, tags.csv, or a ROS bag (.bag, .mcap, or a folder with metadata.yaml)"


def read_streams(path: Path, robot: Robot, seconds: float | None) -> Streams:
    """The streams of the recording at `path` and the files beside it; of a live camera, for `seconds`.

    InputError if there is no recording, or more than one, and for unusable files.
    """
    if is_live(path):
        return _plain(live.read(str(path), seconds), None, None, None)
    found = _frames_of(path, robot)
    check_regular(found)
    home = path if path.is_dir() and (path != found or _has_words(path)) else found.parent
    if is_bag(found):
        bag = rosbag.read(found, robot.topics, robot.counter_bits, commands=robot.commands is not None)
        bag.remarks.extend(read_alone(found))
        readings = bag.readings or read_readings(home, robot.counter_bits)
        return bag._replace(readings=readings, truth=read_truth(home))
    if found.suffix.lower() == ".csv":
        remarks = list[str]()
        tags = read_tags(found, remarks)
        readings, truth = read_readings(home, robot.counter_bits), read_truth(home)
        return Streams((), len(tags), readings, None, "", "", truth, remarks, tags=tags)
    fps, start = robot.frames.fps, robot.frames.start
    if found.is_dir():
        frames = frames_folder.read(found, home, fps, start)
        length = len(frames)
    elif found.suffix.lower() in VIDEOS:
        frames = video.read(found, home, fps, start)
        length = frames.length
    else:
        raise InputError(f"{found}: found a file of an unknown kind, expected {_KINDS}.")
    return _plain(frames, length, read_readings(home, robot.counter_bits), read_truth(home))


def _plain(frames: Iterable[Frame], length: int | None, readings: Readings | None, truth: Truth | None) -> Streams:
    """The streams of a recording that tells nothing of its camera."""
    return Streams(frames, length, readings, None, "", "", truth, [])


def is_live(path: Path) -> bool:
    """Tells if `path` is a camera of this machine."""
    return str(path).startswith(live.PREFIX)


def _frames_of(path: Path, robot: Robot) -> Path:
    """The bag, video or folder of pictures that `path` is or contains; of several the one named by robot.toml."""
    source = robot.frames.source
    if not path.is_dir():
        return path
    found = sorted(
        one
        for one in path.iterdir()
        if is_bag(one) or one.suffix.lower() in VIDEOS or (one.is_dir() and one.name == "frames") or one.name == TAGS
    )
    if is_whole(path, source) and ((path / "metadata.yaml").is_file() or all(is_bag(one) for one in found)):
        return path
    if not found and pictures(path) and (source is None or not (path / source).exists()):
        return path
    below = sorted(one for one in path.glob("*/*") if is_bag(one) or one.suffix.lower() in VIDEOS)
    if source is None and not found and below:
        raise InputError(
            f"{path}: has no metadata.yaml and no recording itself, but {below[0]} has one: name that one, with "
            f"--robot FILE, or write the folder's metadata.yaml with `ros2 bag reindex`."
        )
    return recording_in(path, "frames", source, found, _KINDS)


def _has_words(folder: Path) -> bool:
    """Tells if the files that belong to the frames in `folder` are in there with them."""
    return any((folder / name).exists() for name in (ROBOT, FRAMES, *FILES, POSES, PLACES))

"""Detects a recording's kind, and opens its streams and those of the files beside it."""

from collections.abc import Iterable
from pathlib import Path

from ...core.errors import InputError
from ...core.files import check_regular
from ...frontend.markers.pipeline import Frame
from ..bags.bag import is_bag, is_whole
from ..bags.siblings import read_alone
from ..readings import FILES, read_readings
from ..robot_files import ROBOT, recording_in
from ..tags.tags_csv import TAGS, read_tags
from ..truth import PLACES, POSES, read_truth
from . import frames_folder, live, rosbag, video
from .frames_folder import FRAMES, pictures
from .robot import Robot
from .streams import Streams
from .video import VIDEOS

_KINDS = "a folder of frames, a video, tags.csv, or a ROS bag (.bag, .mcap, or a folder with metadata.yaml)"


def read_streams(path: Path, robot: Robot, seconds: float | None) -> dict[str, Streams]:
    """The streams of the recording at `path` and the files beside it, by the name of the camera: "" is the only one.

    `seconds` limits a live camera. InputError if there is no recording, or more than one, and for unusable files.
    """
    if robot.views:
        return _of_several(path, robot)
    if is_live(path):
        return {"": _plain(live.read(str(path), seconds), None)}
    if robot.unmarked and not _has_frames(path, robot):
        return {"": _with_files(_plain((), None), path, robot)}
    found, home = _frames_of(path, robot.frames.source, "frames")
    streams = _read(found, home, robot)
    return {"": _with_files(streams, home, robot)}


def _has_frames(path: Path, robot: Robot) -> bool:
    """False for a folder that is no recording of frames, but has the files beside some."""
    inside = path.iterdir() if path.is_dir() else ()
    return robot.frames.source is not None or not path.is_dir() or is_bag(path) or any(map(is_bag, inside))


def _of_several(path: Path, robot: Robot) -> dict[str, Streams]:
    """The streams of several cameras; the motion is that of the first bag that has some, or of files at `path`."""
    if is_live(path):
        tables = ", ".join(f"[camera.{name}]" for name in robot.views)
        raise InputError(f"{path}: is one camera, expected {ROBOT} without {tables}.")
    streams, home, taken = dict[str, Streams](), path if path.is_dir() else path.parent, dict[tuple[Path, str], str]()
    for name, view in robot.views.items():
        table, source = f"camera.{name}", view.frames.source
        inside = path if source is None else recording_in(path, table, source, (), _KINDS)
        found, place = _frames_of(inside, None, table)
        if source is None and not is_bag(found):
            raise InputError(f"{found}: is no bag, which the topic of [{table}] in {ROBOT} needs; expected its source.")
        motion = all(one.readings is None for one in streams.values())
        one = _read(found, place, view, name, motion=motion)
        other = taken.setdefault((found.resolve(), one.topic), name)
        if other != name:
            of = f"topic {one.topic} of {found}" if one.topic else str(found)
            raise InputError(
                f"{path}: [camera.{other}] and [{table}] in {ROBOT} both have {of}, expected one for each."
            )
        streams[name] = one
    names = sorted(streams, key=lambda name: streams[name].readings is None)
    known = _with_files(streams[names[0]], home, robot)
    return {name: one._replace(readings=known.readings, truth=known.truth) for name, one in streams.items()}


def _read(found: Path, home: Path, robot: Robot, camera: str = "", *, motion: bool = True) -> Streams:
    """Reads what `found` tells, the files at `home` saying when; of several cameras of the one called `camera`.

    `motion`: with the readings of a bag.
    """
    if is_bag(found):
        commands = robot.commands is not None
        bag = rosbag.read(found, robot.topics, robot.counter_bits, commands=commands, camera=camera, motion=motion)
        bag.remarks.extend(read_alone(found))
        return bag
    if camera and robot.topics.image is not None:
        raise InputError(f"{found}: is no bag, expected [camera.{camera}] in {ROBOT} without a topic.")
    if found.suffix.lower() == ".csv":
        remarks = list[str]()
        tags = read_tags(found, remarks)
        return _plain((), len(tags))._replace(remarks=remarks, tags=tags)
    fps, start = robot.frames.fps, robot.frames.start
    if found.is_dir():
        folder = frames_folder.read(found, home, fps, start)
        return _plain(folder, len(folder))
    if found.suffix.lower() in VIDEOS:
        film = video.read(found, home, fps, start)
        return _plain(film, film.length)
    raise InputError(f"{found}: found a file of an unknown kind, expected {_KINDS}.")


def _plain(frames: Iterable[Frame], length: int | None) -> Streams:
    """The streams of a recording that tells nothing but frames."""
    return Streams(frames, length, None, None, "", "", None, [])


def _with_files(streams: Streams, home: Path, robot: Robot) -> Streams:
    """The streams with the readings at `home`, unless a bag has some, and the truth."""
    readings = streams.readings or read_readings(home, robot.counter_bits, streams.remarks)
    return streams._replace(readings=readings, truth=read_truth(home))


def places(path: Path, robot: Robot) -> tuple[Path, Path]:
    """The bag, video or folder of the frames, of several cameras the first one's, and the folder of what is beside."""
    if robot.unmarked and not _has_frames(path, robot):
        return path, path
    if not robot.views:
        return _frames_of(path, robot.frames.source, "frames")
    name, view = next(iter(robot.views.items()))
    source = view.frames.source
    inside = path if source is None else recording_in(path, f"camera.{name}", source, (), _KINDS)
    return _frames_of(inside, None, f"camera.{name}")[0], path if path.is_dir() else path.parent


def is_live(path: Path) -> bool:
    """Tells if `path` is a camera of this machine."""
    return str(path).startswith(live.PREFIX)


def _frames_of(path: Path, source: str | None, table: str) -> tuple[Path, Path]:
    """The bag, video or folder of pictures that `path` is or contains, of several `source`, which `table` names.

    With it, the folder of the files that belong to it.
    """
    found = _frames_in(path, source, table)
    check_regular(found)
    return found, path if path.is_dir() and (path != found or _has_words(path)) else found.parent


def _frames_in(path: Path, source: str | None, table: str) -> Path:
    if not path.is_dir():
        return path
    found = sorted(
        one
        for one in path.iterdir()
        if is_bag(one) or one.suffix.lower() in VIDEOS or (one.is_dir() and one.name == "frames") or one.name == TAGS
    )
    shown = pictures(path) if source is None and [one.name for one in found] == [TAGS] else []
    if shown:
        several = f"{shown[0].name} and {len(shown) - 1:,} more pictures" if shown[1:] else shown[0].name
        raise InputError(
            f"{path}: has {several} as well as {TAGS}, expected one of them, or [{table}] source in {ROBOT} to select: "
            f'"." is the pictures.'
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
    return recording_in(path, table, source, found, _KINDS)


def _has_words(folder: Path) -> bool:
    """Tells if the files that belong to the frames in `folder` are in there with them."""
    return any((folder / name).exists() for name in (ROBOT, FRAMES, *FILES, POSES, PLACES))

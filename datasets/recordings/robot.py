"""Reads and writes robot.toml, a robot's parameters for reading its recordings.

    name = "my robot"
    [camera]     calibration, size, mounting = {xyz, rpy} or {matrix}, time_offset, exposure, readout, rectified
    [camera.left]  the same and source, fps, start, topic, camera_info, of each of several cameras
    [markers]    dictionary, side, sides, max_range, max_distance, ignore, corner_sd
    [encoder]    left, right, base, k, noise, interval, curve, floors, counter_bits, max_speed
    [odometry]   forward, turning, turning_by_turn, floors, max_speed
    [commands]   full, base, delay, forward, turning, turning_by_turn, floors, max_speed
    [drift]      position, turning, floors        of the pose per root second, for frames without any motion
    [noise]      model = "proportional": k_range, k_bearing, floor_range, floor_bearing, sway
                 model = "propagated": scale, floor_range, floor_bearing, sway
    [prior]      pose, sd
    [topics]     image, encoder, odometry, commands, camera_info, tags
    [frames]     source, fps, start
    [imu]        as `inertial.robot` reads it
    [gps]        and [compass], as `fixes.robot` reads them
    [laser]      as `scans.robot` reads it, of a robot with a scanner as well
    [depth]      as `depth.robot` reads it, of a robot with a depth camera as well

Only [markers] dictionary and side are required, and not of tags whose poses another program found. With several
cameras, each named in a table of its own, [frames] and the topics of frames are in these. [laser] in place of [markers]
is read by `scans`, [depth] by `depth`. Lengths are in m, angles in rad, times in s.
"""

import shutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ...core.errors import InputError
from ...core.factors import Prior
from ...core.files import write_whole
from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.camera.calibration import write_opencv
from ...frontend.camera.camera import Camera
from ...frontend.camera.mounting import mounting
from ...frontend.markers.markers import Markers
from ...frontend.markers.noise import Noise, PropagatedNoise, ProportionalNoise
from ...frontend.wheels.commands import FOLLOWED, Commands
from ...frontend.wheels.counters import COUNTER_BITS, MAX_SPEED
from ...frontend.wheels.encoder import Encoder
from ...frontend.wheels.motion import Drift
from ...frontend.wheels.track import TrackNoise
from ..depth.robot import DepthRobot, depth_robot_in
from ..fixes.robot import WorldTables, world_in
from ..inertial.robot import ImuTable, imu_in
from ..prior import read_prior
from ..robot_files import CALIBRATION, file_of
from ..robot_limits import check_limits
from ..robot_tables import TRACK, cameras_in, floors_in, names_of, numbers_in, track_noise, without_none
from ..scans.robot import LaserRobot, laser_robot_in
from .robot_camera import CAMERA, TOPICS, FrameSource, frames_in, of_camera
from .rosbag import Topics

NOISES: dict[str, type[Noise]] = {"proportional": ProportionalNoise, "propagated": PropagatedNoise}
"""[noise] model -> a dataclass whose fields, all numbers, are the table's other keys."""

USUAL = 0.02
"""m, default standard deviation of a wheel that rolls 1 m: twice the document's k, as tyres and floors differ."""

ANY_SIDE = 0.1
"""m, in place of one that is not given, where only the rest of the markers is checked."""

NOT_MEASURED = "nothing was measured of {of}: stated as {words} by default; bench noise measures it"


CORNER_SD = 0.3
"""px, of an unrefined corner, as AprilTag's and OpenCV's detectors give it."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot: its camera, its motion model, and the markers around it."""

    name: str
    markers: Markers
    camera: Camera | None = None  # None: from `lens`, or else from the recording
    # (4, 4) T_robot_camera, the camera's own if there is one; straight ahead from the robot's origin
    mounting: Array = field(default_factory=lambda: mounting(0, 0, 0, 0))
    time_offset: float = 0.0  # s, added to the frames' stamps to get the motion's clock
    exposure: float = 0.0  # s; frames are stamped at its start, that of their first row
    readout: float = 0.0  # s from the first row's exposure to the last's, the camera's own if there is one
    rectified: bool | None = None  # if tags that another program found are of rectified images; None: not said
    max_range: float = 3.0  # m, of the robot's origin in its plane
    max_distance: float = np.inf  # m, of the camera
    corner_sd: float = CORNER_SD  # px, of a corner of such a tag along each axis
    encoder: Encoder | None = None
    counter_bits: int | None = None  # the width of the wheels' counters; None: they never wrap
    max_speed: float = MAX_SPEED  # m/s; faster readings are invalid
    track_noise: TrackNoise = field(default_factory=TrackNoise)
    commands: Commands | None = None  # None: robot.toml has none
    drift: Drift | None = None  # for recordings without motion readings
    noise: Noise = field(default_factory=ProportionalNoise)
    prior: Prior | None = None  # None: nobody gave the start
    imu: ImuTable | None = None
    world: WorldTables = field(default_factory=WorldTables)
    laser: LaserRobot | None = None  # of a robot with a scanner as well
    depth: DepthRobot | None = None  # of one with a depth camera as well
    topics: Topics = field(default_factory=Topics)
    frames: FrameSource = field(default_factory=FrameSource)
    views: Mapping[str, "Robot"] = field(default_factory=dict[str, "Robot"])  # name of a camera -> with that one alone
    unmarked: bool = False  # it has a scanner and a depth camera and no [markers]: no frame is looked at for these
    lens: Callable[[int, int], Camera] | None = None  # by the images' size, px, where the calibration lacks it
    # keys of [markers] that robot.toml lacks -> the sentence that asks for them where they are needed
    lacks: Mapping[str, str] = field(default_factory=dict[str, str])
    # remarks on numbers that were not given, by the table that would have them; those of "" on the whole
    assumed: Mapping[str, str] = field(default_factory=dict[str, str])


def read_robot(path: Path) -> Robot:
    """Reads the robot in `path`, a robot.toml; InputError names the file, line and key of a fault."""
    tables = (
        "camera",
        "markers",
        "encoder",
        "odometry",
        "commands",
        "drift",
        "noise",
        "prior",
        "topics",
        "frames",
        "imu",
        "gps",
        "compass",
    )
    file = TomlTable.read(path).only(("name", *tables, "laser", "depth"))
    unmarked = not file.has("markers") and file.has("laser") and file.has("depth")
    if file.has("laser") and not file.has("markers") and not unmarked:
        raise file.refused("laser", "is of a robot with a scanner, expected [markers], for one with a camera.")
    if file.has("depth") and not file.has("markers") and not unmarked:
        raise file.refused("depth", "is of a robot with a depth camera, expected [markers], for one with a camera.")
    camera = file.table("camera")
    names = cameras_in(camera, CAMERA)
    if not names:
        camera.only(CAMERA)
    markers = file.table("markers").only(
        ("dictionary", "side", "sides", "max_range", "max_distance", "ignore", "corner_sd")
    )
    odometry = file.table("odometry").only((*TRACK, "floors", "max_speed"))
    encoder = file.table("encoder").only((*names_of(Encoder), "counter_bits", "max_speed"))
    commands = file.table("commands").only(("full", "base", "delay", *TRACK, "floors", "max_speed"))
    frames = file.table("frames").only(names_of(FrameSource))
    others = ("depth", "depth_info") if file.has("depth") else ()
    topics = file.table("topics").only((*Topics._fields, *others))
    robot = Robot(
        name=file.text_or_none("name") or path.absolute().parent.name,
        markers=_markers(markers),
        max_range=markers.number("max_range", np.inf if markers.has("max_distance") else 3.0, above=0),
        max_distance=markers.number("max_distance", np.inf, above=0),
        corner_sd=markers.number("corner_sd", CORNER_SD, above=0),
        encoder=_encoder(encoder) if file.has("encoder") else None,
        counter_bits=encoder.choice("counter_bits", None, COUNTER_BITS),
        max_speed=_max_speed(encoder, odometry, commands),
        track_noise=track_noise(odometry),
        commands=_commands(commands) if file.has("commands") else None,
        drift=_drift(file.table("drift").only(names_of(Drift))) if file.has("drift") else None,
        noise=_noise(file.table("noise")),
        prior=read_prior(file.table("prior")) if file.has("prior") else None,
        imu=imu_in(file),
        world=world_in(file),
        laser=laser_robot_in(file) if file.has("laser") else None,
        depth=depth_robot_in(file) if file.has("depth") else None,
        topics=Topics(**{key: topics.text(key) for key in topics.entries if key not in others}),
        frames=frames_in(frames),
        lacks={
            key: str(markers.lacks(key, expected))
            for key, expected in (("dictionary", "a text in quotes"), ("side", "a number above 0"))
            if not markers.has(key)
        },
        assumed=_assumed(encoder, commands),
        unmarked=unmarked,
        **({} if names else of_camera(camera)),
    )
    check_limits(file, names)
    return replace(robot, views=_views(robot, camera, names, file)) if names else robot


def _views(robot: Robot, cameras: TomlTable, names: Collection[str], file: TomlTable) -> dict[str, Robot]:
    """The robot with each of several cameras alone. InputError where the frames of one are not named, or for all."""
    for key, others in (("frames", names_of(FrameSource)), ("topics", ("image", "tags", "camera_info"))):
        for one in others:
            if file.table(key).has(one):
                place = f"[camera.{next(iter(names))}]"
                raise file.table(key).refused(one, f"is of an only camera, expected {place} and others to say theirs.")
    views = dict[str, Robot]()
    for name in names:
        table = cameras.table(name).only((*CAMERA, *names_of(FrameSource), *TOPICS))
        if not (table.has("source") or table.has("topic")):
            raise table.lacks("source", "the folder, video, tags.csv or bag of its frames, or a topic in the bag")
        topics = robot.topics._replace(**{TOPICS[key]: table.text(key) for key in TOPICS if table.has(key)})
        views[name] = replace(robot, frames=frames_in(table), topics=topics, **of_camera(table, name))
    return views


def _words(robot: Robot, name: str = "") -> dict[str, Any]:
    """The table of an only camera, or of the one called `name`, with its frames."""
    words = {
        "calibration": None if robot.camera is None else str(file_of(Path(CALIBRATION), name)),
        "mounting": {"matrix": robot.mounting.tolist()},
        "time_offset": robot.time_offset,
        "exposure": robot.exposure,
        "readout": robot.readout,
        "rectified": robot.rectified,
    }
    topics = {key: getattr(robot.topics, topic) for key, topic in TOPICS.items()}
    frames = {"source": robot.frames.source} if robot.frames.fps is None else asdict(robot.frames)
    return words | frames | topics if name else words


def _prior(prior: Prior) -> dict[str, list[float]]:
    return {"pose": prior.pose.tolist(), "sd": np.sqrt(np.diag(prior.cov)).tolist()}


def write_robot(path: Path, robot: Robot) -> None:
    """Writes `robot` to `path`, with its camera, if any, and a marker dictionary given as a file beside it.

    It reads back the same. InputError if it cannot be written.
    """
    sides = {str(name): side for name, side in sorted(robot.markers.sides.items())}
    encoder, odometry = {}, {} if robot.track_noise == TrackNoise() else asdict(robot.track_noise)
    if robot.encoder is not None:
        encoder = asdict(robot.encoder) | {"counter_bits": robot.counter_bits}
    commands = {} if robot.commands is None else asdict(robot.commands)
    commands |= commands.pop("noise", {})
    (odometry if robot.encoder is None else encoder)["max_speed"] = robot.max_speed
    dictionary = (robot.markers.folder or Path()) / robot.markers.dictionary
    cameras = {name: _words(view, name) for name, view in robot.views.items()}
    words: dict[str, Any] = {
        "name": robot.name,
        "camera": cameras or _words(robot),
        "markers": {
            "dictionary": dictionary.name if dictionary.is_file() else robot.markers.dictionary or None,
            "side": None if np.isnan(robot.markers.side) else robot.markers.side,
            "sides": sides or None,
            "max_range": robot.max_range if np.isfinite(robot.max_range) else None,
            "max_distance": robot.max_distance if np.isfinite(robot.max_distance) else None,
            "ignore": list(robot.markers.ignore) or None,
            "corner_sd": None if robot.corner_sd == CORNER_SD else robot.corner_sd,
        },
        "encoder": encoder,
        "odometry": odometry,
        "commands": commands,
        "drift": {} if robot.drift is None else asdict(robot.drift),
        "noise": dict(robot.noise.settings),
        "prior": {} if robot.prior is None else _prior(robot.prior),
        "topics": robot.topics._asdict(),
        "imu": {} if robot.imu is None else robot.imu.words,
        **robot.world.words,
        "laser": {} if robot.laser is None else robot.laser.words,
        "depth": {} if robot.depth is None else robot.depth.words,
        "frames": {} if robot.frames == FrameSource() else asdict(robot.frames),
    }
    try:
        for name, one in (robot.views or {"": robot}).items():
            if one.camera is not None:
                write_opencv(path.with_name(file_of(Path(CALIBRATION), name).name), one.camera)
        if dictionary.is_file() and not path.with_name(dictionary.name).exists():
            shutil.copyfile(dictionary, path.with_name(dictionary.name))
        write_whole(path, tomli_w.dumps(without_none(words)))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from error


def _markers(markers: TomlTable) -> Markers:
    sides = markers.table("sides")
    for key in sides.entries:
        if not (key.isascii() and key.isdigit()):
            raise sides.refused(key, "is not a marker's id, expected a whole number.")
    known = Markers(
        markers.text_or_none("dictionary") or "",
        markers.number("side", above=0) if markers.has("side") else np.nan,
        {int(key): sides.number(key, above=0) for key in sides.entries},
        Path(markers.file).parent,
        markers.wholes("ignore") if markers.has("ignore") else (),
    )
    if known.dictionary:
        try:
            _ = known.opencv
        except InputError as error:
            raise InputError(f"{markers.where('dictionary')}: {error}") from None
    (known if markers.has("side") else replace(known, side=ANY_SIDE)).check(markers.where())
    return known


def _encoder(encoder: TomlTable) -> Encoder:
    rolls: dict[str, Any] = {key: encoder.number(key) for key in ("left", "right")}
    for key in ("left", "right"):
        if rolls[key] == 0:
            raise encoder.fault(key, "metres per count, a number other than 0")
    for key, choices in {"noise": ("proportional", "distance"), "curve": ("midpoint", "arc")}.items():
        if encoder.has(key):
            rolls[key] = encoder.choice(key, None, choices)
    rolls |= numbers_in(encoder, ("interval",), above=0) | floors_in(encoder)
    if not encoder.has("k") and rolls.get("noise", "distance") == "distance":
        rolls |= {"noise": "distance", "k": USUAL}
    else:
        rolls["k"] = encoder.number("k", least=0)
    return Encoder(**rolls, base=encoder.number("base", above=0))


def _commands(commands: TomlTable) -> Commands:
    given = numbers_in(commands, ("full", "base"), above=0) | numbers_in(commands, ("delay",))
    noise = replace(FOLLOWED, **numbers_in(commands, TRACK, least=0), **floors_in(commands))
    return Commands(**given, noise=noise)


def _assumed(encoder: TomlTable, commands: TomlTable) -> dict[str, str]:
    found = dict[str, str]()
    if not encoder.has("k"):
        words = f"k = {USUAL:g} m for a wheel that rolls 1 m"
        found["encoder"] = NOT_MEASURED.format(of="the wheels' noise", words=words)
    words = ", ".join(f"{key} = {getattr(FOLLOWED, key):g}" for key in TRACK if not commands.has(key))
    if words:
        found["commands"] = NOT_MEASURED.format(of="the way in which the robot follows its commands", words=words)
    return found


def _max_speed(*tables: TomlTable) -> float:
    given = [(table.number("max_speed", above=0), table) for table in tables if table.has("max_speed")]
    for speed, table in given[1:]:
        if speed != given[0][0]:
            first, name = given[0][0], given[0][1].place[-1]
            raise table.fault("max_speed", f"[{name}]'s {first:g}, or nothing")
    return given[0][0] if given else MAX_SPEED


def _drift(drift: TomlTable) -> Drift:
    return Drift(drift.number("position", above=0), drift.number("turning", above=0), **floors_in(drift))


def _noise(noise: TomlTable) -> Noise:
    model: Any = NOISES[noise.choice("model", "proportional", tuple(NOISES))]
    return model(**numbers_in(noise.only(("model", *names_of(model))), names_of(model), least=0))

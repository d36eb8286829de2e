"""Opens a ROS bag of a depth camera: its images, cameras, their places by tf, and the robot's odometry."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.camera.camera import Camera
from ...frontend.wheels.track import Poses
from ..bags.bag import Bag, Topic
from ..bags.camera_info import camera_of, of_images
from ..bags.cameras import CAMERA_INFO, info_beside
from ..bags.odometry import find_odometry
from ..bags.topics import found, plain
from ..bags.transforms import Transforms
from ..bags.window import window_of
from ..robot_files import ROBOT
from .bag_images import chosen, frame_of, measured, picture, shots
from .folder import robot_truth
from .registering import Registration
from .robot import DepthRobot
from .sources import Sources

FOOTPRINT, BASES = "base_footprint", ("base_link", "base_footprint")
"""Frames of the robot: its origin on the floor, and those of its odometry where that does not name one."""

ELSEWHERE, TURNED = 0.05, 0.05  # m and rad by which tf and robot.toml may differ without a remark


class _Seen(NamedTuple):
    """A topic of images, and tf's frame of its camera."""

    topic: Topic
    frame: str


def read_bag(path: Path, robot: DepthRobot, *, moved: bool = True) -> Sources:
    """The images of the bag at `path` and its odometry, with remarks; without odometry unless `moved`.

    InputError for a bag that is damaged, topics that are missing or ambiguous, a camera without calibration, and one
    whose place on the robot, or beside the camera of the images, is unknown.
    """
    bag = Bag(path)
    listed = bag.listed()
    if not any(topic.messages for topic in listed):
        raise InputError(f"{path}: contains no messages, expected a recording.")
    topics, remarks = robot.topics, bag.remarks()
    image, depth = (_Seen(topic, frame_of(bag, topic)) for topic in chosen(bag, listed, topics.image, topics.depth))
    transforms = Transforms(bag, listed)
    odometry = None
    if moved:
        odometry = find_odometry(bag, listed, transforms, topics.odometry, robot.odom_frame, remarks)
    if odometry is None and moved:
        remarks.append(
            f"{path}: has no odometry, neither a topic of it nor a transform of tf from {robot.odom_frame!r}"
        )
    readings: Poses | None = None if odometry is None else odometry.readings
    if robot.camera is not None:
        camera = of_images(robot.camera, None, image.topic.name, str(path), remarks)
    else:
        camera = _camera(bag, listed, topics.camera_info, "camera_info", image.topic, remarks)
    base = None if odometry is None else odometry.base
    camera = replace(camera, mounting=_mounting(path, transforms, image.frame, base, robot, remarks))
    registration = None
    if not _registered(image, depth, robot):
        source = robot.depth_camera or _camera(bag, listed, topics.depth_info, "depth_info", depth.topic, remarks)
        registration = Registration(source, camera, _beside(path, transforms, image.frame, depth.frame, robot))
    tracked = None if robot.truth_frame is None else transforms.tracked(robot.truth_frame, image.frame)
    if tracked is None and robot.truth_frame is not None:
        raise InputError(
            f"{path}: tf has no transform from {robot.truth_frame!r} that moves {image.frame}, expected the camera's "
            "true poses."
        )
    remarks += transforms.remarks
    used = {"image": image.topic.name, "depth": depth.topic.name}
    return Sources(
        images=lambda: shots(bag, image.topic, picture(image.topic), remarks),
        depths=lambda: shots(bag, depth.topic, measured(depth.topic, robot.units), remarks),
        camera=camera,
        registration=registration,
        readings=readings,
        topics=used | ({} if odometry is None else {"odometry": odometry.source}),
        length=image.topic.messages,
        remarks=remarks,
        truth=None if tracked is None else robot_truth(str(path), *tracked, camera.mounting),
    )


def _registered(image: _Seen, depth: _Seen, robot: DepthRobot) -> bool:
    """Tells if the depth is that of the images' pixels: by robot.toml, else by the frames, else by the topic's name."""
    if robot.registered is not None or robot.depth_camera is not None:
        return bool(robot.registered)
    return image.frame == depth.frame or "registered" in depth.topic.name or "aligned" in depth.topic.name


def _camera(
    bag: Bag, listed: Sequence[Topic], named: str | None, key: str, images: Topic, remarks: list[str]
) -> Camera:
    info = info_beside(bag.path, listed, named, f"[topics] {key}", images)
    if info is None:
        raise InputError(
            f"{bag.path}: has no topic of {plain(CAMERA_INFO)} for {images.name}, expected one, or "
            f"[{'camera' if key == 'camera_info' else 'depth'}] calibration in {ROBOT}; {found(listed)}"
        )
    recorded = camera_of(bag, info, images, remarks)
    if recorded.camera is None:
        raise InputError(f"{bag.path}: {recorded.lacking}, expected its focal length.")
    window = window_of(bag, info, images)
    return recorded.camera if window is None else window.of(recorded.camera)


def _mounting(
    path: Path, transforms: Transforms, frame: str, base: str | None, robot: DepthRobot, remarks: list[str]
) -> Array:
    """T_robot_camera, to the robot's origin on the floor where tf knows it; that of robot.toml counts."""
    given = robot.mounting
    pose = transforms.fixed(FOOTPRINT, frame) if transforms.knows(FOOTPRINT) else None
    base = base or next((name for name in BASES if transforms.knows(name)), BASES[0])
    pose = transforms.fixed(base, frame) if pose is None else pose
    if given is None and pose is None:
        raise InputError(
            f"{path}: tf does not tell where {frame or 'the camera'} is on {base}, expected {robot.placing}."
        )
    if given is None:
        assert pose is not None
        return pose
    if pose is not None:
        away = float(np.linalg.norm(given[:3, 3] - pose[:3, 3]))
        turn = float(np.arccos(np.clip((np.trace(given[:3, :3].T @ pose[:3, :3]) - 1) / 2, -1, 1)))
        if away > ELSEWHERE or turn > TURNED:
            remarks.append(
                f"{path}: [camera] mounting, which is used, differs by {away:.3g} m and {np.rad2deg(turn):.3g} degrees "
                f"from where tf has {frame} on {base}"
            )
    return given


def _beside(path: Path, transforms: Transforms, image: str, depth: str, robot: DepthRobot) -> Array:
    """T_camera_depth by robot.toml, else by tf."""
    if robot.pose is not None:
        return robot.pose
    pose = transforms.fixed(image, depth)
    if pose is None:
        raise InputError(
            f"{path}: the depth is of another camera, {depth or 'without a frame'}, and tf does not tell where that is "
            f"in {image or 'a frame without a name'}, expected [depth] pose in {ROBOT}, or registered = true."
        )
    return pose

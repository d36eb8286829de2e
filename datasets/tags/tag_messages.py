"""Tags in a ROS bag, as detectors publish them.

    apriltag_msgs/AprilTagDetectionArray                      corners; of apriltag_ros in ROS 2 and of TagSLAM
    apriltag_ros/AprilTagDetectionArray                       poses with covariances, mostly zero: unknown; in ROS 1
    isaac_ros_apriltag_interfaces/AprilTagDetectionArray      poses and corners

Bags carry the definitions of such messages, but for older ones of ROS 2 in sqlite3; for these, and where a definition
cannot be parsed, those below stand. Stamps are those of the images.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.camera.quaternions import matrix
from ..bags.bag import Bag, Topic
from ..bags.columns import columns
from ..bags.left_out import LeftOut
from ..bags.tag_types import APRILTAG, APRILTAG_ROS, ISAAC
from .found_tags import FoundTag, TagFrame, fault_of

TYPES = (APRILTAG, APRILTAG_ROS, ISAAC)


def read_tag_messages(bag: Bag, topic: Topic, remarks: list[str]) -> list[TagFrame]:
    """The frames of a topic, those without tags as well, in order; `remarks` grows.

    Tags with numbers that no tag has are left out and counted. InputError where most are so, and as in `columns`.
    """
    contents = list[Any]()

    def row(message: Any) -> tuple[float, ...]:
        contents.append(message)
        return (len(contents) - 1.0,)

    t, rows = columns(bag, topic, row, remarks, faults=lambda *_: {})
    left_out, total, frames = LeftOut(str(bag.path), "tag", f"of topic {topic.name}"), 0, list[TagFrame]()
    for time, index in zip(t.tolist(), rows[:, 0].astype(int).tolist(), strict=True):
        tags, bundles = list[FoundTag](), 0
        for one in contents[index].detections:
            total += 1
            ids = np.atleast_1d(one.id)
            if len(ids) != 1:
                bundles += 1
                continue
            pose, cov, corners = _READ[topic.type](one)
            fault = fault_of(pose, cov, corners) if ids[0] >= 0 else f"has the id {ids[0]}"
            if fault is not None:
                left_out.add(total, f"at {time:.10g} s: {fault}")
                continue
            tags.append(FoundTag(int(ids[0]), None if pose is None else matrix(pose), cov, corners))
        frames.append(TagFrame(time, tags, bundles))
    remarks += left_out.remarks(total)
    if not any(frame.tags for frame in frames):
        raise InputError(f"{bag.path}: topic {topic.name} has no tag in {len(frames)} messages, expected some.")
    return frames


_Said = tuple[Array | None, Array | None, Array | None]  # x, y, z, qx, qy, qz, qw; their covariance; corners


def _corners(one: Any) -> _Said:
    """Corners as four points, or in older definitions as eight numbers."""
    corners = one.corners
    if hasattr(corners[0], "x"):
        corners = [(corner.x, corner.y) for corner in corners]
    return None, None, np.array(corners, float).reshape(4, 2)


def _pose(one: Any) -> _Said:
    """A pose, of which a covariance of zeros is unknown."""
    said = one.pose.pose
    place, turn = said.pose.position, said.pose.orientation
    cov = np.array(said.covariance, float).reshape(6, 6)
    pose = np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    return pose, cov if cov.any() else None, None


_READ: dict[str, Callable[[Any], _Said]] = {APRILTAG: _corners, APRILTAG_ROS: _pose, ISAAC: _pose}

"""Poses of tags in a camera's frames, with their covariances, and both as GTSAM has them.

A pose is T_camera_tag: the camera's frame is x right, y down, z forward; the tag's is x right, y up, z out of its
printed face, from its centre. The covariance is ROS's, of a PoseWithCovariance: of x, y, z, in m, and of a turn about
the axes x, y, z of the camera's frame, in rad, after the pose's own.
"""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints


class TagPoses(NamedTuple):
    """One row for each tag in each frame, in the order of the frames."""

    t: Array  # (n,) s, as the frames are stamped
    frame: Ints  # (n,) their numbers: the steps of the log
    ids: Ints  # (n,)
    poses: Array  # (n, 4, 4) T_camera_tag
    cov: Array  # (n, 6, 6)


class TagGraph(NamedTuple):
    """The tags from a robot's poses, as factors between poses in space."""

    t: Array  # (n,) s
    frame: Ints  # (n,)
    ids: Ints  # (n,)
    delta: Array  # (n, 4, 4) T_robot_tag
    cov: Array  # (n, 6, 6) of x, y, z and turn in the tag's own axes
    robot: Array  # (m, 4, 4) initial poses of all frames
    times: Array  # (m,) s, of all frames
    tags: dict[int, Array]  # id -> (4, 4) initial pose


def graph_of(found: TagPoses, mounting: Array, times: Array, path: Array) -> TagGraph:
    """The factors of tags seen by cameras at `mounting`, (n, 4, 4) T_robot_camera for each tag, on a robot.

    Initial poses are those of its planar `path` (m, 3) at `times` (m,), s, and of each tag where its first frame has
    it.
    GTSAM's tangent is a motion in the tag's own axes after the pose: R' d, of the turn as well as of the place.
    """
    delta = mounting @ found.poses
    own = np.zeros((len(found.t), 6, 6))
    own[:, :3, :3] = own[:, 3:, 3:] = found.poses[:, :3, :3].transpose(0, 2, 1)
    robot = np.tile(np.eye(4), (len(path), 1, 1))
    c, s = np.cos(path[:, 2]), np.sin(path[:, 2])
    robot[:, 0, 0], robot[:, 0, 1], robot[:, 1, 0], robot[:, 1, 1] = c, -s, s, c
    robot[:, :2, 3] = path[:, :2]
    tags = dict[int, Array]()
    for name, frame, seen in zip(found.ids.tolist(), found.frame.tolist(), delta, strict=True):
        tags.setdefault(name, robot[frame] @ seen)
    return TagGraph(
        found.t, found.frame, found.ids, delta, own @ found.cov @ own.transpose(0, 2, 1), robot, times, tags
    )

"""Poses of tags in PyFG's text format, whose tags are poses of a robot T that does not move.

    VERTEX_SE3:QUAT t A0 x y z qx qy qz qw                           initial pose of the robot at step 0
    VERTEX_SE3:QUAT t T7 x y z qx qy qz qw                           of the tag with id 7
    EDGE_SE3:QUAT t A0 T7 x y z qx qy qz qw c11 c12 ... c66          the tag's pose from the robot's

The 21 numbers are the upper triangle of a covariance, row by row, of the place first and then of the turn, in the tag's
axes. The format takes its vertices for the truth; here they are where odometry and first sightings have them.
"""

from collections.abc import Iterator
from pathlib import Path

from ...core.files import write_whole
from ...core.se2 import Array
from ...core.small_matrices import upper
from ...frontend.camera.quaternions import quaternion
from ..graphs.pyfg_write import POSE
from .tag_poses import TagGraph

TAG = "T"
VERTEX, EDGE = "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT"


def write_pyfg(path: Path, graph: TagGraph) -> None:
    """Writes the graph to `path` atomically, without odometry; OSError where that is impossible."""
    write_whole(path, "".join(f"{line}\n" for line in _lines(graph)))


def _lines(graph: TagGraph) -> Iterator[str]:
    for k, (t, pose) in enumerate(zip(graph.times.tolist(), graph.robot, strict=True)):
        yield f"{VERTEX} {t!r} {POSE}{k} {_pose(pose)}"
    for name, pose in sorted(graph.tags.items()):
        first = graph.t[graph.ids == name].tolist()[0]
        yield f"{VERTEX} {first!r} {TAG}{name} {_pose(pose)}"
    columns = graph.t.tolist(), graph.frame.tolist(), graph.ids.tolist(), graph.delta, upper(graph.cov).T.tolist()
    for t, frame, name, delta, cov in zip(*columns, strict=True):
        yield f"{EDGE} {t!r} {POSE}{frame} {TAG}{name} {_pose(delta)} {_numbers(cov)}"


def _pose(pose: Array) -> str:
    return _numbers([*pose[:3, 3].tolist(), *quaternion(pose[:3, :3]).tolist()])


def _numbers(numbers: list[float]) -> str:
    return " ".join(map(repr, numbers))

"""The frames that a bag's tf messages know: which part of the robot is where, and odometry without a topic of its own.

A transform is fixed if it is in a topic named tf_static or the same in all messages; ROS 1 repeats fixed ones.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import LARGEST
from ...frontend.camera.quaternions import matrix
from ...frontend.wheels.track import Poses
from .bag import TRANSFORMS, Bag, Topic
from .clock import BACK, astray
from .columns import no_poses, planar
from .left_out import LeftOut

FARTHEST = 100.0  # m between two parts of a robot

STILL = 1e-6
"""m, and in parts of a quaternion, by which a fixed transform may differ between messages."""

Pair = tuple[str, str]  # a frame and the one in it: parent, child


class Moves(NamedTuple):
    """The transforms of one pair of frames, in the order of their times."""

    t: Array  # (m,) s
    rows: Array  # (m, 7) x, y, z, qx, qy, qz, qw of the child in its parent's axes


class _Given(NamedTuple):
    """The transforms of one pair of frames, in the order of reception."""

    stamps: list[int]  # ns
    received: list[int]  # ns
    rows: list[tuple[float, ...]]  # of seven numbers, as in `Moves`


class Transforms:
    """The transforms of a bag."""

    def __init__(self, bag: Bag, listed: Sequence[Topic]) -> None:
        """Reads them; InputError where most messages of a topic cannot be read."""
        self._where = str(bag.path)
        self.remarks = list[str]()  # grows by those that are left out of what is asked for
        self._left_out: dict[str, list[str]] = {}  # child -> the remark
        self._moves: dict[Pair, Moves] = {}
        self._back: dict[Pair, tuple[int, int]] = {}  # a stamp, ns, and the one before it, where the clock went back
        self._odd: dict[str, str] = {}  # child -> what is wrong with a transform to it
        self._fixed: dict[str, tuple[str, Array]] = {}  # child -> parent, (4, 4) of the child in its parent
        for topic in listed:
            if topic.type in TRANSFORMS and topic.messages:
                self._add(bag, topic)

    def _add(self, bag: Bag, topic: Topic) -> None:
        """Takes the transforms of a topic; those that cannot be used are refused where they are asked for."""
        found, unreadable = dict[Pair, _Given](), LeftOut(self._where, "message", f"of topic {topic.name}")
        number = 0
        for number, (received, message) in enumerate(bag.received(topic.name), start=1):
            if message is None:
                unreadable.add(number, "cannot be read")
                continue
            for one in message.transforms:
                pair = one.header.frame_id.strip("/"), one.child_frame_id.strip("/")
                at, turn = one.transform.translation, one.transform.rotation
                given = found.setdefault(pair, _Given([], [], []))
                given.stamps.append(one.header.stamp.sec * 10**9 + one.header.stamp.nanosec)
                given.received.append(received)
                given.rows.append((at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w))
        self.remarks += unreadable.remarks(number)
        for pair, given in found.items():
            self._take(pair, given, topic)

    def _take(self, pair: Pair, given: "_Given", topic: Topic) -> None:
        """Takes all transforms between two frames."""
        (parent, child), rows = pair, np.array(given.rows, float)
        with np.errstate(all="ignore"):
            norm = np.linalg.norm(rows[:, 3:], axis=1)
            sound = (np.abs(rows) <= LARGEST).all(axis=1) & (np.abs(norm - 1) < 1e-2)
        expected = "expected finite numbers and a quaternion of length 1"
        wrong = astray(given.stamps, given.received) | {
            int(row): f"at {given.stamps[row] / 1e9} s, is {rows[row]}, {expected}" for row in np.flatnonzero(~sound)
        }
        left_out = LeftOut(self._where, "transform", f"from {parent} to {child} in topic {topic.name}")
        for row, why in wrong.items():
            left_out.add(row + 1, why)
        try:
            self._left_out[child] = left_out.remarks(len(rows))
        except InputError as error:
            self._odd[child] = str(error)
        by_time, before = dict[int, int](), None
        for row, stamp in enumerate(given.stamps):
            if row not in wrong or child in self._odd:
                if before is not None and before - stamp > BACK * 1e9:
                    self._back.setdefault(pair, (stamp, before))
                by_time[stamp] = row
                before = stamp
        t = sorted(by_time)
        rows = rows[[by_time[stamp] for stamp in t]]
        static = topic.name.strip("/").endswith("tf_static")
        if child not in self._odd and (static or (np.ptp(rows, axis=0) < STILL).all()):
            self._fixed[child] = parent, matrix(rows[-1])
        self._moves[pair] = Moves(np.array(t) / 1e9, rows)

    def odometry(self, frame: str) -> tuple[str, Poses] | None:
        """The frame in `frame`, which is the odometry's, and its poses there; None if there is none.

        A namespace may stand before the frame's name: robot1/odom. InputError for several, or one not on a floor.
        """
        found = [pair for pair in self._moves if pair[0].rpartition("/")[2] == frame.strip("/").rpartition("/")[2]]
        found = [pair for pair in found if pair[0] == frame.strip("/")] or found
        if not found:
            return None
        if len(found) > 1:
            named = ", ".join(f"{parent} to {child}" for parent, child in sorted(found))
            raise InputError(f"{self._where}: tf has the transforms {named}, expected one from the odometry's frame.")
        (pair,) = found
        self._check(pair[1])
        t, rows = self._moves[pair]
        where = f"{self._where}: tf from {pair[0]} to {pair[1]}"
        if pair in self._back:
            stamp, before = (at / 1e9 for at in self._back[pair])
            raise InputError(f"{where} is at {stamp} s after {before} s, expected one clock that goes forward.")
        rows = rows[:, [0, 1, 3, 4, 5, 6]]
        left_out = LeftOut(self._where, "transform", f"from {pair[0]} to {pair[1]}")
        faults = no_poses(rows, t)
        for row, why in faults.items():
            left_out.add(row + 1, f"at {t[row]:.10g} s, {why}")
        self.remarks += left_out.remarks(len(t))
        kept = [row for row in range(len(t)) if row not in faults]
        return pair[1], planar(t[kept], rows[kept])

    def tracked(self, frame: str, other: str) -> tuple[Array, Array] | None:
        """Times (m,), s, and poses (m, 4, 4) of `other` in `frame`, by one transform that moves and by fixed ones.

        None if there is no such way. InputError for a transform that is not one.
        """
        root, rest = self._from_root(other.strip("/"))
        moves = self._moves.get((frame.strip("/"), root))
        if moves is None:
            return None
        return moves.t, np.array([matrix(row) for row in moves.rows]) @ rest

    def knows(self, frame: str) -> bool:
        """Tells if there is a transform to or from a frame."""
        return any(frame.strip("/") in pair for pair in self._moves)

    def fixed(self, frame: str, other: str) -> Array | None:
        """The pose (4, 4) of `other` in `frame` by fixed transforms; None if these do not connect them.

        InputError for two that are too far apart to be of one robot.
        """
        (root, one), (same, two) = self._from_root(frame.strip("/")), self._from_root(other.strip("/"))
        if root != same:
            return None
        back = np.eye(4)
        with np.errstate(over="ignore", invalid="ignore"):
            back[:3, :3], back[:3, 3] = one[:3, :3].T, -one[:3, :3].T @ one[:3, 3]
            pose = back @ two
            away = float(np.abs(pose[:3, 3]).max())
        if not away <= FARTHEST:
            raise InputError(
                f"{self._where}: tf has {other} {away:.3g} m from {frame}, expected at most {FARTHEST:g} m between "
                "parts of one robot."
            )
        return pose

    def _check(self, frame: str) -> None:
        if frame in self._odd:
            raise InputError(self._odd[frame])
        self.remarks += self._left_out.pop(frame, [])

    def _from_root(self, frame: str) -> tuple[str, Array]:
        """The frame that `frame` hangs on at last, and its pose (4, 4) there."""
        pose, seen = np.eye(4), {frame}
        self._check(frame)
        while frame in self._fixed:
            frame, step = self._fixed[frame]
            self._check(frame)
            pose = step @ pose
            if frame in seen:
                raise InputError(f"{self._where}: the transforms of tf lead from {frame} back to it, expected a tree.")
            seen.add(frame)
        return frame, pose

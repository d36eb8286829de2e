"""Submaps: what marginalised poses told of landmarks, as coordinates in the frame of one pose."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints


class Condensed(NamedTuple):
    """Information of a stretch about m landmarks: see `_condensed.condense`."""

    landmarks: Ints  # (m,) variables
    information: Array  # (2m, 2m) information about their offsets in the world
    side: Array  # (2m,) its right-hand side
    constant: float  # of J


@dataclass
class Submap:
    """A part of J, y' information y - 2 side' y + constant.

    y are the coordinates of landmarks in its frame, less the stated ones.
    It does not change when the frame and its landmarks move together: so it stays true when the map bends.
    """

    frame: int  # variable of the pose
    landmarks: Ints  # (m,) variables
    stated: Array  # (m, 2) m
    information: Array  # (2m, 2m)
    side: Array  # (2m,)
    constant: float
    own: Array  # (3, 3) covariance of the pose given the landmarks, in its own frame
    middle: Array  # (2,) m; the middle of the stretch that it was made for, in its frame

    def add(self, told: Condensed, frame: Array, values: Array) -> None:
        """Adds what a stretch tells, linearised at `values` (V, 3), with the frame at `frame` (3,).

        A stretch whose poses are all eliminated says nothing of where its landmarks are together: the frame stays.
        """
        W, h, at = turned(told, frame[2]), turned_side(told.side, frame[2]), in_frame(values[told.landmarks, :2], frame)
        row = {int(v): t for t, v in enumerate(self.landmarks)}
        new = np.array([int(v) not in row for v in told.landmarks], np.bool_)
        self._append(told.landmarks[new], at[new])
        row = {int(v): t for t, v in enumerate(self.landmarks)}
        rows = np.array([row[int(v)] for v in told.landmarks], np.int64)
        y = (at - self.stated[rows]).reshape(-1)
        scalars = (2 * rows[:, None] + np.arange(2)).reshape(-1)
        self.information[np.ix_(scalars, scalars)] += W
        self.side[scalars] += W @ y + h
        self.constant += told.constant + float(y @ W @ y + 2 * h @ y)

    def own_at(self, pose: Array) -> Array:
        """The pose's covariance given the landmarks, (3, 3) in the world, where it is at `pose` (3,)."""
        T = turn_of(pose[2])
        return T @ self.own @ T.T

    def middle_at(self, pose: Array) -> Array:
        """The middle (2,) in the world, where the frame is at `pose` (3,)."""
        return pose[:2] + turn_of(pose[2])[:2, :2] @ self.middle

    def _append(self, landmarks: Ints, at: Array) -> None:
        """Appends landmarks of which nothing is known yet."""
        if len(landmarks) == 0:
            return
        m, n = len(self.landmarks), len(self.landmarks) + len(landmarks)
        W, h = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        W[: 2 * m, : 2 * m], h[: 2 * m] = self.information, self.side
        self.landmarks = np.concatenate((self.landmarks, landmarks))
        self.stated, self.information, self.side = np.concatenate((self.stated, at)), W, h

    def renumbered(self, variables: Ints) -> None:
        """Takes other numbers of variables, by the present ones."""
        self.frame, self.landmarks = int(variables[self.frame]), variables[self.landmarks]


def begun(variable: int, told: Condensed, frame: Array, values: Array, own: Array, middle: Array) -> Submap:
    """The submap of a stretch whose last pose, the `variable` at `frame` (3,), is its frame and is not eliminated.

    `own` (3, 3) is that pose's covariance given the landmarks, and `middle` (2,) the stretch's; both in the world.
    """
    stated = in_frame(values[told.landmarks, :2], frame)
    T = turn_of(-frame[2])
    W, h = turned(told, frame[2]), turned_side(told.side, frame[2])
    return Submap(
        variable, told.landmarks, stated, W, h, told.constant, T @ own @ T.T, in_frame(middle[None], frame)[0]
    )


def in_frame(xy: Array, frame: Array) -> Array:
    """Positions (m, 2) in a frame (3,)."""
    c, s = np.cos(frame[2]), np.sin(frame[2])
    dx, dy = (xy - frame[:2]).T
    return np.stack((c * dx + s * dy, c * dy - s * dx), axis=-1)


def turned(told: Condensed, heading: float) -> Array:
    """The information (2m, 2m) about offsets in a frame of that heading."""
    n = len(told.landmarks)
    R = turn_of(heading)[:2, :2]
    return np.einsum("ba,ibjc,cd->iajd", R, told.information.reshape(n, 2, n, 2), R).reshape(2 * n, 2 * n)


def turned_side(h: Array, heading: float) -> Array:
    """The right-hand side (2m,) likewise."""
    return (h.reshape(-1, 2) @ turn_of(heading)[:2, :2]).reshape(-1)


def turn_of(heading: float) -> Array:
    """The rotation (3, 3) of x and y by a heading."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

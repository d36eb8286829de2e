"""The joint marginal of the last pose and of landmarks around it in GTSAM's Bayes tree, carried from step to step.

A landmark that was not in view lies deep in the tree: its joint marginal with the last pose takes milliseconds, and so
does the back-substitution for its estimate. But until a variable is relinearized, the tree's linear problem only grows.
If |R x - d|^2 is what it says of the offsets x of some landmarks and the last pose from their linearisation points, and
|A x - b|^2 are a step's factors, linearised where the tree has them, then

    [R d]     [R' d']
    [A b] = Q [0  e ]      Q orthogonal, the last pose's columns first

has the marginal after the step below the last pose's rows: exactly, as the tree has it. The tree is asked again where a
landmark comes up that is not carried, after a relinearization, and after a step with a factor of any other variable: a
loop closure, or a sighting that was held back.
"""

from typing import Any

import gtsam
import numpy as np
from scipy.linalg import solve_triangular

from ...core.se2 import Array
from ..api import Diverged

MOST = 30  # landmarks that are carried, those asked for last; more where more are asked for at once
IDLE = 10  # steps after which nothing is carried any more if nobody asks


class Neighbourhood:
    """Offsets of landmarks and the last pose from their linearisation points: their mean and joint covariance."""

    def __init__(self, isam: gtsam.ISAM2) -> None:
        self._isam = isam
        self._landmarks: list[int] = []  # keys, those asked for last at the end
        self._keys: list[int] = []  # of the columns of R: landmarks, then the last pose; none where the tree is asked
        self._rows = np.zeros((0, 1))  # [R d]
        self._idle = 0  # steps since anybody asked

    def fold(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, here: int, *, moved: bool) -> None:
        """Takes a step that the tree has been updated with: its factors, and its new variables.

        `here` is the key of its pose; `moved` says that variables were relinearized.
        """
        self._idle += 1
        if moved or self._idle > IDLE:
            self._keys = []
        if not self._keys or not graph.size():
            return
        linear = graph.linearize(self._isam.getLinearizationPoint())
        touched: list[int] = list(linear.keyVector())
        kept = self._landmarks[-MOST:]
        self._landmarks = [*kept, *(key for key in values.keys() if key != here)]  # noqa: SIM118 - it is no dict
        before, poses = self._keys, (self._keys[-1], here)
        gone = [key for key in before if key not in set(kept)]  # the last pose among them
        place, eliminated, number = _placed([*gone, *self._landmarks, here], poses, len(gone))
        if any(key not in place for key in touched):
            self._keys = []
            return
        A, b = linear.jacobian(gtsam.Ordering(touched))
        n = len(self._rows)
        both = np.zeros((n + len(A), number + 1))
        both[:n, [*_entries(before, poses, place), -1]] = self._rows
        both[n:, _entries(touched, poses, place)], both[n:, -1] = A, b.ravel()
        self._keep(both, [*self._landmarks, here], eliminated)

    def joint(self, landmarks: list[int], pose: int) -> tuple[Array, Array]:
        """Offsets (2n + 3,) of the landmarks with these keys and of the last pose, and their covariance, pose last."""
        self._idle = 0
        asked = set(landmarks)
        self._landmarks = [*(key for key in self._landmarks if key not in asked), *landmarks]
        if not asked.issubset(self._keys):
            self._ask(pose, max(MOST, len(landmarks)))
        place, _, _ = _placed(self._keys, (pose,), 0)
        entries = _entries([*landmarks, pose], (pose,), place)
        try:
            root = solve_triangular(self._rows[:, :-1], np.eye(len(self._rows)), check_finite=False)[entries]
        except np.linalg.LinAlgError:
            raise Diverged("the joint marginal of the pose and the landmarks in view is singular") from None
        return root @ self._rows[:, -1], root @ root.T

    def _ask(self, pose: int, most: int) -> None:
        """Has the tree say what it holds of the landmarks that were asked for last, at most that many."""
        self._landmarks = self._landmarks[-most:]
        keys = [*self._landmarks, pose]
        A, b = self._isam.joint(keys).jacobian(gtsam.Ordering(keys))
        self._keep(np.column_stack((A, b)), keys, 0)

    def _keep(self, rows: Array, keys: list[int], eliminated: int) -> None:
        """Makes `rows` triangular, and keeps those for `keys`, which are below the first `eliminated` ones."""
        count = rows.shape[1] - 1
        if len(rows) < count:
            raise Diverged("the joint marginal of the pose and the landmarks in view is undetermined")
        triangular: Any = np.linalg.qr(rows, mode="r")
        self._rows = triangular[eliminated:count, eliminated:]
        self._keys = keys


def _placed(keys: list[int], poses: tuple[int, ...], first: int) -> tuple[dict[int, int], int, int]:
    """The first column of each variable, that of those from index `first` on, and the number of all."""
    place, columns, begins = dict[int, int](), 0, 0
    for k, key in enumerate(keys):
        if k == first:
            begins = columns
        place[key] = columns
        columns += 3 if key in poses else 2
    return place, begins, columns


def _entries(keys: list[int], poses: tuple[int, ...], place: dict[int, int]) -> list[int]:
    """The columns of these variables."""
    return [place[key] + i for key in keys for i in range(3 if key in poses else 2)]

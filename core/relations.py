"""Relations: true poses relative to one another, the ground truth of recorded laser logs.

R. Kuemmerle et al., On measuring the accuracy of SLAM algorithms, Autonomous Robots 27(4), 2009. The true path is not
known, but of some pairs of scans a person has verified how the second one lies seen from the first. A scan lies at a
step of the log, or between two of them: its place there is the front end's, which all backends share.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .se2 import Array, Ints, between, compose, wrap

FEWEST_EXACT = 500
"""Relations between the very scans that are enough: then those whose stamps lie between two scans are not used."""

LONGEST_GAP = 0.5  # s; longest interval between two known poses that is interpolated


class Anchors(NamedTuple):
    """Poses beside the steps of a log, so that any path of its steps places them."""

    step: Ints  # (m,) the last step before
    since: Array  # (m, 3) the pose, seen from that step
    until: Array  # (m, 3) seen from the step after; from the same one at the log's end
    share: Array  # (m,) of the time between both steps that has passed

    def taken(self, rows: NDArray[np.bool] | Ints) -> "Anchors":
        """Some of them."""
        return Anchors(self.step[rows], self.since[rows], self.until[rows], self.share[rows])

    def head(self, steps: int) -> "Anchors":
        """Those of a log's first `steps` steps, which ends there: from the last step on they are seen from it alone."""
        some = self.taken(self.step < steps)
        return some._replace(until=np.where(some.step[:, None] == steps - 1, some.since, some.until))

    def along(self, path: Array) -> Array:
        """The poses (m, 3) where the steps are those of `path` (n, 3): from one step on, and bent to reach the next."""
        after = np.minimum(self.step + 1, len(path) - 1)
        before, behind = compose(path[self.step], self.since), compose(path[after], self.until)
        return compose(before, between(before, behind) * self.share[:, None])


class Relations(NamedTuple):
    """True motions (m, 3) from the first to the second pose, in the axes of the first."""

    first: Anchors
    second: Anchors
    delta: Array  # (m, 3) m, m, rad
    exact: NDArray[np.bool]  # (m,) both are poses of scans, none is interpolated

    def judged(self) -> "Relations":
        """Those that errors are measured by: the exact ones where they are enough, else all."""
        if self.exact.sum() < FEWEST_EXACT:
            return self
        kept = np.flatnonzero(self.exact)
        return Relations(self.first.taken(kept), self.second.taken(kept), self.delta[kept], self.exact[kept])

    def errors(self, path: Array) -> Array:
        """Errors (m, 2), m and rad, of a path (n, 3): the size of the motion from the true to the found second pose."""
        found = between(self.first.along(path), self.second.along(path))
        off = between(self.delta, found)
        return np.stack((np.hypot(off[:, 0], off[:, 1]), np.abs(wrap(off[:, 2]))), axis=-1)


COLUMNS = (
    "first", "first_sx", "first_sy", "first_st", "first_ux", "first_uy", "first_ut", "first_share",
    "second", "second_sx", "second_sy", "second_st", "second_ux", "second_uy", "second_ut", "second_share",
    "dx", "dy", "dtheta", "exact",
)  # fmt: skip
"""Of a file: both steps, the poses seen from them (s, since) and from the steps after (u, until), and the motion."""


def as_rows(relations: Relations) -> Array:
    """The relations as a table (m, 20) of COLUMNS."""
    ends = (relations.first, relations.second)
    columns = [column for end in ends for column in (end.step[:, None], end.since, end.until, end.share[:, None])]
    return np.concatenate((*columns, relations.delta, relations.exact[:, None]), axis=1, dtype=np.float64)


def from_rows(rows: Array) -> Relations:
    """Restores what `as_rows` gave."""
    first, second = (
        Anchors(end[:, 0].astype(np.int64), end[:, 1:4], end[:, 4:7], end[:, 7]) for end in (rows[:, :8], rows[:, 8:16])
    )
    return Relations(first, second, rows[:, 16:19], rows[:, 19] != 0)

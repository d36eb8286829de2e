"""The compressed filter (Guivant and Nebot, IEEE Trans. Robotics and Automation 17(3), 2001): exact, mostly local.

While only the pose and the landmarks of a part A are moved, seen or added, the updates of the rest B are linear in B's
initial correlations with A: with G and H the Jacobians of a motion and a sighting of the part,

    Phi <- G Phi                          a motion
    Phi <- (1 - K H) Phi                  a sighting, nu = z - h, S = H P H' + R
    Psi <- Psi + Phi' H' S^-1 H Phi
    theta <- theta + Phi' H' S^-1 nu

and the update of the rest, however large, can be deferred until it is needed:

    P_AB <- Phi P_AB,  P_BB <- P_BB - P_BA Psi P_AB,  x_B <- x_B + P_BA theta.

When a landmark of B comes into view it moves to A, for which its own rows of the deferred update are evaluated; a new
one joins with a row of Phi propagated from the pose's by its Jacobian, and with zeros for B. So the rest is updated
only when the part has become too large, and the part then restarts with the landmarks last seen.
"""

import numpy as np

from ...core.factors import Odometry, RangeBearing
from ...core.se2 import Ints
from .._vicinity import choose
from ..vicinity import Vicinity
from . import _compressed, _triangle
from ._ekf import OWED, POSE
from ._expected import remember, sds
from .joint import Joint

MOST = 64
"""Most landmarks in the part. More make every step costlier, fewer make updates of the rest more frequent."""

KEPT = 12  # landmarks, those last seen, with which a part of that size restarts
LESS = 0.99  # the share of a larger size that is left a step later


class Active(Joint):
    """The active part of a joint belief, and the deferred update of the rest."""

    def __init__(self, whole: Joint, *, fixed_points: bool) -> None:
        super().__init__(whole.mean[:3], whole.pose, fixed_points=fixed_points)
        self.points[:3] = whole.points[:3]
        self._whole = whole
        self._members = np.zeros(len(self.agreed), np.int64)  # indices of the part's landmarks in the whole
        self._place: dict[int, int] = {}  # and the inverse
        self._last_seen: dict[int, int] = {}
        self._frame = 0
        self._most = float(MOST)
        self._around = Vicinity(follows=True)  # by their indices in the whole
        self._begin([])

    def bring(self, slots: list[int], known: int) -> list[int]:
        """Indices in the part of the whole's pairs `slots`, each once, of which those from `known` on are new.

        Missing ones are fetched; where the part would become too large, the rest is updated first. Too large is twice
        what was asked for lately: if less, a frame of few among frames of many would have the rest updated.
        """
        self._frame += 1
        self._most = max(MOST, 2 * len(slots), LESS * self._most)
        place = self._place
        absent = [slot for slot in slots if slot not in place]
        if absent:
            if self.pairs + len(absent) > self._most:
                present = [slot for slot in slots if slot in place]
                self._last_seen.update(dict.fromkeys(present, self._frame))
                self.settle_with(self._whole)
                recent = sorted(place, key=lambda slot: self._last_seen[slot], reverse=True)
                self._begin(recent[: max(int(KEPT * self._most / MOST), len(present))])
                place = self._place
            for slot in sorted(absent, key=lambda slot: slot >= known):  # stable: the new ones last, in their order
                self._join(slot, new=slot >= known)
        self._last_seen.update(dict.fromkeys(slots, self._frame))
        return [place[slot] for slot in slots]

    def move(self, odometry: Odometry | None) -> None:
        """The robot moves: which landmarks are near is followed once that has been asked."""
        if self._around.used:
            self._around.move(odometry)

    def bring_near(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> None:
        """Fetches the landmarks that a sighting after the `odometry` may be of; repeated, it fetches none."""
        whole, around, place, first = self._whole, self._around, self._place, not self._around.used
        moves = around.ready(odometry, list(range(around.count, whole.pairs)))
        if first:
            self._look(self._begun)
        n = choose(
            around.address, around.count, self.mean[:3], self.pose, True, moves, around.motion, seen.z, seen.cov, gate
        )
        near = around.asked(n).tolist()
        if any(slot not in place for slot in near):
            self.bring(near, whole.pairs)
        remember(self.address, self._members, self.pairs, around.address)

    def _look(self, pairs: int) -> None:
        """Looks up in the whole where its first pairs are, and with what deviation."""
        whole = self._whole
        sd = sds(whole.flat, pairs)
        sd[whole.agreed[:pairs] == POSE] = np.nan  # within no distance of a sighting
        self._around.place(whole.mean[3 : 3 + 2 * pairs].reshape(-1, 2), sd)

    def members(self) -> Ints:
        """Indices in the whole of the part's landmarks."""
        return self._members[: self.pairs]

    def settle_with(self, whole: Joint) -> None:
        """Updates a whole to the present; the part is only read."""
        n, m = 2 * whole.pairs, self.columns
        before = np.empty((m, n))
        _compressed.rows_of(whole.cross, whole.flat, self._members, self.pairs, n, before)
        lower = np.tril(self.information[:m, :m])
        gained = (lower + np.tril(lower, -1).T) @ before
        after = self.transition[:m, :m] @ before
        whole.mean[:3] = self.mean[:3]
        whole.mean[3 : 3 + n] += self.pull[:m] @ before
        whole.pose[:] = self.pose
        _triangle.subtract_product(whole.flat, n, before, gained, int(self.blas[0]))
        _compressed.give_back(whole.address, self.address, n, self._members, self.pairs, after)
        members = self._members[: self.pairs]
        whole.agreed[members] = self.agreed[: self.pairs]
        if whole.points is not whole.mean:
            pairs = whole.points[3:].reshape(-1, 2)
            pairs[members] = self.points[3 : 3 + n].reshape(-1, 2)[: self.pairs]

    def _begin(self, slots: list[int]) -> None:
        """Starts with these landmarks and no deferred update: Phi = 1, Psi = 0, theta = 0."""
        whole, a = self._whole, len(slots)
        self.grow(a)
        self._members[:a] = slots
        self._place = {slot: i for i, slot in enumerate(slots)}
        self._begun = whole.pairs  # of the whole, whose means and covariance were those of then
        if self._around.used:
            self._look(self._around.count)
        self._last_seen = {slot: self._last_seen[slot] for slot in slots}
        _compressed.load(whole.address, self.address, self._members, a)
        self.agreed[:a], self.bound[:] = whole.agreed[slots], np.inf
        self._copy_points(0)
        space = len(self.mean)
        self.transition, self.information, self.pull = np.eye(space), np.zeros((space, space)), np.zeros(space)
        self.owed_transition = np.zeros((OWED, space))
        self.moved()

    def _join(self, slot: int, *, new: bool) -> None:
        """Adds one landmark."""
        whole, a = self._whole, self.pairs
        self.grow(a + 1)
        self._members[a], self._place[slot] = slot, a
        self._copy_points(a)
        self.agreed[a], self.bound[a] = whole.agreed[slot], np.inf
        self.transition[3 + 2 * a : 5 + 2 * a] = 0.0  # a new landmark's rows derive from the pose's
        self.transition[:, 3 + 2 * a : 5 + 2 * a] = 0.0
        if not new:
            _compressed.fetch(whole.address, self.address, self._members, a)

    def _copy_points(self, first: int) -> None:
        whole, n = self._whole, self.pairs
        if whole.points is not whole.mean:
            pairs = self.points[3:].reshape(-1, 2)
            pairs[first:n] = whole.points[3:].reshape(-1, 2)[self._members[first:n]]

    def grow(self, pairs: int) -> None:
        """Reserves space for that many pairs; Phi is square."""
        self.columns = 3 + 2 * pairs
        before = len(self.mean)
        super().grow(pairs)
        more = len(self.mean) - before
        if more:
            self._members = np.pad(self._members, (0, more // 2))
            self.transition = np.pad(self.transition, ((0, more), (0, more)))
            self.information = np.pad(self.information, ((0, more), (0, more)))
            self.pull = np.pad(self.pull, (0, more))
            self.owed_transition = np.zeros((OWED, len(self.mean)))
            self.moved()

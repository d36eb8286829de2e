"""Expected sightings that stay in compiled arrays on the way from a backend to data association."""

from typing import Protocol

import numpy as np

from ..core.factors import Odometry, RangeBearing
from ..core.se2 import Array, Ints
from ._answer import Answer
from ._rules import conclude
from .api import Expected


class ExpectsInto(Protocol):
    """A backend that fills an `Answer` as well: a method of this package, which no plug-in needs."""

    def expect_into(self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: Answer) -> Answer:
        """As `Expects.expected`, and makes the decision; returns `into`, or another one with more room."""
        ...


def fills(backend: object) -> bool:
    """Tells if it is such a backend; not if a subclass has replaced what is expected, in the other way alone."""
    own = next((vars(kind) for kind in type(backend).__mro__ if "expected" in vars(kind)), {})
    return "expect_into" in own


def answer(landmarks: int) -> Answer:
    """An answer with room for that many landmarks, for no decision."""
    return Answer(count=np.zeros(1, np.int64), decision=np.zeros(1, np.int64), **_room(landmarks))


def roomier(found: Answer, landmarks: int) -> Answer:
    """An answer for the same decision with room for that many, of which none is kept."""
    return found.replaced(**_room(landmarks))


def as_expected(found: Answer) -> Expected:
    """Copies the answer into arrays of its own."""
    n = int(found.count[0])
    return Expected(found.ids[:n].copy(), found.z[:n].copy(), found.cov[: 4 * n * n].reshape(2 * n, 2 * n).copy())


def filled(into: Answer, found: Expected, seen: RangeBearing) -> Answer:
    """`into`, or another one with more room, with what is `found` for the sightings; the decision is made."""
    n = len(found.ids)
    if n > len(into.ids):
        into = roomier(into, 2 * n)
    into.count[0], into.ids[:n], into.z[:n], into.cov[: 4 * n * n] = n, found.ids, found.z, found.cov.ravel()
    conclude(into.address, seen.z, seen.cov)
    return into


def _room(landmarks: int) -> dict[str, Array | Ints]:
    """The arrays for that many."""
    return {
        "ids": np.zeros(landmarks, np.int64),
        "z": np.zeros((landmarks, 2)),
        "cov": np.zeros(4 * landmarks * landmarks),
    }

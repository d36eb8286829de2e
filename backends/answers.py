"""Expected sightings that stay in compiled arrays on the way from a backend to data association."""

from typing import Protocol

import numpy as np

from ..frontend.factors import Odometry, RangeBearing
from ._answer import Answer
from .api import Expected


class ExpectsInto(Protocol):
    """A backend that fills an `Answer` as well: a method of this package, which no plug-in needs."""

    def expect_into(self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: Answer) -> Answer:
        """As `Expects.expected`; returns `into`, or another one with more room."""
        ...


def fills(backend: object) -> bool:
    """Tells if it is such a backend; not if a subclass has replaced what is expected, in the other way alone."""
    own = next((vars(kind) for kind in type(backend).__mro__ if "expected" in vars(kind)), {})
    return "expect_into" in own


def answer(landmarks: int) -> Answer:
    """An answer with room for that many landmarks."""
    return Answer(
        count=np.zeros(1, np.int64),
        ids=np.zeros(landmarks, np.int64),
        z=np.zeros((landmarks, 2)),
        cov=np.zeros(4 * landmarks * landmarks),
    )


def as_expected(found: Answer) -> Expected:
    """The same, as arrays of its own."""
    n = int(found.count[0])
    return Expected(found.ids[:n].copy(), found.z[:n].copy(), found.cov[: 4 * n * n].reshape(2 * n, 2 * n).copy())


def filled(into: Answer, found: Expected) -> Answer:
    """`into`, or another one with more room, with what is `found`."""
    n = len(found.ids)
    if n > len(into.ids):
        into = answer(2 * n)
    into.count[0], into.ids[:n], into.z[:n], into.cov[: 4 * n * n] = n, found.ids, found.z, found.cov.ravel()
    return into

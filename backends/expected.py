"""Expected sightings that stay in compiled arrays on the way from a backend to data association."""

import numpy as np

from ..core.factors import RangeBearing
from ..core.se2 import Array, Ints
from ._expected_arrays import ExpectedArrays
from ._rules import conclude
from .api import Expected


def fills(backend: object) -> bool:
    """Tells if it fills `ExpectedArrays` as well, which no plug-in needs to do.

    That is `expected_into(odometry, seen, gate, into)`: as `Expects.expected`, and makes the decision; it returns
    `into`, or arrays with more room. Not if a subclass has replaced `expected` alone.
    """
    own = next((vars(kind) for kind in type(backend).__mro__ if "expected" in vars(kind)), {})
    return "expected_into" in own


def room_for(landmarks: int) -> ExpectedArrays:
    """Arrays with room for that many landmarks, for no decision."""
    return ExpectedArrays(count=np.zeros(1, np.int64), decision=np.zeros(1, np.int64), **_room(landmarks))


def roomier(found: ExpectedArrays, landmarks: int) -> ExpectedArrays:
    """Arrays for the same decision with room for that many, of which none is kept."""
    return found.replaced(**_room(landmarks))


def as_expected(found: ExpectedArrays) -> Expected:
    """A copy in arrays of its own."""
    n = int(found.count[0])
    return Expected(found.ids[:n].copy(), found.z[:n].copy(), found.cov[: 4 * n * n].reshape(2 * n, 2 * n).copy())


def filled(into: ExpectedArrays, found: Expected, seen: RangeBearing) -> ExpectedArrays:
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

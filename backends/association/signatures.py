"""Signatures of landmarks, as their sightings tell them: a scalar Kalman filter each, independent of every place.

As (r, phi, s) have independent errors, and no motion changes a signature, the third row of every landmark in the
survey's EKF (its lines 6 to 20) is a filter of its own: started by the first sighting, m = s and P = q, and corrected
by each later one, K = P / (P + q), m += K (s - m), P -= K P.
"""

from collections.abc import Sequence

import numpy as np

from ...core.factors import Step
from ...core.se2 import Array, Ints
from ...core.signatures import Signatures

ROOM = 64  # landmarks that space is reserved for at first


def joined(steps: Sequence[Step]) -> Signatures:
    """The signatures of all sightings of the steps."""
    each = [step.signatures for step in steps]
    return Signatures(np.concatenate([one.s for one in each]), np.concatenate([one.var for one in each]))


class SignatureFilters:
    """The signature of every landmark sighted so far, and what signatures are like."""

    def __init__(self) -> None:
        self._slot: dict[int, int] = {}  # by landmark
        self._state = np.zeros((ROOM, 2))  # m and P
        self._seen, self._mean, self._square = 0, 0.0, 0.0  # of all signatures: number, mean, sum of squares about it

    def of(self, landmarks: Sequence[int] | Ints) -> Array:
        """(n, 2) mean and variance of the signatures of landmarks; of one not sighted yet, those of all signatures."""
        rows = [self._slot.get(int(landmark), -1) for landmark in landmarks]
        found = self._state[rows]
        unknown = np.array(rows, np.int64) < 0
        if unknown.any():
            found[unknown] = self._mean, self._square / self._seen if self._seen else np.inf
        return found

    def pairs(self, seen: Signatures, landmarks: Sequence[int] | Ints) -> Array:
        """(k, n, 2) of each pair of k signatures and n landmarks: squared distance, and logarithm of its variance.

        Before any signature is known, all are equally far from all.
        """
        expected = self.of(landmarks)
        with np.errstate(invalid="ignore"):
            spread = seen.var[:, None] + expected[:, 1]
            apart = (seen.s[:, None] - expected[:, 0]) ** 2 / spread
        return np.stack((apart, np.log(np.where(np.isinf(spread), 1.0, spread))), axis=-1)

    def learn(self, landmarks: Sequence[int], seen: Signatures) -> None:
        """Corrects the signatures of `landmarks` by one sighting each, or starts them."""
        for landmark, s, q in zip(landmarks, seen.s.tolist(), seen.var.tolist(), strict=True):
            self._seen += 1
            off = s - self._mean
            self._mean += off / self._seen
            self._square += off * (s - self._mean)
            slot = self._slot.get(landmark)
            if slot is None:
                self._slot[landmark] = slot = len(self._slot)
                if slot == len(self._state):
                    self._state = np.concatenate((self._state, np.zeros_like(self._state)))
                self._state[slot] = s, q
            else:
                m, P = self._state[slot].tolist()
                K = P / (P + q)
                self._state[slot] = m + K * (s - m), P - K * P

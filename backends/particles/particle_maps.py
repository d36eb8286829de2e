"""The maps of all particles: small EKFs per landmark and particle, copied from ancestors only when needed.

Resampling copies particles, maps included. Copying M maps of N landmarks costs M N, whatever the robot sees; here a
resampling only begins a new epoch, and every landmark stores the epoch of its last update. It is copied, each
particle's filter from that of its ancestor back then, when it is next in view: a step's cost does not depend on
landmarks out of view. (Montemerlo's trees of landmarks, log N per particle and landmark, serve the same end.) One more
landmark, in rotation, is updated at every resampling. So none is ever more epochs behind than there are landmarks, no
more ancestor maps than that are stored, and they take a fifth of the filters' memory.
"""

import numpy as np

from ...core.se2 import Array, Ints
from ._ancestry import catch_up, remember, widen

RESERVED = 8
"""Landmarks that space is reserved for at first, a power of two; doubled when exhausted."""


class ParticleMaps:
    """N landmarks of C columns in each of M particles; 8 C bytes per particle and landmark, and 8 for their ancestors.

    The first five columns are mean x, y (m) and covariance xx, xy, yy (m^2), unless a caller has others.
    """

    def __init__(self, particles: int, columns: int = 5, reserved: int = RESERVED) -> None:
        self.row: dict[int, int] = {}  # landmark id -> its row
        self._filters = np.zeros((reserved + 1, columns, particles))
        self._slots = np.arange(reserved)  # (reserved,) the slot of each row; one slot is spare
        self._spare = reserved
        self._written = np.zeros(reserved, np.int64)  # (reserved,) the epoch of each row's last update
        self._hops = np.zeros((2 * reserved, particles), np.int32)
        self._epoch = 0
        self._turn = 0
        self._rows = 0  # that have been in use
        self._left: list[int] = []  # of them, those of landmarks that were removed

    def __len__(self) -> int:
        return len(self.row)

    @property
    def filters(self) -> Array:
        """(slots, C, M), for kernels, which write to it."""
        return self._filters

    def add(self, landmark: int) -> int:
        """Returns a slot for a new landmark, to be filled by the caller."""
        row = self._left.pop() if self._left else self._rows
        if row == len(self._slots):
            self._grow()
        self._rows = max(self._rows, row + 1)
        self.row[landmark] = row
        self._written[row] = self._epoch
        return int(self._slots[row])

    def remove(self, landmark: int) -> None:
        """Removes a landmark; its space is for the next."""
        self._left.append(self.row.pop(landmark))

    def resampled(self, ancestors: Ints) -> None:
        """Replaces each particle m by a copy of particle ancestors[m]."""
        self._epoch += 1
        remember(self._hops, self._epoch, ancestors)
        if self._rows:
            self._turn = (self._turn + 1) % self._rows
            self.slots(np.array([self._turn]))

    def slots(self, rows: Ints) -> Ints:
        """The slots (k,) of the landmarks in `rows` (k,), updated to the present particles."""
        self._spare = catch_up(self._filters, self._slots, self._written, self._spare, rows, self._hops, self._epoch)
        return self._slots[rows]

    def all(self) -> Array:
        """(N, C, M) every landmark's filters, in the order of `row`: a copy."""
        return self._filters[self.slots(np.fromiter(self.row.values(), np.int64, len(self.row)))]

    def _grow(self) -> None:
        """Doubles the space for landmarks, and for ancestor maps."""
        before = len(self._slots)
        _, columns, particles = self._filters.shape
        filters = np.zeros((2 * before + 1, columns, particles))
        filters[: before + 1] = self._filters
        self._filters = filters
        self._slots = np.concatenate((self._slots, np.arange(before + 1, 2 * before + 1)))
        self._written = np.concatenate((self._written, np.zeros(before, np.int64)))
        hops = np.zeros((4 * before, particles), np.int32)
        widen(self._hops, hops, self._epoch)
        self._hops = hops

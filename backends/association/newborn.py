"""Landmarks that are not believed yet: sightings that later ones have to agree with."""

import numpy as np

from ...frontend.factors import Odometry
from ...frontend.se2 import Array, Ints
from ._newborn import carry, nearest_of, place_of


class Newborn:
    """Sightings of landmarks that may be new, in the robot's present frame.

    One becomes a landmark once `confirm` later sightings, at most one each step, agree with it within `within` steps
    that have sightings, as far as the odometry can tell; else it was clutter.
    """

    def __init__(self, confirm: int, within: int, gate: float) -> None:
        self._confirm, self._within, self._gate = confirm, within, gate
        self._at, self._cov = np.zeros((0, 2)), np.zeros((0, 2, 2))
        self._age, self._agreed = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._rows: list[list[int]] = []  # sightings of each, numbered along the log

    def move(self, odometry: Odometry | None) -> None:
        """Follows the robot's motion."""
        if odometry is not None and len(self._at):
            carry(self._at, self._cov, np.array(odometry.delta), np.array(odometry.cov))

    def sighted(self, z: Array, cov: Array, rows: list[int]) -> list[list[int] | None]:
        """Takes the step's sightings z (k, 2), cov (k, 2, 2), which are of no known landmark, numbered `rows`.

        Returns for each the numbers of all sightings of a landmark that it confirms, itself last, or None.
        """
        count = len(self._at)
        at, covs = np.empty((len(rows), 2)), np.empty((len(rows), 2, 2))
        place_of(np.array(z), np.array(cov, order="C"), at, covs)
        pair = nearest_of(at, covs, self._at, self._cov, self._gate)
        self._age += 1
        born: list[list[int] | None] = [None] * len(rows)
        done: set[int] = set()
        for i, old in enumerate(pair.tolist()):
            if old < 0:
                continue
            self._agreed[old] += 1
            self._rows[old].append(rows[i])
            self._at[old], self._cov[old] = at[i], covs[i]
            if self._agreed[old] >= self._confirm:
                born[i] = self._rows[old]
                done.add(old)
        kept = [old for old in range(count) if old not in done and self._age[old] < self._within]
        fresh = np.flatnonzero(pair < 0)
        self._at = np.concatenate((self._at[kept], at[fresh]))
        self._cov = np.concatenate((self._cov[kept], covs[fresh]))
        self._age = _joined(self._age[kept], len(fresh))
        self._agreed = _joined(self._agreed[kept], len(fresh))
        self._rows = [self._rows[old] for old in kept] + [[rows[i]] for i in fresh.tolist()]
        return born


def _joined(before: Ints, new: int) -> Ints:
    return np.concatenate((before, np.zeros(new, np.int64)))

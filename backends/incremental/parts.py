"""Partial sightings and fixes of a step as rows of a solver's tables, and the landmarks that these place."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import Map, Odometry, Prior, Step
from ...core.fixes import information
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ..api import Constant
from ..constant_errors import CovOf
from ..sighting_tables import Row, Tables
from ..smoothing._graph import ALONE, NO_VARIABLE
from ..starting.late_places import LatePlaces, Seen
from .constants import ConstantVariables

SIX = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
"""Rows and columns of the six numbers of a symmetric matrix."""


class Rows(NamedTuple):
    """Columns of k rows, as `_log.add_parts_of` takes them."""

    landmarks: Ints  # (k,)
    parts: Ints  # (k,)
    seen: Array  # (k, 5)


NO_ROWS = Rows(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 5)))


class Parts:
    """Converts them step by step. A landmark starts late, when partial sightings place it: see `..starting.placing`."""

    def __init__(
        self,
        tables: Tables,
        prior: Prior,
        variable: Mapping[int, int],
        start: Callable[[int, float, float], None],
        hold: Callable[[int, int], None],
    ) -> None:
        """`variable` has those of landmarks on the map, by id.

        `start` is called with a landmark and the place it is to have, and puts it there; `hold` with one and the row of
        `sightings` that is to be its own once it has started.
        """
        self._tables, self._variable, self._start, self._hold = tables, variable, start, hold
        self._late = LatePlaces()
        self._constants = ConstantVariables(tables, prior.systematic)
        self._first = 0  # of the step's rows, in the tables
        self.rows = list[Row]()
        """Those of the step so far; one that starts by a whole sighting may add errors of ranges held back."""

    @property
    def waits(self) -> bool:
        """True while something is held back: then `move` needs every motion."""
        return self._late.waits

    def move(self, odometry: Odometry | None) -> None:
        """Adds the motion to the next step."""
        self._late.move(odometry)

    def add(self, k: int, step: Step, poses: Callable[[Sequence[int]], Array], since: int = 0) -> None:
        """Takes step `k`, after its whole sightings; `poses` gives (n, 3) those of n steps so far.

        A landmark is placed by its sightings from step `since` on.
        """
        for fix in zip(*step.fixes, strict=True):
            self._fix(*fix)
        first = self._first = self._tables.stored + len(step.sightings.ids)
        for landmark, kind, z, var in zip(*(column.tolist() for column in step.partial), strict=True):
            seen = (z, 0.0, 1 / var, 0.0, 0.0) if kind == RANGE else (0.0, z, 0.0, 0.0, 1 / var)
            if landmark not in self._variable:
                self._late.hold(landmark, Seen(k, kind, z, var))
                place = self._late.found(landmark, poses, since)
                if place is None:
                    self._hold(landmark, first + len(self.rows))
                    self.rows.append((NO_VARIABLE, ALONE, seen))
                    continue
                self._start(landmark, *place.tolist())
            part = self._constants.of_range(landmark, self.rows) if kind == RANGE else ALONE
            self.rows.append((self._variable[landmark], part, seen))

    def release(self, landmark: int, rows: Sequence[int]) -> None:
        """Gives rows that were held back the variable of their landmark, and ranges their constant errors'."""
        self._late.taken(landmark)
        variable, stored = self._variable[landmark], self._tables.stored
        for row in rows:
            if row < stored:
                part, seen = self._tables.row(row)
            elif row >= self._first:
                _, part, seen = self.rows[row - self._first]
            else:  # a whole sighting of this step
                continue
            if part == ALONE and seen[2] > 0:
                part = self._constants.of_range(landmark, self.rows)
            if row < stored:
                self._tables.name(row, variable, part)
            else:
                self.rows[row - self._first] = variable, part, seen

    def ended(self, path: Array) -> None:
        """Starts the landmarks that are held back where the whole `path` (n, 3) places them: no more will be known."""
        self._first = self._tables.stored
        for landmark, place in self._late.ended(path):
            self._start(landmark, *place.tolist())

    def taken(self) -> Rows:
        """The rows of the step, k of them, which are none after that."""
        if not self.rows:
            return NO_ROWS
        landmarks, parts, seen = zip(*self.rows, strict=True)
        self.rows = []
        return Rows(np.array(landmarks, np.int64), np.array(parts, np.int64), np.array(seen))

    def added_to(self, landmarks: Map, path: Array) -> Map:
        """The map with landmarks that are not placed, without covariance, where they are likeliest."""
        return self._late.added_to(landmarks, path)

    def constant(self, values: Array, landmarks: Ints, cov_of: CovOf) -> Constant | None:
        """The constant errors of these landmarks, and of headings; None without any."""
        return self._constants.read(values, landmarks, cov_of)

    def renumbered(self, variables: Ints) -> None:
        """Takes other numbers of variables, by the present ones."""
        self._constants.renumbered(variables)

    def _fix(self, z: Array, cov: Array, arm: Array) -> None:
        turn = self._constants.of_heading(self.rows)
        part = self._tables.add_fix(np.concatenate((np.nan_to_num(z), information(cov)[SIX], arm)))
        self.rows.append((turn, part, (0.0, 0.0, 0.0, 0.0, 0.0)))

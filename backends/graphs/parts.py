"""Partial sightings, fixes and a gyro's biases as rows of a forest's tables, and landmarks that parts alone tell of."""

import numpy as np

from ...core.factors import Log, Map, Systematic
from ...core.fixes import NO_FIXES, FixTable, information
from ...core.gyro import Bias, Gyro
from ...core.partial import NO_PARTIAL, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.errors import rows_of
from ..api import Constant
from ..constant_errors import CovOf, stated
from ..smoothing import _log
from ..smoothing._graph import ALONE, FIX, LANDMARK, NO_VARIABLE, POSE, PRIOR
from ..smoothing.arrays import with_rows
from ..smoothing.forest import Forest
from ..smoothing.maps import add_map, joint_map
from ..starting.drift import wandered
from ..starting.late_places import somewhere, thinned
from ..starting.placing import placed

HELD = 1e-9
"""Standard deviation that holds a constant error at zero: of the two that are one variable, the prior has one."""

SIX = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
"""Rows and columns of the six numbers of a symmetric matrix."""


class ConstantVariables:
    """The variables of a log's constant errors in a forest: scale and offset of ranges in one, a heading's in another.

    They are created with their prior, as a given map is.
    """

    def __init__(self, forest: Forest, sds: Systematic, ids: Ints, fixes: bool) -> None:
        """Ranges are of landmarks `ids` (n,); without `fixes` no heading is measured."""
        self._each, self._sds = sds.each, sds
        ranges = len(ids) > 0 and (sds.range_scale > 0 or sds.range_offset > 0)
        number = (len(ids) if sds.each else 1) if ranges else 0
        turns = fixes and sds.heading_offset > 0
        pairs = [[sds.range_scale or HELD, sds.range_offset or HELD]] * number
        pairs += [[sds.heading_offset, 1.0]] * turns
        made = list[int]()
        if pairs:
            zero = Map(np.arange(len(pairs)), np.zeros((len(pairs), 2)), np.diag(np.square(pairs).ravel()))
            made = list(add_map(forest, zero).values())
        self._ids, self._ranges = ids, np.array(made[:number], np.int64)
        self.heading = made[number] if turns else NO_VARIABLE
        """The variable of a heading's error; NO_VARIABLE without one."""

    def of(self, ids: Ints) -> Ints:
        """(k,) the variable of the errors of ranges to landmarks `ids` (k,); ALONE where they have none."""
        if not len(self._ranges):
            return np.full(len(ids), ALONE)
        return self._ranges[np.searchsorted(self._ids, ids)] if self._each else np.full(len(ids), self._ranges[0])

    @property
    def all(self) -> Ints:
        """All their variables."""
        return np.append(self._ranges, [self.heading] * (self.heading >= 0)).astype(np.int64)

    def write(self, values: Array, landmarks: Ints, constant: Constant) -> None:
        """Sets the variables to the `constant` errors of these landmarks."""
        if len(self._ranges):
            row = rows_of(landmarks, self._ids) if self._each else np.zeros(1, np.int64)
            known = row >= 0
            each = np.column_stack((constant.range_scale, constant.range_offset))
            values[self._ranges[known], :2] = each[row[known] if len(each) > 1 else 0]
        if self.heading >= 0:
            values[self.heading, 0] = constant.heading_offset

    def read(self, values: Array, landmarks: Ints, cov_of: CovOf | None = None) -> Constant | None:
        """The constant errors of these landmarks; None without any. Without `cov_of` they have no deviations."""
        if not len(self.all):
            return None
        out = np.zeros((len(landmarks) if self._each else 1, 2))
        if len(self._ranges) and self._each:
            row = rows_of(self._ids, landmarks)
            out[row >= 0] = values[self._ranges[row[row >= 0]], :2]
        elif len(self._ranges):
            out[0] = values[self._ranges[0], :2]
        turn, sds = float(values[self.heading, 0]) if self.heading >= 0 else 0.0, None
        if cov_of is not None:
            there = np.full(len(out), NO_VARIABLE)
            if len(self._ranges) and self._each:
                row = rows_of(self._ids, landmarks)
                there = np.where(row >= 0, self._ranges[row], NO_VARIABLE)
            elif len(self._ranges):
                there[0] = self._ranges[0]
            first = [self._sds.range_scale, self._sds.range_offset]
            sds = stated(
                cov_of, [*there.tolist(), self.heading], [*[first] * len(out), [self._sds.heading_offset, 0.0]]
            )
        return Constant(out[:, 0], out[:, 1], turn, sd=sds)


class GyroBiases:
    """The variables of a gyro's biases in a forest, and their rows: each bias is named at all poses of its turns.

    So it is eliminated after these. A bias is the first of a pair, whose second is held at zero. At its first pose it
    has its prior, or its walk since the one before.
    """

    def __init__(self, gyro: Gyro | None, steps: int) -> None:
        none = np.zeros(0, np.int64)
        self._first, self.of_step = none, np.full(steps, NO_VARIABLE)
        """(steps,) the variable of the bias of each step's turn."""
        self.step, self.knot, self.since, self.seen = none, none, none, np.zeros((0, 5))
        """(k,) of each row, its bias, and the one that it has walked since, or -1; (k, 5) as in the forest's table."""
        self.variable, self.at, self._gyro = none, np.zeros(0), gyro
        """(b,) the variable of each bias, and its initial value."""
        if gyro is None:
            return
        knot = gyro.knot
        both = np.concatenate((np.column_stack((gyro.step - 1, knot)), np.column_stack((gyro.step, knot))))
        self.step, self.knot = np.unique(both, axis=0).T
        opens = np.unique(self.knot, return_index=True)[1]
        self._first, self.variable = self.step[opens], np.full(len(opens), NO_VARIABLE)
        self.at = np.full(len(opens), gyro.prior.mean)
        self.since, self.seen = np.full(len(self.step), -1), np.zeros((len(self.step), 5))
        self.seen[opens, 4] = 1.0
        self.seen[opens[0], [0, 2]] = gyro.prior.mean, 1 / max(gyro.prior.sd**2 + gyro.walk[0], HELD**2)
        walks = np.zeros((len(opens) - 1, 5))
        walks[:, 4] = 1 / gyro.walk[np.flatnonzero(np.diff(knot)) + 1]
        later = np.arange(1, len(opens))
        self.step, self.knot = np.append(self.step, self._first[1:]), np.append(self.knot, later)
        self.since, self.seen = np.append(self.since, later - 1), np.concatenate((self.seen, walks))

    def begin(self, forest: Forest, end: int) -> None:
        """Creates the variables of those that open before step `end`."""
        if self._gyro is None:
            return
        for j in np.flatnonzero((self._first < end) & (self.variable < 0)).tolist():
            self.variable[j] = _log.add_variable(forest.g, 2, float(self.at[j]), 0.0, 0.0)
        self.of_step[self._gyro.step] = self.variable[self._gyro.knot]

    def last(self, forest: Forest, *, curved: bool) -> Bias:
        """The bias at the end; without a standard deviation where J is not curved."""
        one = self.variable[-1:]
        cov = joint_map(forest, one, one, forest.g.values, 1).cov if curved else None
        return Bias(float(forest.g.values[one[0], 0]), 0.0 if cov is None else float(np.sqrt(cov[0, 0])))


class Parts:
    """Partial sightings, fixes and biases of a log, in order of step, the partial ones of a step first."""

    def __init__(self, log: Log, forest: Forest) -> None:
        n, empty = len(log), np.zeros(0, np.int64)
        table = log.partial or PartialTable.from_arrays(n, empty, *NO_PARTIAL)
        fixes = log.fixes or FixTable.from_arrays(n, empty, *NO_FIXES)
        self.constant = ConstantVariables(
            forest, log.prior.systematic, np.unique(table.ids[table.kind == RANGE]), len(fixes) > 0
        )
        self._table, self._motion_cov, p = table, log.delta_cov, len(table)
        self.biases = GyroBiases(log.gyro, n)
        """The variables of a gyro's biases."""
        step = np.concatenate((table.step, fixes.step, self.biases.step))
        order = np.argsort(step, kind="stable")
        self.step = step[order]
        """(k,) of each row."""
        self.first = np.searchsorted(self.step, np.arange(n + 1))
        """(n + 1,) rows of each step, as in a log."""
        self.before = log.sighting_first[self.step + 1]
        """(k,) whole sightings that are rows of the forest's before each."""
        self._row = np.empty(len(order), np.int64)
        self._row[order] = np.arange(len(order))
        isrange = table.kind == RANGE
        seen = np.zeros((len(order), 5))
        seen[np.arange(p), np.where(isrange, 0, 1)] = table.z
        seen[np.arange(p), np.where(isrange, 2, 4)] = 1 / table.var
        seen[p + len(fixes) :] = self.biases.seen
        self.seen = seen[order]
        """(k, 5) as in the forest's table."""
        part = np.full(p, ALONE)
        part[isrange] = self.constant.of(table.ids[isrange])
        priors = np.full(len(self.biases.step), PRIOR)
        self.part = np.concatenate((part, FIX - np.arange(len(fixes)), priors))[order]
        """(k,) likewise."""
        self.landmarks = np.full(len(order), NO_VARIABLE)
        """(k,) the variables of landmarks, NO_VARIABLE while they have no place, or of a heading's error."""
        if len(fixes):
            turn = self.constant.heading
            if turn < 0:
                forest.room(0, 1, 0, 0, 0)
                turn = _log.add_variable(forest.g, 0, 0.0, 0.0, 0.0)
            self.landmarks[self._row[p : p + len(fixes)]] = turn
            forest.g = with_rows(forest.g, "fixed", len(fixes))
            forest.g.fixed[:, :3] = np.nan_to_num(fixes.z)
            forest.g.fixed[:, 3:9] = information(fixes.cov)[:, SIX[0], SIX[1]]
            forest.g.fixed[:, 9:] = fixes.arm

    def begin_biases(self, forest: Forest, first: int, end: int) -> Ints:
        """Creates the biases of turns before step `end`, and names them in their rows.

        Returns the variables that are new, or have new factors at the steps from `first` on.
        """
        self.biases.begin(forest, end)
        biases = self.biases
        if not len(biases.step):
            return np.zeros(0, np.int64)
        rows = self._row[len(self._row) - len(biases.step) :]
        self.landmarks[rows] = biases.variable[biases.knot]
        walks = biases.since >= 0
        self.part[rows[walks]] = biases.variable[biases.since[walks]]
        mine = (first <= biases.step) & (biases.step < end)
        return np.unique(biases.variable[np.concatenate((biases.knot[mine], biases.since[mine & walks]))])

    def waits(self, landmark: int) -> bool:
        """True while a landmark's rows have no variable."""
        return bool((self.landmarks[self._rows_of(landmark)] == NO_VARIABLE).any())

    def named(self, forest: Forest, landmark: int, variable: int, end: int) -> Ints:
        """Gives a landmark's rows its variable, those at the steps before `end` in the forest, too.

        Returns the variables of the poses of these.
        """
        mine = self._rows_of(landmark)
        self.landmarks[mine] = variable
        rows = self.forest_rows(mine[mine < self.first[end]])
        forest.g.sightings[rows, LANDMARK] = variable
        return forest.g.sightings[rows, POSE]

    def forest_rows(self, rows: Ints) -> Ints:
        """The rows in the forest's table of sightings."""
        return self.before[rows] + rows

    @property
    def partial_rows(self) -> Ints:
        """(p,) the forest's row of each partial sighting of the log."""
        return self.forest_rows(self._row[: len(self._table)])

    def _rows_of(self, landmark: int) -> Ints:
        return self._row[: len(self._table)][self._table.ids == landmark]

    def place(self, landmark: int, path: Array, *, last: bool) -> Array | None:
        """(2,) m, the place of a landmark by its partial sightings along a path (k, 3), or the likeliest if `last`.

        None while they do not place it.
        """
        return place_of(self._table, landmark, path, self._motion_cov, last=last)


def place_of(table: PartialTable, landmark: int, path: Array, motion_cov: Array, *, last: bool) -> Array | None:
    """(2,) m, the place of a landmark by partial sightings along a path (k, 3), or the likeliest if it is the `last`.

    `motion_cov` (n, 3, 3) are those of the motions. None while they do not place it.
    """
    mine = table.ids == landmark
    mine &= table.step < len(path)
    poses, kind, z = path[table.step[mine]], table.kind[mine], table.z[mine]
    if not len(z):
        return None
    rows = thinned(len(z))
    drift = wandered(path, motion_cov[: len(path)], table.step[mine][rows])
    found = placed(poses[rows], kind[rows], z[rows], table.var[mine][rows], drift)
    if last and (found is None or not found.sure):
        found = placed(poses, kind, z, table.var[mine])
    if found is not None and (found.sure or last):
        return found.xy
    return somewhere(poses[-1], float(z[-1]), int(kind[-1])) if last else None

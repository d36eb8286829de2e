"""Sightings that tell a range alone, or a bearing alone: of a radio beacon, or of a mark whose size is not known."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .arrays import frozen, frozen_ids, numbers, sorted_ids, whole
from .se2 import Array, Ints

RANGE, BEARING = 0, 1
"""Kinds of a partial sighting."""

NO_IDS = "no range or bearing alone of the log has an id, and without one they start no landmark"
"""Why a log in which these alone tell the path is of no use to a backend: `Log.starts_nothing`."""


class Partial(NamedTuple):
    """The p partial sightings of one step; a landmark may have one of each kind."""

    ids: Ints  # (p,) UNKNOWN, or a landmark's id, at most once per step and kind
    kind: Ints  # (p,) RANGE or BEARING
    z: Array  # (p,) m, or rad from the body's x axis
    var: Array  # (p,) its variance


NO_PARTIAL = Partial(
    frozen_ids(np.zeros(0, np.int64)), frozen_ids(np.zeros(0, np.int64)), frozen(np.zeros(0)), frozen(np.zeros(0))
)
"""Those of a step without any."""


@dataclass(frozen=True, eq=False)
class PartialTable:
    """The partial sightings of a log as columns; those of step k are rows `first[k]:first[k + 1]`."""

    first: Ints  # (n + 1,)
    ids: Ints  # (p,)
    kind: Ints  # (p,)
    z: Array  # (p,)
    var: Array  # (p,)

    @classmethod
    def from_arrays(cls, steps: int, step: Ints, ids: Ints, kind: Ints, z: Array, var: Array) -> "PartialTable":
        """The table of a log of that many steps; `step` (p,), sorted, is each row's. The arrays are copied.

        InputError for values that are not numbers or not sorted; `check` judges the values themselves.
        """
        return cls(
            frozen_ids(np.searchsorted(sorted_ids("partial.step", step), np.arange(steps + 1))),
            frozen_ids(whole("partial.ids", ids)),
            frozen_ids(whole("partial.kind", kind)),
            frozen(numbers("partial.z", z)),
            frozen(numbers("partial.var", var)),
        )

    def __len__(self) -> int:
        return len(self.ids)

    def words(self, sightings: int) -> str:
        """Says which of a log's `sightings` they are: "all of them ranges without a bearing"."""
        return part_words(int((self.kind == RANGE).sum()), int((self.kind == BEARING).sum()), sightings)

    def at(self, k: int) -> Partial:
        """The rows of step k, as views."""
        rows = slice(self.first[k], self.first[k + 1])
        return Partial(self.ids[rows], self.kind[rows], self.z[rows], self.var[rows])

    @property
    def step(self) -> Ints:
        """(p,) the step of every row."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def columns(self) -> Mapping[str, Array | Ints]:
        """All of them by name, for digests and archives."""
        return {f"partial.{name}": getattr(self, name) for name in ("first", "ids", "kind", "z", "var")}

    def rows(self, kept: Any) -> "PartialTable":
        """The table with the rows `kept` alone, ascending indices or a mask; of as many steps."""
        return PartialTable.from_arrays(
            len(self.first) - 1, self.step[kept], self.ids[kept], self.kind[kept], self.z[kept], self.var[kept]
        )

    def head(self, steps: int) -> "PartialTable":
        """The rows of the first steps."""
        n = self.first[steps]
        return PartialTable.from_arrays(steps, self.step[:n], self.ids[:n], self.kind[:n], self.z[:n], self.var[:n])


def part_words(ranges: int, bearings: int, sightings: int) -> str:
    """Says which of a log's `sightings` tell a range, or a bearing, alone; "" of none."""
    said = [f"{ranges:,} range{'s' * (ranges > 1)} without a bearing"] * bool(ranges)
    said += [f"{bearings:,} bearing{'s' * (bearings > 1)} without a range"] * bool(bearings)
    if len(said) == 1 and sightings == ranges + bearings > 1:
        return f"all of them {'ranges without a bearing' if ranges else 'bearings without a range'}"
    return f"{' and '.join(said)} among them" if said else ""

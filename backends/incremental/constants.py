"""The constant errors of sensors as a smoother's variables: scale and offset of ranges, and a heading's offset."""

import numpy as np

from ...core.factors import Systematic
from ...core.se2 import Array, Ints
from ..api import Constant
from ..constant_errors import CovOf, stated
from ..sighting_tables import Row, Tables
from ..smoothing._graph import ALONE, NO_VARIABLE, PRIOR

HELD = 1e-9
"""Standard deviation that holds a constant error at zero: of the two that are one variable, the prior has one."""

EVERY, HEADING = -1, -2
"""Names of the errors that all landmarks' ranges have, and of a heading's; others are those of a landmark's id."""


class ConstantVariables:
    """Creates them at their first factor, each with its prior as another row of that step."""

    def __init__(self, tables: Tables, sds: Systematic) -> None:
        self._tables, self._sds = tables, sds
        self._ranges = sds.range_scale > 0 or sds.range_offset > 0
        self._variable: dict[int, int] = {}

    def of_range(self, landmark: int, rows: list[Row]) -> int:
        """The variable of the errors of ranges to a landmark, ALONE without any; its prior is added to `rows`."""
        if not self._ranges:
            return ALONE
        sds = self._sds.range_scale or HELD, self._sds.range_offset or HELD
        return self._found(landmark if self._sds.each else EVERY, sds, rows)

    def of_heading(self, rows: list[Row]) -> int:
        """The variable of a heading's error, held fixed at zero without any; its prior is added to `rows`."""
        return self._found(HEADING, (self._sds.heading_offset, 1.0), rows)

    def read(self, values: Array, landmarks: Ints, cov_of: CovOf) -> Constant | None:
        """The errors of these landmarks' ranges and of headings, at `values` (v, 3); None without any."""
        if not self._ranges and not self._sds.heading_offset > 0:
            return None
        names = landmarks.tolist() if self._sds.each else [EVERY]
        pairs = np.array([values[self._variable[i], :2] if i in self._variable else (0.0, 0.0) for i in names])
        turn = values[self._variable[HEADING], 0] if HEADING in self._variable else 0.0
        scale, offset = pairs.reshape(-1, 2).T
        there = [self._variable.get(name, NO_VARIABLE) for name in (*names, HEADING)]
        first = [self._sds.range_scale, self._sds.range_offset]
        sds = stated(cov_of, there, [*[first] * len(names), [self._sds.heading_offset, 0.0]])
        return Constant(scale, offset, float(turn), sd=sds)

    def renumbered(self, variables: Ints) -> None:
        """Takes other numbers of variables, by the present ones."""
        self._variable = {name: int(variables[v]) for name, v in self._variable.items()}

    def _found(self, name: int, sds: tuple[float, float], rows: list[Row]) -> int:
        found = self._variable.get(name, NO_VARIABLE)
        if found == NO_VARIABLE:
            found = self._variable[name] = self._tables.add_pair(free=sds[0] > 0)
            if sds[0] > 0:
                rows.append((found, PRIOR, (0.0, 0.0, sds[0] ** -2, 0.0, sds[1] ** -2)))
        return found

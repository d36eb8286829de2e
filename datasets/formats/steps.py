"""Rows of a log's folder that belong to its steps."""

import numpy as np

from ...core.scan import Scan
from ...core.table import Table


def by_step(table: Table, steps: int, *whole: str) -> Scan[Table]:
    """The valid rows of `table`, sorted by the column `step`, each of an existing step; `whole` names integers."""
    table = yield from table.scan_whole("step", *whole)
    step = table.column("step")
    expected = f"expected 0 to {steps - 1}, the steps in odometry.csv"
    outside = (step < 0) | (step >= steps)
    table = (yield from table.refuse(outside, lambda row: f"step is {step[row]:.0f}, {expected}")).sound()
    step = table.whole("step")
    back = np.flatnonzero(np.diff(step) < 0) + 1
    for row in back:
        yield table.fault(row, f"step is {step[row]} after {step[row - 1]}, expected rows sorted by step")
    return table.take(np.argsort(step, kind="stable")) if len(back) else table

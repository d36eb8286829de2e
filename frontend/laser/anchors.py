"""Places of times between the steps of a laser log, by the front end's own path."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.relations import LONGEST_GAP, Anchors
from ...core.se2 import Array, between, compose
from .front_end import FrontEnd

SAME = 2e-5
"""s; a time is that of a scan to this: stamps are written with six digits, and scans are 2 ms apart at least."""


class Placed(NamedTuple):
    """Times by the steps around them."""

    anchors: Anchors  # (m,)
    known: NDArray[np.bool]  # (m,) False: before the first scan, after the last one, or in too long a gap
    exact: NDArray[np.bool]  # (m,) the time is that of a scan


def anchors(front_end: FrontEnd, times: Array) -> Placed:
    """Places `times` (m,), s, on the matcher's path: at a scan, or linearly between two."""
    t, path = np.array(front_end.t), front_end.path
    steps = np.array([step.scan for step in front_end.steps])
    after = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    gap = t[after] - t[after - 1]
    on = [np.abs(times - t[k]) < SAME for k in (after - 1, after)]
    share = np.clip((times - t[after - 1]) / gap, 0, 1)
    share = np.where(on[0], 0.0, np.where(on[1], 1.0, share))
    exact = on[0] | on[1]
    place = compose(path[after - 1], between(path[after - 1], path[after]) * share[:, None])
    scan = after - 1 + share  # its number, between two scans a fraction
    step = np.searchsorted(steps, np.where(exact, np.rint(scan), scan), side="right") - 1
    later = np.minimum(step + 1, len(steps) - 1)
    at, until = t[steps[step]], t[steps[later]]
    passed = np.clip((times - at) / np.where(later > step, until - at, 1.0), 0, 1)
    inside = (t[0] <= times) & (times <= t[-1]) & (gap <= LONGEST_GAP)
    ends = between(path[steps[step]], place), between(path[steps[later]], place)
    found = Anchors(step + front_end.shift, *ends, passed)
    return Placed(found, (exact | inside) & (step >= front_end.first), exact)

"""What a recording's truth says of its sightings: how far each is off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...frontend.factors import Truth
from ...frontend.se2 import Array
from ...frontend.truth_errors import difference, rows_of, sighted_from
from .sightings import Sightings


class TrueErrors(NamedTuple):
    """How far sightings are off, of those whose marker and pose are known."""

    known: NDArray[np.bool_]  # (s,) of all sightings
    errors: Array  # (m, 2) measured minus true range (m) and bearing (rad)


def true_errors(sightings: Sightings, t: Array, truth: Truth) -> TrueErrors:
    """The errors of `sightings` in frames at `t` (n,), with `truth` at those of these times that it covers."""
    if truth.map is None:
        return TrueErrors(np.zeros(len(sightings.ids), bool), np.zeros((0, 2)))
    pose, place = rows_of(truth.t, t)[sightings.frame], rows_of(truth.map.ids, sightings.ids)
    known = (pose >= 0) & (place >= 0)
    right = sighted_from(truth.poses[pose[known]], truth.map.xy[place[known]])
    return TrueErrors(known, difference(sightings.z[known], right))

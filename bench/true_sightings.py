"""What a recording's truth says of its sightings: how far each is off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frontend.factors import Truth
from ..frontend.se2 import Array, wrap
from .detection import Sightings


class TrueErrors(NamedTuple):
    """How far sightings are off, of those whose marker and pose are known."""

    known: NDArray[np.bool_]  # (s,) of all sightings
    errors: Array  # (m, 2) measured minus true range (m) and bearing (rad)


def true_errors(sightings: Sightings, t: Array, truth: Truth) -> TrueErrors:
    """The errors of `sightings` in frames at `t` (n,), with `truth` at those of these times that it covers."""
    step_known = np.isin(t, truth.t)
    known = step_known[sightings.frame]
    if truth.map is None or not known.any():
        return TrueErrors(np.zeros(len(known), bool), np.zeros((0, 2)))
    known &= np.isin(sightings.ids, truth.map.ids)
    poses = truth.poses[np.searchsorted(truth.t, t[sightings.frame[known]])]
    order = np.argsort(truth.map.ids)
    rows = order[np.searchsorted(truth.map.ids, sightings.ids[known], sorter=order)]
    away = truth.map.xy[rows] - poses[:, :2]
    expected = np.stack((np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0]) - poses[:, 2]), axis=-1)
    errors = sightings.z[known] - expected
    errors[:, 1] = wrap(errors[:, 1])
    return TrueErrors(known, errors)

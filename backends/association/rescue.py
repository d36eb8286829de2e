"""A rescue of a step whose sightings would be mostly new landmarks, by the map so far."""

import numpy as np

from ...core.factors import UNKNOWN, Map, RangeBearing, Step
from ...core.se2 import Array, compose
from .._rules import NEW
from ..api import Backend
from ..locating.locate import locate

SURE = 5  # landmarks that have to agree
MARGIN = 6.0  # logarithm of how much likelier the pose has to be than any other
REACH = 2.0  # ranges of the furthest sighting that landmarks are taken from


def rescued(inner: Backend, pose: Array | None, step: Step, open_: list[int]) -> tuple[list[int], list[int]] | None:
    """Looks for a frame that would be mostly new on the map so far, before it doubles landmarks.

    One frame whose sightings are all off together doubles what it sees, and all is lost. Only the decision is made
    by the pose found; the backend gets the sightings as they are.

    `pose` (3,) is that of the step before, `open_` are the rows of the sightings to be decided on. Returns for each of
    these an index of the landmarks or NEW, and the ids of these landmarks; None where no pose is sure.
    """
    if len(open_) < SURE or pose is None:
        return None
    around = inner.map()
    here = pose if step.odometry is None else compose(pose, step.odometry.delta)
    near = np.flatnonzero(np.hypot(*(around.xy - here[:2]).T) < REACH * step.sightings.z[:, 0].max())
    if len(near) < SURE:
        return None
    entries = np.stack((2 * near, 2 * near + 1), axis=1).ravel()
    joint = None if around.cov is None else around.cov[np.ix_(entries, entries)]
    ids, z, cov = step.sightings
    fix = locate(
        [step._replace(odometry=None, sightings=RangeBearing(ids[open_], z[open_], cov[open_]))],
        Map(around.ids[near], around.xy[near], joint),
        least=SURE,
        margin=MARGIN,
    )
    if fix is None:
        return None
    found = fix.ids.tolist()
    return [k if landmark != UNKNOWN else NEW for k, landmark in enumerate(found)], found

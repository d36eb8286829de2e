"""Furniture with landmarks on it, which is somewhere else the next day: their ids stay, their places change."""

from dataclasses import replace

import numpy as np

from ...core.arrays import frozen, frozen_ids
from ...core.factors import Log, Truth
from ...core.se2 import Ints, wrap
from ...core.truth.errors import rows_of, sighted_from
from .in_view import NEAREST


def rearranged(
    log: Log, truth: Truth, share: float, day: Ints, far: float, reach: float, rng: np.random.Generator
) -> tuple[Log, Truth]:
    """Moves a random `share` of the landmarks between two days; `day` (n,) is that of each step.

    On the first day they are at their places of the map, on each other one anywhere at most `far` m from there in x and
    in y. Sightings keep their errors, and are those of the steps in which the first place is in view; where a landmark
    is now nearer than NEAREST or farther than `reach` m, they are left out. The truth's `moving` has the ids. A larger
    share includes the landmarks of a smaller one, with the same places.
    """
    assert truth.map is not None
    choosing, placing = rng.spawn(2)
    chosen = np.flatnonzero(choosing.uniform(size=len(truth.map.ids)) < share)
    own = placing.spawn(len(truth.map.ids))
    row = rows_of(truth.map.ids, log.ids if truth.assigned is None else truth.assigned)
    order = np.argsort(row, kind="stable")
    step, z, kept = log.sighting_step, log.z.copy(), np.ones(len(row), bool)
    ends = np.searchsorted(row[order], np.stack((chosen, chosen + 1)))
    for landmark, first, end in zip(chosen.tolist(), *ends.tolist(), strict=True):
        of = order[first:end]
        moves = np.concatenate((np.zeros((1, 2)), own[landmark].uniform(-far, far, (int(day[-1]), 2))))
        home = truth.map.xy[landmark]
        poses = truth.poses[step[of]]
        now = sighted_from(poses, home + moves[day[step[of]]])
        z[of] += now - sighted_from(poses, np.broadcast_to(home, (len(of), 2)))
        kept[of] = (now[:, 0] >= NEAREST) & (now[:, 0] <= reach) & (z[of, 0] > 0)
    z[:, 1] = np.where(np.isin(row, chosen), wrap(z[:, 1]), z[:, 1])
    truth = truth._replace(
        moving=frozen_ids(truth.map.ids[chosen]),
        assigned=None if truth.assigned is None else frozen_ids(truth.assigned[kept]),
    )
    return replace(
        log,
        sighting_first=frozen_ids(np.searchsorted(step[kept], np.arange(len(log) + 1))),
        ids=frozen_ids(log.ids[kept]),
        z=frozen(z[kept]),
        z_cov=frozen(log.z_cov[kept]),
    ), truth

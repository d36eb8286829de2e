"""Outliers planted into a log: sightings of one landmark that are taken for another's."""

from dataclasses import replace

import numpy as np

from ...frontend.factors import Dataset, Log, Truth


def swapped(log: Log, truth: Truth, share: float, rng: np.random.Generator) -> Dataset:
    """`log` with `share` of its sightings, any of them, given the id of another of its landmarks.

    That is one without a sighting at the same step, so that an id still comes once a step at most; where there is none,
    the sighting is left as it was. The truth's `assigned` has the ids of before, the notes how many were changed.
    """
    everyone, ids = np.unique(log.ids, return_inverse=True)
    step = log.sighting_step
    planted = 0
    for k in rng.permutation(len(ids))[: round(share * len(ids))]:
        here = slice(log.sighting_first[step[k]], log.sighting_first[step[k] + 1])
        others = len(everyone) - len(taken := np.unique(ids[here]))
        if others:
            # The n-th of those that are not here: each that is here, in order, moves it one on.
            n = rng.integers(others)
            for one in taken:
                n += one <= n
            ids[k] = n
            planted += 1
    ids = everyone[ids]
    ids.flags.writeable = False
    notes = {**log.notes, "outliers": f"{planted} of {len(ids)} sightings have another landmark's id"}
    assigned = log.ids if truth.assigned is None else truth.assigned
    return Dataset(replace(log, ids=ids, notes=notes), truth._replace(assigned=assigned))

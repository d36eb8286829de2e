"""Outliers planted into a log: sightings of one landmark that are taken for another's."""

from dataclasses import replace

import numpy as np

from ..frontend.factors import Dataset, Log, Truth


def swapped(log: Log, truth: Truth, share: float, rng: np.random.Generator) -> Dataset:
    """`log` with `share` of its sightings, any of them, given the id of another of its landmarks.

    That is one without a sighting at the same step, so that an id still comes once a step at most; where there is none,
    the sighting is left as it was. The truth's `assigned` has the ids of before, the notes how many were changed.
    """
    ids = log.ids.copy()
    everyone, step = np.unique(ids), log.sighting_step
    planted = 0
    for k in rng.permutation(len(ids))[: round(share * len(ids))]:
        here = slice(log.sighting_first[step[k]], log.sighting_first[step[k] + 1])
        others = np.setdiff1d(everyone, ids[here])
        others = others[others != log.ids[k]]
        if len(others):
            ids[k] = rng.choice(others)
            planted += 1
    ids.flags.writeable = False
    notes = {**log.notes, "outliers": f"{planted} of {len(ids)} sightings have another landmark's id"}
    return Dataset(replace(log, ids=ids, notes=notes), truth._replace(assigned=log.ids))

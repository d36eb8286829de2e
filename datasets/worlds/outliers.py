"""Adds data association outliers to a log: sightings of one landmark with another's id."""

from dataclasses import replace

import numpy as np

from ...core.factors import Dataset, Log, Truth


def swapped(log: Log, truth: Truth, share: float, rng: np.random.Generator) -> Dataset:
    """`log` with a random `share` of its sightings given the id of another of its landmarks.

    That landmark has no sighting at the same step, so that an id still occurs at most once per step; if there is none,
    the sighting is unchanged. The truth's `assigned` has the original ids, the notes the number of changes.
    """
    everyone, ids = np.unique(log.ids, return_inverse=True)
    step = log.sighting_step
    planted = 0
    for k in rng.permutation(len(ids))[: round(share * len(ids))]:
        here = slice(log.sighting_first[step[k]], log.sighting_first[step[k] + 1])
        others = len(everyone) - len(taken := np.unique(ids[here]))
        if others:
            # The n-th of those absent: each that is present, in order, shifts it by one.
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

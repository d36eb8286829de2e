"""Sightings as chains, each of one landmark in the order of time."""

import numpy as np

from ...core.se2 import Array, Ints


def in_chains(ids: Ints, step: Ints) -> Ints:
    """The order of sightings by landmark, then by step."""
    return np.lexsort((step, ids))


def gaps(ids: Ints, t: Array) -> Array:
    """Seconds (n,) since the sighting before, of the same landmark, of sightings in that order; inf for the first."""
    gap = np.diff(t, prepend=np.nan)
    gap[np.diff(ids, prepend=ids[:1] - 1) != 0] = np.inf
    return gap

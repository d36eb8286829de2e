"""The known places of landmarks that tell of a sensor's errors: those that fit the log."""

import numpy as np

from ...core.factors import Log, Map, Truth
from ...core.truth.errors import standing
from ..measure.misplaced import FEWEST, misplaced, put_right, told


def places_of(log: Log, truth: Truth | None, found: Map) -> Map | None:
    """The known places of landmarks that fit the map `found`; None where they are too few.

    Exchanged ones are put right, those far off are left out.
    """
    known = None if truth is None or truth.places != "truth" else standing(truth)
    if known is None:
        return None
    odd = misplaced(found, known, told(log, found.ids))
    if odd.exchanged is not None:
        known = put_right(known, odd.exchanged)
    astray = () if odd.astray is None else odd.astray.ids
    use = np.isin(known.ids, found.ids) & ~np.isin(known.ids, astray)
    return Map(known.ids[use], known.xy[use], None) if use.sum() >= FEWEST else None

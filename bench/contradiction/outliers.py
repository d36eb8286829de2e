"""Finds sightings that do not fit the others of a log which else agrees with itself."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.factors import Log
from ...core.se2 import Array, Ints
from ..measure.stated_noise import NAMED
from ..words.numerals import listed, number
from .fit import FAR, Fitted

MANY = 0.03
"""Share of sightings that are far out, which is said."""

OFTEN, FEWEST = 0.3, 20
"""Likewise of one landmark's, of which there must be so many. In published logs at most 0.12 are, and 0.25 of a depth
camera's features."""


def outliers(fits: Sequence[tuple[Log, Fitted]], told: Ints) -> Iterator[str]:
    """Says which landmarks' sightings do not fit, and how many of the others' do not, without those `told` already."""
    if not fits:
        return
    ids = np.concatenate([log.ids for log, _ in fits])
    far = np.concatenate([fit.squares for _, fit in fits]) > FAR
    ids, far = ids[~np.isin(ids, told)], far[~np.isin(ids, told)]
    odd = _odd(ids, far)
    of_odd = np.isin(ids, odd)
    if len(odd):
        share, of = number(100 * float(far[of_odd].mean())), f"{int(of_odd.sum()):,} sightings that were looked at"
        names, one = listed([str(name) for name in odd.tolist()], NAMED), len(odd) == 1
        where = "it moves, or another landmark has its id" if one else "they move, or two landmarks have one id"
        yield f"of landmark{'s' * (not one)} {names}, {share} % of the {of} do not fit the others, as where {where}"
    rest = far[~of_odd]
    if len(rest) >= FEWEST and rest.mean() > MANY:
        yield (
            f"{number(100 * float(rest.mean()))} % of the sightings that were looked at do not fit the others, where "
            "chance has 0.1 %, as where ids are wrong"
        )


def _odd(ids: Ints, far: NDArray[np.bool_]) -> Ints:
    """The landmarks whose sightings are often far out, those with the largest share first."""
    names, of = np.unique(ids, return_inverse=True)
    count, share = np.bincount(of), _mean(of, far)
    found = np.flatnonzero((count >= FEWEST) & (share > OFTEN))
    return names[found[np.argsort(-share[found], kind="stable")]]


def _mean(of: Ints, values: NDArray[np.bool_]) -> Array:
    return np.bincount(of, weights=values) / np.bincount(of)

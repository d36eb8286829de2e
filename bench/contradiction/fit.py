"""Fits a stretch of a log robustly: how far its measurements are from agreeing, by kind."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtri

from ...backends.api import Diverged
from ...backends.common_options import LOSSES
from ...backends.graphs.batch import Batch
from ...core.factors import Log, Map
from ...core.se2 import Array, between
from ...core.truth.errors import difference
from ..measure.misfit import loop_misfits, misfits

KINDS = ("motions", "sightings", "loops")
LOSS = "cauchy"
TOLERANCE, ITERATIONS = 1e-4, 30
MOST, FEWEST = 0.9, 0.6
"""Share of each kind that counts, the least; and that with outliers, of which more are none."""

TAIL = 1.5
"""Mean of the one share over that of the other, each over that of chi-square, above which there are outliers."""

INFINITE = 1e12
"""Squares beyond are this."""


FAR = float(chdtri(2, 0.001))
"""Normalised squares of sightings beyond are far out: 0.1 % are by chance, and at most 0.8 % in published logs."""


class Part(NamedTuple):
    """The rest of the measurements of one kind at an optimum."""

    components: int
    size: float  # of a normalised square over its dimension: below 1 where they are as stated, as the fit takes some
    bulk: float  # likewise without outliers


class Fitted(NamedTuple):
    """The optimum of a robust fit of a stretch, and the rest of its measurements there."""

    path: Array  # (n, 3)
    landmarks: Map
    squares: Array  # (s,) of the sightings, normalised
    dof: int
    motions: Part
    sightings: Part
    loops: Part

    @property
    def kinds(self) -> tuple[Part, Part, Part]:
        """The parts."""
        return self.motions, self.sightings, self.loops


class Agreement(NamedTuple):
    """The rests of all stretches of a log together."""

    j: float  # J per degree of freedom: about 1 where noise is as stated; infinite where no fit succeeds
    bulk: float  # likewise without outliers
    dof: int
    parts: dict[str, float]  # kind -> size without outliers


def fitted(log: Log, start: Fitted | None = None) -> Fitted | None:
    """Fits a path and a map to a stretch, from dead reckoning or a `start`; None where that does not succeed."""
    batch = Batch(log, list(LOSSES).index(LOSS), LOSSES[LOSS])
    try:
        if start is None:
            batch.start_by_odometry()
        else:
            batch.start_at(start.path, start.landmarks)
        batch.fit(TOLERANCE, ITERATIONS)
    except Diverged:
        return None
    path, landmarks = batch.place()
    sighted = misfits(log, path, landmarks)
    if sighted is None or not np.isfinite(path).all():
        return None
    moved = difference(between(path[:-1], path[1:]), log.delta[1:])
    motions = np.einsum("ni,ni->n", moved, np.linalg.solve(log.delta_cov[1:], moved[..., None])[..., 0])
    loops = loop_misfits(log, path)
    dof = 2 * (len(log.ids) - len(landmarks.ids)) + 3 * len(loops)
    return Fitted(path, landmarks, sighted, dof, _part(motions, 3), _part(sighted, 2), _part(loops, 3))


def agreement(found: Sequence[Fitted | None]) -> Agreement:
    """Sums up the fits of all stretches."""
    done = [one for one in found if one is not None]
    if len(done) < len(found) or not done:
        return Agreement(np.inf, np.inf, 0, {})
    sizes = dict[str, float]()
    for kind, of_kind in zip(KINDS, zip(*(one.kinds for one in done), strict=True), strict=True):
        count = sum(part.components for part in of_kind)
        if count:
            sizes[kind] = sum(part.components * part.bulk for part in of_kind) / count
    dof = sum(one.dof for one in done)
    parts = [part for one in done for part in one.kinds]
    j = sum(part.components * part.size for part in parts) / dof
    bulk = sum(part.components * part.bulk for part in parts) / dof
    return Agreement(j, bulk, dof, sizes)


def _part(squares: Array, k: int) -> Part:
    """Sums up normalised squares (n,) of dimension k, by the means of those that count over those of chi-square."""
    if not len(squares):
        return Part(0, 0.0, 0.0)
    ordered = np.sort(np.minimum(squares, INFINITE))
    most, fewest = (
        float(ordered[: max(1, round(share * len(squares)))].mean()) / kept_mean(k, share) for share in (MOST, FEWEST)
    )
    return Part(k * len(squares), most, most if most < TAIL * fewest else fewest)


def kept_mean(k: int, share: float) -> float:
    """Returns the mean of the least `share` of chi-square of k degrees of freedom."""
    return k * float(chdtr(k + 2, chdtri(k, 1 - share))) / share

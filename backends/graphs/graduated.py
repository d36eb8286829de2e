"""Graduated non-convexity: rejects sightings and loop closures from a batch by truncated least squares.

H. Yang, P. Antonante, V. Tzoumas and L. Carlone, "Graduated non-convexity for robust spatial perception: from
non-minimal solvers to global outlier rejection", IEEE RA-L 5(2), 2020: a loss that starts convex and ends truncated,
alternating between weighting them and fitting with these weights. Odometry is never weighted: it joins all poses, so
that what is left determines them.
"""

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints
from ..smoothing._graph import LANDMARK, NO_VARIABLE, PART, PRIOR, SIGHTINGS, WHOLE
from .batch import Batch
from .distances import of_loops

INLIER_PART, INLIER, INLIER_LOOP = 10.828, 13.816, 16.266
"""Squared Mahalanobis distance that 999 of 1000 correct partial and whole sightings and loop closures stay within.

Chi-square, of 1, 2 and 3 degrees of freedom.
"""

GROWTH, ROUNDS, SLIGHTEST = 1.4, 100, 1e-6
"""Growth per round of mu, the loss's distance from convexity; most rounds; least mu."""

SETTLED, FALL = 1e-4, 1e-5
"""Convergence: distance of all weights from 0 or 1, or relative change of the weighted cost in the last round."""

COARSE = 1e-8  # relative decrease of J below which a fit between two rounds of weights stops
HALF = 0.5  # weight at most which a sighting or a loop closure is rejected

NEXT_TO_NOTHING = 1e-9
"""Weight of a rejected sighting: landmarks with only such ones keep a position."""


def leave_out(batch: Batch, iterations: int) -> None:
    """Fits, and removes sightings and loops that do not fit; a landmark keeps its best sighting. Reorders everything.

    The batch has been started, and has no loss. The first weights of loops are those at the start: a plain fit with
    false loops, which are thousands of standard deviations off, ends metres away, near another minimum.
    """
    g = batch.forest.g
    s = int(g.state[SIGHTINGS])
    information = g.seen[:s, 2:].copy()
    parts = g.sightings[:s, PART]
    of_sighting = np.where(parts == WHOLE, INLIER, np.where(parts > PRIOR, INLIER_PART, np.inf))
    inlier = np.concatenate((of_sighting, np.full(len(batch.log.loop_to), INLIER_LOOP)))
    weights, mu, before = np.ones(len(inlier)), 0.0, np.inf
    if not len(batch.log.loop_to):
        before = batch.fit(COARSE, iterations).cost
    for _ in range(ROUNDS):
        path, _ = batch.place()
        distance = np.concatenate((batch.distances(), of_loops(batch.log, path)))
        if mu == 0.0:
            beyond = 2 * distance > inlier
            if not beyond.any():
                break
            mu = max((inlier[beyond] / (2 * distance[beyond] - inlier[beyond])).min(), SLIGHTEST)
        weights = _weights(distance, inlier, mu)
        g.seen[:s, 2:] = np.maximum(weights[:s], NEXT_TO_NOTHING)[:, None] * information
        batch.weigh_loops(weights[s:])
        batch.refit()
        cost = batch.fit(COARSE, iterations).cost
        if abs(cost - before) < FALL * max(before, 1e-7) or np.abs(weights - np.rint(weights)).max() < SETTLED:
            break
        before, mu = cost, GROWTH * mu
    g.seen[:s, 2:] = information
    g.sightings[:s, LANDMARK][_left_out(weights[:s], g.sightings[:s, LANDMARK])] = NO_VARIABLE
    batch.weigh_loops(np.where(weights[s:] > HALF, 1.0, 0.0))
    batch.order()


def _weights(distance: Array, inlier: Array, mu: float) -> Array:
    """The weights of truncated least squares, eq. (14): 1 for inliers, 0 for outliers, and in between."""
    with np.errstate(divide="ignore"):
        weights = np.sqrt(inlier * mu * (mu + 1) / distance) - mu
    weights[distance <= mu / (mu + 1) * inlier] = 1.0
    weights[distance >= (mu + 1) / mu * inlier] = 0.0
    return weights


def _left_out(weights: Array, landmarks: Ints) -> NDArray[np.bool]:
    """(s,) the sightings with at most half of their weight, except the best of each landmark."""
    out = weights <= HALF
    order = np.lexsort((np.arange(len(weights)), -weights, landmarks))
    _, first = np.unique(landmarks[order], return_index=True)
    out[order[first]] = False
    return out

"""Graduated non-convexity: rejects sightings from a batch by truncated least squares.

H. Yang, P. Antonante, V. Tzoumas and L. Carlone, "Graduated non-convexity for robust spatial perception: from
non-minimal solvers to global outlier rejection", IEEE RA-L 5(2), 2020: a loss that starts convex and ends truncated,
alternating between weighting the sightings and fitting with these weights.
"""

import numpy as np
from numpy.typing import NDArray

from ...frontend.se2 import Array, Ints
from ..models import innovation, sight
from ..smoothing._graph import LANDMARK, NO_VARIABLE, POSE, SIGHTINGS
from .batch import Batch

INLIER = 13.816
"""Squared Mahalanobis distance that 999 of 1000 correct sightings stay within: chi-square, 2 degrees of freedom."""

GROWTH, ROUNDS, SLIGHTEST = 1.4, 100, 1e-6
"""Growth per round of mu, the loss's distance from convexity; most rounds; least mu."""

SETTLED, FALL = 1e-4, 1e-5
"""Convergence: distance of all weights from 0 or 1, or relative change of the weighted cost in the last round."""

COARSE = 1e-8
"""Relative decrease of J below which a fit between two rounds of weights stops."""

NEXT_TO_NOTHING = 1e-9
"""Weight of a rejected sighting: landmarks with only such ones keep a position."""


def leave_out(batch: Batch, iterations: int) -> None:
    """Fits, and removes the sightings that do not fit; a landmark keeps its best one. Everything is reordered.

    The batch has been started, and has no loss.
    """
    g = batch.forest.g
    s = int(g.state[SIGHTINGS])
    information = g.seen[:s, 2:].copy()
    weights, mu, before = np.ones(s), 0.0, batch.fit(COARSE, iterations).cost
    for _ in range(ROUNDS):
        distance = _distances(batch, information)
        if mu == 0.0:
            if not s or 2 * distance.max() <= INLIER:
                break
            mu = max(INLIER / (2 * distance.max() - INLIER), SLIGHTEST)
        weights = _weights(distance, mu)
        g.seen[:s, 2:] = np.maximum(weights, NEXT_TO_NOTHING)[:, None] * information
        batch.refit()
        cost = batch.fit(COARSE, iterations).cost
        if abs(cost - before) < FALL * max(before, 1e-7) or np.abs(weights - np.rint(weights)).max() < SETTLED:
            break
        before, mu = cost, GROWTH * mu
    g.seen[:s, 2:] = information
    g.sightings[:s, LANDMARK][_left_out(weights, g.sightings[:s, LANDMARK])] = NO_VARIABLE
    batch.order()


def _distances(batch: Batch, information: Array) -> Array:
    """(s,) the squared Mahalanobis distances of all sightings."""
    g, s = batch.forest.g, len(information)
    poses, landmarks = g.values[g.sightings[:s, POSE]], g.values[g.sightings[:s, LANDMARK], :2]
    e = innovation(g.seen[:s, :2].copy(), sight(poses, landmarks)[0])
    rr, rb, bb = information.T
    return rr * e[:, 0] ** 2 + 2 * rb * e[:, 0] * e[:, 1] + bb * e[:, 1] ** 2


def _weights(distance: Array, mu: float) -> Array:
    """The weights of truncated least squares, eq. (14): 1 for inliers, 0 for outliers, and in between."""
    with np.errstate(divide="ignore"):
        between = np.sqrt(INLIER * mu * (mu + 1) / distance) - mu
    between[distance <= mu / (mu + 1) * INLIER] = 1.0
    between[distance >= (mu + 1) / mu * INLIER] = 0.0
    return between


def _left_out(weights: Array, landmarks: Ints) -> NDArray[np.bool]:
    """(s,) the sightings with at most half of their weight, except the best of each landmark."""
    out = weights <= 0.5
    order = np.lexsort((np.arange(len(weights)), -weights, landmarks))
    _, first = np.unique(landmarks[order], return_index=True)
    out[order[first]] = False
    return out

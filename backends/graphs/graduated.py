"""Graduated non-convexity: which sightings to leave out of a batch, by truncated least squares.

H. Yang, P. Antonante, V. Tzoumas and L. Carlone, "Graduated non-convexity for robust spatial perception: from
non-minimal solvers to global outlier rejection", IEEE RA-L 5(2), 2020: a loss that is convex at first and truncated at
last; in between, weights of the sightings and the fit with these weights take turns.
"""

import numpy as np
from numpy.typing import NDArray

from ...frontend.se2 import Array, Ints
from ..models import innovation, sight
from ..smoothing._graph import LANDMARK, NO_VARIABLE, POSE, SIGHTINGS
from .batch import Batch

INLIER = 13.816
"""Squared Mahalanobis distance within which 999 of 1000 right sightings are: chi-square of 2 degrees of freedom."""

GROWTH, ROUNDS, SLIGHTEST = 1.4, 100, 1e-6
"""What mu, the loss's distance from convexity, grows by in a round; how many rounds at most; mu at the least."""

SETTLED, FALL = 1e-4, 1e-5
"""How near 0 or 1 all weights are at the end; or the share that the weighted cost changes by in the last round."""

COARSE = 1e-8
"""The share of J by which a fit between two rounds of weights has to go on falling."""

NEXT_TO_NOTHING = 1e-9
"""The weight of a sighting that is left out: what is seen by such ones alone still has a place."""


def leave_out(batch: Batch, iterations: int) -> None:
    """Fit, and take the sightings out that do not fit; a landmark keeps its best one. All is ordered anew.

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
    """The weights of truncated least squares, eq. (14): 1 for what fits, 0 for what does not, and between these."""
    with np.errstate(divide="ignore"):
        between = np.sqrt(INLIER * mu * (mu + 1) / distance) - mu
    between[distance <= mu / (mu + 1) * INLIER] = 1.0
    between[distance >= (mu + 1) / mu * INLIER] = 0.0
    return between


def _left_out(weights: Array, landmarks: Ints) -> NDArray[np.bool]:
    """(s,) the sightings with no more than half of their weight, but for the best of each landmark."""
    out = weights <= 0.5
    order = np.lexsort((np.arange(len(weights)), -weights, landmarks))
    _, first = np.unique(landmarks[order], return_index=True)
    out[order[first]] = False
    return out

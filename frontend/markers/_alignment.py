"""Levenberg-Marquardt over the grey levels of a printed pattern, compiled. `_grey` has the model and its parameters.

The first eight parameters change the homography: u grows by d0 + d1 p + d2 q + p (d6 p + d7 q) modules and v by d3 + d4
p + d5 q + q (d6 p + d7 q), in the pattern's centred coordinates p and q.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..se2 import Array
from ._grey import BLACK, BLACKEST, INK, PARAMETERS, SHARP, STIFF, TONE, WHITE, A, C, curve_of, predict
from ._pixels import box_of, extremes, gather
from ._share import RIM

ENOUGH = 500
"""Most pixels near edges that are used; of more, an even sample is taken."""

ROUNDS = 12
"""Most steps in a pass; three to five suffice."""

GRAIN = 2.0
"""Grey levels: residuals within OUTLIER of these are never outliers."""

OUTLIER = 2.5
"""Standard deviations from which a residual counts linearly (Huber)."""


@compiled
def align(
    image: NDArray[np.uint8], rays: Array, pattern: Array, homography: Array, corners: Array, prior: Array
) -> tuple[Array, Array, float, Array, Array]:
    """Aligns a pattern from a rough homography (3, 3): first homography and greys, then everything.

    Both use a part of the pixels near edges; one Newton step with all of them ends it. `image` (h, w) and its `rays`
    (h, w, 2), `pattern` (m + 2 RIM, m + 2 RIM), 1 is white, its rough `corners` (4, 2), px. `prior` (2, 11) has the
    expected values of the look's parameters from the blur on, and their standard deviations. Returns the homography
    from rays to (u, v), the normal matrix (21, 21), the residuals' standard deviation (infinite where there are too few
    pixels), the look (13,) and the gradient by edge, see `_accumulate`.
    """
    m = pattern.shape[0] - 2 * RIM
    across, along = corners[2] - corners[0], corners[3] - corners[1]
    module = math.sqrt(0.5 * abs(across[0] * along[1] - across[1] * along[0])) / m
    box = box_of(corners, image.shape, 2.0 + module)
    look = np.zeros(PARAMETERS - 8)
    darkest, brightest = extremes(image, box)
    look[BLACK], look[WHITE] = max(darkest, BLACKEST), max(brightest, BLACKEST + 1.0)
    for k in range(INK, len(look)):
        look[k] = prior[0, k - A]
    normal, gradient = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
    by_edge = np.zeros((2 * (m + 1) * (m + 2), PARAMETERS + 1))
    places = np.empty((2 * ENOUGH, 7))
    residual = np.inf
    for everything in (False, True):
        most, active, stride = (ENOUGH, PARAMETERS, 3) if everything else (ENOUGH // 2, STIFF, 2)
        cut = OUTLIER * max(residual, GRAIN)
        tolerance = (0.03 if everything else 0.1) / module
        count = gather(image, rays, homography, look, m, box, most, places)
        if count < 2 * PARAMETERS * stride:
            return homography, normal, np.inf, look, by_edge
        homography, look, residual = _settled(
            places[:count], stride, pattern, homography, look, prior, active, cut, tolerance, normal, gradient, by_edge
        )
        if not residual < np.inf:
            return homography, normal, np.inf, look, by_edge
    cut = OUTLIER * max(residual, GRAIN)
    _, chi, total = _accumulate(
        places[:count], 1, pattern, homography, look, prior, cut, PARAMETERS, normal, gradient, by_edge
    )
    factor = normal.copy()
    if not _solve(factor, gradient, PARAMETERS):
        return homography, normal, np.inf, look, by_edge
    homography, look, _ = _moved(homography, look, gradient, PARAMETERS, m)
    return homography, normal, math.sqrt(chi / max(total - PARAMETERS, 1.0)), look, by_edge


@compiled
def _settled(
    places: Array,
    stride: int,
    pattern: Array,
    homography: Array,
    look: Array,
    prior: Array,
    active: int,
    cut: float,
    tolerance: float,
    normal: Array,
    gradient: Array,
    by_edge: Array,
) -> tuple[Array, Array, float]:
    """The homography and the look that fit best, and the residuals' standard deviation; infinite if there are none.

    Uses every `stride`-th of the `places` and changes the first `active` parameters. `tolerance` is the step of the
    homography, modules, at which it ends. `normal`, `gradient` and `by_edge` are overwritten.
    """
    m = pattern.shape[0] - 2 * RIM
    step = np.zeros(PARAMETERS)
    factor = np.zeros((PARAMETERS, PARAMETERS))
    loss, chi, total = _accumulate(
        places, stride, pattern, homography, look, prior, cut, active, normal, gradient, by_edge
    )
    damping = 1e-4
    for _ in range(ROUNDS):
        for i in range(active):
            step[i] = gradient[i]
            for j in range(active):
                factor[i, j] = normal[i, j]
            factor[i, i] += damping * normal[i, i] + 1e-9
        if not _solve(factor, step, active):
            return homography, look, np.inf
        trial_homography, trial_look, largest = _moved(homography, look, step, active, m)
        trial_loss, trial_chi, trial_total = _accumulate(
            places, stride, pattern, trial_homography, trial_look, prior, cut, active, factor, step, by_edge
        )
        if not trial_loss < loss * (1.0 + 1e-9):
            damping *= 10.0
            settled = largest < 3.0 * tolerance or damping > 1e4
        else:
            settled = largest < tolerance or loss - trial_loss < 1e-3 * loss
            homography, look, loss, chi, total = trial_homography, trial_look, trial_loss, trial_chi, trial_total
            for i in range(active):
                gradient[i] = step[i]
                for j in range(active):
                    normal[i, j] = factor[i, j]
            damping = max(damping * 0.1, 1e-7)
        if settled:
            break
    return homography, look, math.sqrt(chi / max(total - active, 1.0))


@compiled
def _accumulate(
    places: Array,
    stride: int,
    pattern: Array,
    G: Array,
    look: Array,
    prior: Array,
    cut: float,
    active: int,
    normal: Array,
    gradient: Array,
    by_edge: Array,
) -> tuple[float, float, float]:
    """Fills the normal equations; returns the robust loss, the weighted sum of squares and the sum of weights.

    Only the first `active` parameters may change. `by_edge` (2 (m + 1) (m + 2), 22) gets the gradient's parts, and in
    its last column the sum of weights: row k (m + 2) + j is that of the pixels nearest to edge k across u in row j of
    modules, from the margin's -1 on; the other half likewise across v.
    """
    m = pattern.shape[0] - 2 * RIM
    half = (m + 1) * (m + 2)
    for i in range(active):
        gradient[i] = 0.0
        for j in range(active):
            normal[i, j] = 0.0
    for i in range(len(by_edge)):
        for j in range(PARAMETERS + 1):
            by_edge[i, j] = 0.0
    J = np.zeros(PARAMETERS)
    table, seen, place_in, curve = np.empty((2, 3, 7)), np.empty((2, 7)), np.empty(2), np.empty(10)
    curve_of(look, curve)
    loss, chi, total = 0.0, 0.0, 0.0
    for index in range(0, len(places), stride):
        place = places[index]
        grey = predict(place, pattern, G, look, curve, active > STIFF, table, seen, place_in, J)
        if math.isnan(grey):
            continue
        residual = place[0] - grey
        size = abs(residual)
        weight = 1.0
        if size > cut:
            weight = cut / size
            loss += cut * (2.0 * size - cut)
        else:
            loss += size * size
        u, v = place_in
        line_u, line_v = math.floor(u + 0.5), math.floor(v + 0.5)
        if abs(u - line_u) < abs(v - line_v):
            row = min(max(line_u, 0), m) * (m + 2) + min(max(math.floor(v), -1), m) + 1
        else:
            row = half + min(max(line_v, 0), m) * (m + 2) + min(max(math.floor(u), -1), m) + 1
        edge = by_edge[row]
        edge[PARAMETERS] += weight
        if active == STIFF:
            for i in range(STIFF):
                weighted = weight * J[i]
                edge[i] += weighted * residual
                for j in range(STIFF):
                    normal[i, j] += weighted * J[j]
        else:
            for i in range(PARAMETERS):
                weighted = weight * J[i]
                edge[i] += weighted * residual
                for j in range(PARAMETERS):
                    normal[i, j] += weighted * J[j]
        chi += weight * residual * residual
        total += weight
    for edge in by_edge:
        for i in range(active):
            gradient[i] += edge[i]
    variance = max(chi / max(total - active, 1.0), 0.25)
    for i in range(STIFF, active):
        information = variance / (prior[1, i - STIFF] * prior[1, i - STIFF])
        normal[i, i] += information
        gradient[i] -= information * (look[i - 8] - prior[0, i - STIFF])
    return loss, chi, total


@compiled
def _moved(G: Array, look: Array, step: Array, active: int, m: int) -> tuple[Array, Array, float]:
    """The homography and look after a step, and the largest change of the homography, modules.

    A step over 0.7 modules is shortened, and so are large changes of the blur.
    """
    largest = 0.0
    for k in range(8):
        largest = max(largest, abs(step[k]))
    d = np.empty(8)
    for k in range(8):
        d[k] = step[k] * (0.7 / max(largest, 0.7) / m)
    change = np.array([[1.0 + d[1], d[2], d[0]], [d[4], 1.0 + d[5], d[3]], [-d[6], -d[7], 1.0]])
    centred = np.array([[1.0 / m, 0.0, -0.5], [0.0, 1.0 / m, -0.5], [0.0, 0.0, 1.0]])
    back = np.array([[float(m), 0.0, m / 2.0], [0.0, float(m), m / 2.0], [0.0, 0.0, 1.0]])
    moved = look.copy()
    for k in range(active - 8):
        moved[k] = look[k] + (min(max(step[8 + k], -0.7), 0.7) if k in (A, A + 1, C) else step[8 + k])
    moved[BLACK], moved[WHITE] = max(moved[BLACK], BLACKEST), max(moved[WHITE], BLACKEST + 1.0)
    moved[A] = min(max(moved[A], -2.0), 2.3)
    moved[C] = min(max(moved[C], -2.0), 2.3)
    moved[INK] = min(max(moved[INK], -0.1), 0.1)
    moved[TONE] = min(max(moved[TONE], -0.5), 1.3)
    moved[SHARP] = min(max(moved[SHARP], -0.5), 2.0)
    return back @ (change @ (centred @ G)), moved, largest


@compiled
def _solve(normal: Array, gradient: Array, n: int) -> bool:
    """Solves the first n rows by Cholesky, in place: `normal` becomes its factor, `gradient` the solution.

    Returns False where `normal` is not positive definite.
    """
    for i in range(n):
        for j in range(i + 1):
            rest = normal[i, j]
            for k in range(j):
                rest -= normal[i, k] * normal[j, k]
            if i > j:
                normal[i, j] = rest / normal[j, j]
            elif rest > 1e-12 * normal[i, i]:
                normal[i, i] = math.sqrt(rest)
            else:
                return False
    for i in range(n):
        for k in range(i):
            gradient[i] -= normal[i, k] * gradient[k]
        gradient[i] /= normal[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            gradient[i] -= normal[k, i] * gradient[k]
        gradient[i] /= normal[i, i]
    return True


@compiled
def spread(normal: Array, by_edge: Array, residual: float) -> Array:
    """The covariance (8, 8) of the homography's change; LinAlgError where something is not determined.

    Blur, demosaicing and what the model leaves out correlate the residuals along an edge: each edge counts as one
    (White's covariance by clusters), and the whole covariance is scaled by how much more that gives, on average over
    the eight.
    """
    inverse = np.linalg.inv(normal)[:8]
    cov = np.ascontiguousarray(inverse[:, :8])
    pulls = np.zeros((len(by_edge), 8))
    whole = np.zeros(PARAMETERS + 1)
    for edge in by_edge:
        whole += edge
    for k in range(len(by_edge)):
        share_of = by_edge[k, PARAMETERS] / whole[PARAMETERS]
        for i in range(8):
            for j in range(PARAMETERS):
                pulls[k, i] += inverse[i, j] * (by_edge[k, j] - share_of * whole[j])
    clustered = pulls.T @ pulls
    excess = np.trace(np.linalg.solve(cov, clustered)) / (8.0 * residual * residual)
    return max(excess, 1.0) * residual * residual * cov

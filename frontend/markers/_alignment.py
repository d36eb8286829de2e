"""Levenberg-Marquardt over the grey levels of a printed pattern, compiled.

`_grey` has the model and its parameters, `_step` what a step of them is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._small import cholesky, dot, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._edges import COLUMNS, EDGE, RESIDUAL, WEIGHT, edge_of, sum_edges
from ._grey import BLACK, BLACKEST, INK, PARAMETERS, SHARED, STIFF, WHITE, A, C, curve_of, eye_of, predict
from ._pixels import box_of, extremes, gather
from ._share import RIM
from ._step import hold, moved

ENOUGH = 600
"""Most pixels near edges that are used, half of them in the first pass; of more, a sample is taken."""

ROUNDS = 12
"""Most steps in a pass; three to five suffice."""

LITTLE, SHORT = 0.01, 0.1
"""A step is the last of its pass where it gains less than that share of the loss, or moves no edge by as many px."""

POOR, FELT = 0.25, 0.03
"""After a step that gains less than that share of what it promises, the least damping of the next: less is not felt."""

TRUSTED = 0.1
"""Share of the blur that a step which is not evaluated changes, about: further away greys are not linear in it."""

CHANCE, AGAIN = 6.0, 4
"""How many times what chance explains a step may gain that is not evaluated, and how often a fit is settled for that.

A fit to half of a sample is by chance off that to all of it by as much as it is off the truth: the step from one to the
other gains the residuals' variance for each parameter. Of frames of an ideal camera 5 % gain more than five times that
and 1 % more than eight times, mostly as the blur, the tone or the sharpening had not settled.
"""

GRAIN = 2.0
"""Grey levels: residuals within OUTLIER of these are never outliers."""

LEAST_VARIANCE = 0.25
"""Of residuals, squared grey levels: a camera's numbers are rounded."""

SINGULAR = 1e-12
"""A pivot below that share of its diagonal entry is rounding: the pixels do not determine the parameter."""

OUTLIER = 2.5
"""Standard deviations from which a residual counts linearly (Huber)."""


@compiled
def align(
    image: NDArray[np.uint8], rays: Array, pattern: Array, homography: Array, corners: Array, prior: Array
) -> tuple[Array, Array, float, Array, Array]:
    """Aligns a pattern from a rough homography (3, 3): first homography and greys, then everything.

    Both use a part of the pixels near edges. Newton's steps end it, one with half of the sample and one with all of it:
    a single one leaves a tenth of a step of several standard deviations undone. Neither is evaluated, and so one that
    gains more than chance explains is not made: the fit is settled with that part of the sample. `image` (h, w), `rays`
    (h, w, 2), `pattern` (m + 2 RIM, m + 2 RIM), 1 is white, its rough `corners` (4, 2), px. `prior` (2, 14) has the
    expected values of the look's parameters from the blur on, and their standard deviations. Returns the homography
    from rays to (u, v), the normal matrix (24, 24), the residuals' standard deviation (infinite where there are too few
    pixels), the look (16,) and the gradient by edge, see `edge_of`.
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
    rows = np.zeros((2 * ENOUGH, COLUMNS))
    residual, eye = np.inf, np.zeros(3)
    for everything in (False, True):
        most, active, least = (ENOUGH, PARAMETERS, 6) if everything else (ENOUGH // 2, STIFF, 4)
        cut = OUTLIER * max(residual, GRAIN)
        eye = eye_of(homography, m, np.zeros(3))
        count = gather(image, rays, homography, look, m, box, most, places)
        if count < PARAMETERS * least:
            return homography, normal, np.inf, look, by_edge
        stride, enough = min(4, count // (2 * PARAMETERS)), SHORT / module
        homography, look, residual = _settled(
            places[:count], stride, pattern, homography, eye, look, prior, active, cut, enough, rows
        )
        if not residual < np.inf:
            return homography, normal, np.inf, look, by_edge
    variance, seen, step = 0.0, 0, np.zeros(PARAMETERS)
    for stride in (2, 1):
        for times in range(AGAIN + 1):
            cut = OUTLIER * max(residual, GRAIN)
            eye = eye_of(homography, m, eye)
            _, chi, total, seen = _accumulate(
                places[:count], stride, pattern, homography, eye, look, prior, cut, PARAMETERS, rows, normal, gradient
            )
            variance = chi / max(total - PARAMETERS, 1.0)
            factor, step = normal.copy(), gradient.copy()
            hold(look, factor, step)
            for i in range(8 + A, 8 + C + 1):
                factor[i, i] += max(variance, LEAST_VARIANCE) / TRUSTED**2
            if not cholesky(factor, factor, PARAMETERS, SINGULAR, 0.0):
                return homography, normal, np.inf, look, by_edge
            solve(factor, step, step, PARAMETERS)
            least = max(min(variance, residual * residual), LEAST_VARIANCE)
            if dot(step, gradient) < CHANCE * PARAMETERS * least or times == AGAIN:
                break
            homography, look, residual = _settled(
                places[:count], stride, pattern, homography, eye, look, prior, PARAMETERS, cut, 0.0, rows
            )
            if not residual < np.inf:
                return homography, normal, np.inf, look, by_edge
        if stride == 1:
            sum_edges(rows[:seen], step, by_edge)
        homography, look, _ = moved(homography, look, step, PARAMETERS, m)
    return homography, normal, math.sqrt(variance), look, by_edge


@compiled
def _settled(
    places: Array,
    stride: int,
    pattern: Array,
    homography: Array,
    eye: Array,
    look: Array,
    prior: Array,
    active: int,
    cut: float,
    tolerance: float,
    rows: Array,
) -> tuple[Array, Array, float]:
    """The homography and the look that fit best, and the residuals' standard deviation; infinite if there are none.

    Uses every `stride`-th of the `places` and changes the first `active` parameters. It ends with a step that by the
    normal equations gains little or changes the homography by less than `tolerance`, modules: that step is made and not
    evaluated. `rows` is overwritten.
    """
    m = pattern.shape[0] - 2 * RIM
    step, trial_gradient = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    gradient = np.zeros(PARAMETERS)
    normal, trial_normal, factor = np.zeros((3, PARAMETERS, PARAMETERS))
    loss, chi, total, _ = _accumulate(
        places, stride, pattern, homography, eye, look, prior, cut, active, rows, normal, gradient
    )
    damping = 1e-4
    for _ in range(ROUNDS):
        for i in range(active):
            step[i] = gradient[i]
            for j in range(active):
                factor[i, j] = normal[i, j]
            factor[i, i] += damping * normal[i, i] + 1e-9
        if active == PARAMETERS:
            hold(look, factor, step)
        if not cholesky(factor, factor, active, SINGULAR, 0.0):
            return homography, look, np.inf
        solve(factor, step, step, active)
        gain = dot(step[:active], gradient[:active])
        trial_homography, trial_look, largest = moved(homography, look, step, active, m)
        if largest < tolerance or gain < LITTLE * loss:
            homography, look = trial_homography, trial_look
            break
        trial_loss, trial_chi, trial_total, _ = _accumulate(
            places,
            stride,
            pattern,
            trial_homography,
            eye,
            trial_look,
            prior,
            cut,
            active,
            rows,
            trial_normal,
            trial_gradient,
        )
        poor = not loss - trial_loss > POOR * gain
        if poor:
            damping = max(damping * 10.0, FELT)
            if damping > 1e4:
                break
        if trial_loss < loss * (1.0 + 1e-9):
            homography, look, loss, chi, total = trial_homography, trial_look, trial_loss, trial_chi, trial_total
            gradient, trial_gradient, normal, trial_normal = trial_gradient, gradient, trial_normal, normal
        if not poor:
            damping = max(damping * 0.1, 1e-7)
    return homography, look, math.sqrt(chi / max(total - active, 1.0))


@compiled
def _accumulate(
    places: Array,
    stride: int,
    pattern: Array,
    G: Array,
    eye: Array,
    look: Array,
    prior: Array,
    cut: float,
    active: int,
    rows: Array,
    normal: Array,
    gradient: Array,
) -> tuple[float, float, float, int]:
    """Fills the normal equations; returns the robust loss, the weighted sum of squares, the sum of weights and a count.

    Only the first `active` parameters may change. As many of the `rows` as that count get a pixel each: its
    derivatives, residual, weight and nearest edge, see `edge_of`.
    """
    m = pattern.shape[0] - 2 * RIM
    table, seen, paper = np.empty((2, 3, 7)), np.empty((2, 7)), np.empty(12)
    place_in, curve = np.empty(2), np.empty(SHARED)
    curve_of(look, m, eye, curve)
    loss, chi, total, count = 0.0, 0.0, 0.0, 0
    for index in range(0, len(places), stride):
        place, row = places[index], rows[count]
        grey = predict(place, pattern, G, look, curve, active > STIFF, table, seen, paper, place_in, row)
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
        row[RESIDUAL], row[WEIGHT], row[EDGE] = residual, weight, edge_of(place_in[0], place_in[1], m)
        chi += weight * residual * residual
        total += weight
        count += 1
    product = np.zeros((PARAMETERS, COLUMNS))
    _multiply(rows[:count], active, product)
    variance = max(chi / max(total - active, 1.0), LEAST_VARIANCE)
    for i in range(active):
        gradient[i] = product[i, RESIDUAL]
        for j in range(active):
            normal[i, j] = product[i, j]
    for i in range(STIFF, active):
        information = variance / (prior[1, i - STIFF] * prior[1, i - STIFF])
        normal[i, i] += information
        gradient[i] -= information * (look[i - 8] - prior[0, i - STIFF])
    return loss, chi, total, count


@compiled
def _multiply(rows: Array, active: int, product: Array) -> None:
    """Adds to `product` (24, 27) the sum over pixels of weight times derivative times row.

    Four pixels at a time: each of the product's numbers is read and written once for them.
    """
    whole = len(rows) // 4 * 4
    for k in range(0, whole, 4):
        a, b, c, d = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for i in range(active):
            by_a, by_b, by_c, by_d = a[i] * a[WEIGHT], b[i] * b[WEIGHT], c[i] * c[WEIGHT], d[i] * d[WEIGHT]
            line = product[i]
            for j in range(COLUMNS):
                line[j] += (by_a * a[j] + by_b * b[j]) + (by_c * c[j] + by_d * d[j])
    for a in rows[whole:]:
        for i in range(active):
            by_a = a[i] * a[WEIGHT]
            for j in range(COLUMNS):
                product[i, j] += by_a * a[j]

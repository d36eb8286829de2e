"""Levenberg-Marquardt over the grey levels of a printed pattern, compiled.

`_grey` has the model and its parameters, `_step` what a step of them is.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._small import cholesky, dot, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._edges import COLUMNS, EDGE, KIND, RESIDUAL, WEIGHT, Misfit, edge_of, moved_residual, part_kinds, sum_edges
from ._grey import (
    BLACK,
    BLACKEST,
    INK,
    PARAMETERS,
    SHARED,
    STIFF,
    WHITE,
    A,
    C,
    Model,
    Scratch,
    curve_of,
    eye_of,
    predict,
)
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
"""Largest gain of a step that is not evaluated, by what chance explains, and how often a fit is settled for more.

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


class Equations(NamedTuple):
    """Normal equations of all parameters."""

    normal: Array  # (24, 24)
    gradient: Array  # (24,)


@compiled
def align(
    image: NDArray[np.uint8], rays: Array, pattern: Array, homography: Array, corners: Array, prior: Array
) -> tuple[Array, Array, float, Array, Misfit]:
    """Aligns a pattern from a rough homography (3, 3): first homography and greys, then everything.

    Both use a part of the pixels near edges. Newton's steps end it, one with half of the sample and one with all of it:
    a single one leaves a tenth of a step of several standard deviations undone. Neither is evaluated, and so one that
    gains more than chance explains is not made: the fit is settled with that part of the sample. `image` (h, w), `rays`
    (h, w, 2), `pattern` (m + 2 RIM, m + 2 RIM), 1 is white, its rough `corners` (4, 2), px. `prior` (2, 14) has the
    expected values of the look's parameters from the blur on, and their standard deviations. Returns the homography
    from rays to (u, v), the normal matrix (24, 24), the residuals' standard deviation (infinite where there are too few
    pixels), the look (16,) and the residuals by edges and kinds of pixels.
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
    equations = Equations(np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS))
    normal, gradient = equations
    edges = 2 * (m + 1) * (m + 2)
    by_edge, rest = np.zeros((edges, PARAMETERS + 1)), np.zeros((edges, PARAMETERS + 1))
    misfit = Misfit(by_edge, rest, np.zeros(PARAMETERS), np.zeros(2))
    places = np.empty((2 * ENOUGH, 8))
    rows = np.zeros((2 * ENOUGH, COLUMNS))
    residual, model = np.inf, Model(pattern, homography, look, np.zeros(3))
    for everything in (False, True):
        most, active, least = (ENOUGH, PARAMETERS, 6) if everything else (ENOUGH // 2, STIFF, 4)
        cut = OUTLIER * max(residual, GRAIN)
        model = Model(pattern, model.homography, model.look, eye_of(model.homography, m, np.zeros(3)))
        count = gather(image, rays, model.homography, model.look, m, box, most, places)
        if count < PARAMETERS * least:
            return model.homography, normal, np.inf, model.look, misfit
        stride, enough = min(4, count // (2 * PARAMETERS)), SHORT / module
        model, residual = _settled(places[:count], stride, model, prior, active, cut, enough, rows)
        if not residual < np.inf:
            return model.homography, normal, np.inf, model.look, misfit
    variance, total, seen, step = 0.0, 0.0, 0, np.zeros(PARAMETERS)
    for stride in (2, 1):
        for times in range(AGAIN + 1):
            cut = OUTLIER * max(residual, GRAIN)
            model = Model(pattern, model.homography, model.look, eye_of(model.homography, m, model.eye))
            _, chi, total, seen = _accumulate(places[:count], stride, model, prior, cut, PARAMETERS, rows, equations)
            variance = chi / max(total - PARAMETERS, 1.0)
            factor, step = normal.copy(), gradient.copy()
            hold(model.look, factor, step)
            for i in range(8 + A, 8 + C + 1):
                factor[i, i] += max(variance, LEAST_VARIANCE) / TRUSTED**2
            if not cholesky(factor, factor, PARAMETERS, SINGULAR, 0.0):
                return model.homography, normal, np.inf, model.look, misfit
            solve(factor, step, step, PARAMETERS)
            least = max(min(variance, residual * residual), LEAST_VARIANCE)
            if dot(step, gradient) < CHANCE * PARAMETERS * least or times == AGAIN:
                break
            model, residual = _settled(places[:count], stride, model, prior, PARAMETERS, cut, 0.0, rows)
            if not residual < np.inf:
                return model.homography, normal, np.inf, model.look, misfit
        if stride == 1:
            _part(rows[:seen], step, normal, variance, max(total - PARAMETERS, 1.0), misfit)
        homography, look, _ = moved(model.homography, model.look, step, PARAMETERS, m)
        model = Model(pattern, homography, look, model.eye)
    return model.homography, normal, math.sqrt(variance), model.look, misfit


@compiled
def _part(rows: Array, step: Array, normal: Array, variance: float, count: float, misfit: Misfit) -> None:
    """Fills the `misfit` from the residuals after the `step` (24,) that ends a fit, with `count` degrees of freedom."""
    for row in rows:
        row[RESIDUAL] = moved_residual(row, step)
    sum_edges(rows, misfit.by_edge)
    chi = part_kinds(rows, normal, max(variance, LEAST_VARIANCE), misfit.hidden)
    misfit.variances[0] = variance
    if not math.isnan(chi):
        sum_edges(rows, misfit.rest)
        misfit.variances[1] = chi / count


@compiled
def _settled(
    places: Array,
    stride: int,
    model: Model,
    prior: Array,
    active: int,
    cut: float,
    tolerance: float,
    rows: Array,
) -> tuple[Model, float]:
    """The model that fits best, and the residuals' standard deviation; infinite if there is none.

    Uses every `stride`-th of the `places` and changes the first `active` parameters. It ends with a step that by the
    normal equations gains little or changes the homography by less than `tolerance`, modules: that step is made and not
    evaluated. `rows` is overwritten.
    """
    m = model.pattern.shape[0] - 2 * RIM
    step, factor = np.zeros(PARAMETERS), np.zeros((PARAMETERS, PARAMETERS))
    equations = Equations(np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS))
    others = Equations(np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS))
    loss, chi, total, _ = _accumulate(places, stride, model, prior, cut, active, rows, equations)
    damping = 1e-4
    for _ in range(ROUNDS):
        normal, gradient = equations
        for i in range(active):
            step[i] = gradient[i]
            for j in range(active):
                factor[i, j] = normal[i, j]
            factor[i, i] += damping * normal[i, i] + 1e-9
        if active == PARAMETERS:
            hold(model.look, factor, step)
        if not cholesky(factor, factor, active, SINGULAR, 0.0):
            return model, np.inf
        solve(factor, step, step, active)
        gain = dot(step[:active], gradient[:active])
        homography, look, largest = moved(model.homography, model.look, step, active, m)
        trial = Model(model.pattern, homography, look, model.eye)
        if largest < tolerance or gain < LITTLE * loss:
            model = trial
            break
        trial_loss, trial_chi, trial_total, _ = _accumulate(places, stride, trial, prior, cut, active, rows, others)
        poor = not loss - trial_loss > POOR * gain
        if poor:
            damping = max(damping * 10.0, FELT)
            if damping > 1e4:
                break
        if trial_loss < loss * (1.0 + 1e-9):
            model, loss, chi, total = trial, trial_loss, trial_chi, trial_total
            equations, others = others, equations
        if not poor:
            damping = max(damping * 0.1, 1e-7)
    return model, math.sqrt(chi / max(total - active, 1.0))


@compiled
def _accumulate(
    places: Array,
    stride: int,
    model: Model,
    prior: Array,
    cut: float,
    active: int,
    rows: Array,
    equations: Equations,
) -> tuple[float, float, float, int]:
    """Fills the normal equations; returns the robust loss, the weighted sum of squares, the sum of weights and a count.

    Only the first `active` parameters may change. As many of the `rows` as that count get a pixel each: its
    derivatives, residual, weight, nearest edge and kind, see `_edges`.
    """
    m = model.pattern.shape[0] - 2 * RIM
    scratch, curve = Scratch(np.empty((2, 3, 7)), np.empty((2, 7)), np.empty(12), np.empty(2)), np.empty(SHARED)
    curve_of(model, curve)
    loss, chi, total, count = 0.0, 0.0, 0.0, 0
    for index in range(0, len(places), stride):
        place, row = places[index], rows[count]
        grey = predict(place, model, curve, active > STIFF, scratch, row)
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
        row[RESIDUAL], row[WEIGHT], row[KIND] = residual, weight, place[7]
        row[EDGE] = edge_of(scratch.uv[0], scratch.uv[1], m)
        chi += weight * residual * residual
        total += weight
        count += 1
    product = np.zeros((PARAMETERS, PARAMETERS + 1))
    _multiply(rows[:count], active, product)
    variance = max(chi / max(total - active, 1.0), LEAST_VARIANCE)
    normal, gradient = equations
    for i in range(active):
        gradient[i] = product[i, RESIDUAL]
        for j in range(active):
            normal[i, j] = product[i, j]
    for i in range(STIFF, active):
        information = variance / (prior[1, i - STIFF] * prior[1, i - STIFF])
        normal[i, i] += information
        gradient[i] -= information * (model.look[i - 8] - prior[0, i - STIFF])
    return loss, chi, total, count


@compiled
def _multiply(rows: Array, active: int, product: Array) -> None:
    """Adds to `product` (24, 25) the sum over pixels of weight times derivative times derivative or residual.

    Four pixels at a time: each of the product's numbers is read and written once for them.
    """
    whole = len(rows) // 4 * 4
    for k in range(0, whole, 4):
        a, b, c, d = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for i in range(active):
            by_a, by_b, by_c, by_d = a[i] * a[WEIGHT], b[i] * b[WEIGHT], c[i] * c[WEIGHT], d[i] * d[WEIGHT]
            line = product[i]
            for j in range(PARAMETERS + 1):
                line[j] += (by_a * a[j] + by_b * b[j]) + (by_c * c[j] + by_d * d[j])
    for a in rows[whole:]:
        for i in range(active):
            by_a = a[i] * a[WEIGHT]
            for j in range(PARAMETERS + 1):
                product[i, j] += by_a * a[j]

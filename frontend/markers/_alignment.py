"""Inner loops of `template`: a pattern's grey values under blur, and Levenberg-Marquardt over them, compiled.

The parameters are, in this order:

    0-7    the change of the homography, see `_moved`
    8-10   the blur: its covariance is L L' px^2 with L = [[exp(a), 0], [b, exp(c)]], whatever a, b, c
    11     its kurtosis: 0 is a Gaussian, -1.2 a streak of even light
    12-13  the grey levels of black and white
    14-18  how the light changes over the pattern: 1 + x p + y q + xx p^2 + xy p q + yy q^2

The last eleven are the `look`. p and q are the pattern's centred coordinates, u / m - 1/2 and v / m - 1/2, where u and
v count its m modules from the first corner.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..se2 import Array

PARAMETERS = 19

RIM = 2
"""Modules of white paper around a pattern, which the blur reaches into."""

MARGIN = 0.5
"""Modules of paper outside the black border that are used; beyond, anything may be in the image."""

ENOUGH = 500
"""Most pixels near edges that are used; of more, an even sample is taken."""

REACH = 3.0
"""Standard deviations of the blur within which a pixel is near an edge."""

ROUNDS = 12
"""Most steps in either pass; four to six suffice."""

GRAIN = 2.0
"""Grey levels: residuals within OUTLIER of these are never outliers."""

OUTLIER = 2.5
"""Standard deviations from which a residual counts linearly (Huber)."""

LOG_BLUR = math.log(0.65)
"""log px: prior standard deviation of the blur, a factor of e either way."""

_DENSITY = 1 / math.sqrt(2 * math.pi)


@compiled
def align(
    image: NDArray[np.uint8], rays: Array, pattern: NDArray[np.bool_], homography: Array, corners: Array
) -> tuple[Array, Array, float, Array]:
    """Aligns a pattern in two passes from a rough homography (3, 3): coarse, then on the pixels near its edges.

    `image` (h, w) and its `rays` (h, w, 2), `pattern` (m + 2 RIM, m + 2 RIM), True is white, its rough `corners` (4,
    2), px. Returns the homography from rays to (u, v), the normal matrix (19, 19), the residuals' standard deviation
    (infinite where there are too few pixels) and the look (11,).
    """
    m = pattern.shape[0] - 2 * RIM
    across, along = corners[2] - corners[0], corners[3] - corners[1]
    module = math.sqrt(0.5 * abs(across[0] * along[1] - across[1] * along[0])) / m
    box = _box(corners, image.shape, 2.0 + module)
    look = np.zeros(11)
    look[4], look[5] = _extremes(image, box)
    normal = np.zeros((PARAMETERS, PARAMETERS))
    gradient = np.zeros(PARAMETERS)
    trial_normal = np.zeros((PARAMETERS, PARAMETERS))
    step = np.zeros(PARAMETERS)
    places = np.empty((2 * ENOUGH, 7))
    residual = 0.0
    for free in (False, True):
        count = _gather(image, rays, homography, look, m, box, ENOUGH if free else ENOUGH // 2, places)
        if count < 2 * PARAMETERS:
            return homography, normal, np.inf, look
        cut = OUTLIER * max(residual, GRAIN) if free else np.inf
        loss, chi, total = _accumulate(places[:count], pattern, m, homography, look, cut, free, normal, gradient)
        damping = 1e-4
        for _ in range(ROUNDS):
            _copy(normal, gradient, trial_normal, step)
            for k in range(PARAMETERS):
                trial_normal[k, k] += damping * normal[k, k] + 1e-9
            if not _solve(trial_normal, step):
                return homography, normal, np.inf, look
            trial_homography, trial_look, largest = _moved(homography, look, step, m)
            trial_loss, trial_chi, trial_total = _accumulate(
                places[:count], pattern, m, trial_homography, trial_look, cut, free, trial_normal, step
            )
            if trial_loss < loss * (1.0 + 1e-9):
                settled = largest * module < (0.003 if free else 0.05) or loss - trial_loss < 3e-4 * loss
                homography, look, loss, chi, total = trial_homography, trial_look, trial_loss, trial_chi, trial_total
                _copy(trial_normal, step, normal, gradient)
                damping = max(damping * 0.1, 1e-7)
            else:
                damping *= 10.0
                settled = largest * module < 0.01 or damping > 1e4
            if settled:
                break
        residual = math.sqrt(chi / max(total - PARAMETERS, 1.0))
    return homography, normal, residual, look


@compiled
def worst_module(
    image: NDArray[np.uint8], rays: Array, pattern: NDArray[np.bool_], G: Array, look: Array, corners: Array
) -> float:
    """How far the middle of the worst module, border included, is from black or white: a share of the contrast.

    The mean over the middle averages noise out and excludes edge effects: only a different print remains.
    """
    m = pattern.shape[0] - 2 * RIM
    box = _box(corners, image.shape, 2.0)
    stride = max(1, min(box[1] - box[0], box[3] - box[2]) // (8 * m))
    total = np.zeros((m, m))
    count = np.zeros((m, m))
    light = look[6:]
    for y in range(box[0], box[1], stride):
        for x in range(box[2], box[3], stride):
            rx, ry = rays[y, x]
            w = 1.0 / (G[2, 0] * rx + G[2, 1] * ry + G[2, 2])
            u = (G[0, 0] * rx + G[0, 1] * ry + G[0, 2]) * w
            v = (G[1, 0] * rx + G[1, 1] * ry + G[1, 2]) * w
            if not (w > 0 and u > 0 and u < m and v > 0 and v < m):
                continue
            column, row = int(u), int(v)
            if abs(u - column - 0.5) > 0.25 or abs(v - row - 0.5) > 0.25:
                continue
            p = u / m - 0.5
            q = v / m - 0.5
            lit = 1.0 + light[0] * p + light[1] * q + light[2] * p * p + light[3] * p * q + light[4] * q * q
            total[row, column] += (image[y, x] / lit - look[4]) / (look[5] - look[4])
            count[row, column] += 1
    worst = 0.0
    for row in range(m):
        for column in range(m):
            if count[row, column] > 0:
                printed = 1.0 if pattern[row + RIM, column + RIM] else 0.0
                worst = max(worst, abs(total[row, column] / count[row, column] - printed))
    return worst


@compiled
def _box(corners: Array, shape: tuple[int, int], reach: float) -> tuple[int, int, int, int]:
    """The range of rows and columns that the corners (4, 2) span, with `reach` px more."""
    height, width = shape
    left, top, right, bottom = corners[0, 0], corners[0, 1], corners[0, 0], corners[0, 1]
    for k in range(1, 4):
        left, right = min(left, corners[k, 0]), max(right, corners[k, 0])
        top, bottom = min(top, corners[k, 1]), max(bottom, corners[k, 1])
    return (
        max(math.floor(top - reach), 0),
        min(math.ceil(bottom + reach) + 1, height),
        max(math.floor(left - reach), 0),
        min(math.ceil(right + reach) + 1, width),
    )


@compiled
def _extremes(image: NDArray[np.uint8], box: tuple[int, int, int, int]) -> tuple[float, float]:
    """The darkest and the brightest grey level in a box."""
    darkest, brightest = 255, 0
    for y in range(box[0], box[1]):
        for x in range(box[2], box[3]):
            darkest = min(darkest, image[y, x])
            brightest = max(brightest, image[y, x])
    return float(darkest), float(brightest)


@compiled
def _gather(
    image: NDArray[np.uint8],
    rays: Array,
    G: Array,
    look: Array,
    m: int,
    box: tuple[int, int, int, int],
    most: int,
    places: Array,
) -> int:
    """Fills `places` (n, 7) with pixels near pattern edges: grey, ray, d ray / dx, d ray / dy; returns their number.

    Of more than `most`, a deterministic even sample is taken.
    """
    height, width = image.shape
    s00, s01, s11 = _covariance(look)
    share = 1.0
    count = 0
    for counting in (True, False):
        seen = 0
        # every third row estimates their number
        for y in range(box[0], box[1], 3 if counting else 1):
            for x in range(box[2], box[3]):
                # Roberts' R2 sequence is even along edges of any direction, where a lattice would miss some.
                if share < 1.0 and (x * 0.7548776662466927 + y * 0.5698402909980532) % 1.0 >= share:
                    continue
                rx = rays[y, x, 0]
                ry = rays[y, x, 1]
                w = 1.0 / (G[2, 0] * rx + G[2, 1] * ry + G[2, 2])
                u = (G[0, 0] * rx + G[0, 1] * ry + G[0, 2]) * w
                v = (G[1, 0] * rx + G[1, 1] * ry + G[1, 2]) * w
                # negated so that a pixel without a ray, NaN, is outside
                if not (w > 0 and u > -MARGIN and u < m + MARGIN and v > -MARGIN and v < m + MARGIN):
                    continue
                left, right = max(x - 1, 0), min(x + 1, width - 1)
                above, below = max(y - 1, 0), min(y + 1, height - 1)
                rxx = (rays[y, right, 0] - rays[y, left, 0]) / (right - left)
                ryx = (rays[y, right, 1] - rays[y, left, 1]) / (right - left)
                rxy = (rays[below, x, 0] - rays[above, x, 0]) / (below - above)
                ryy = (rays[below, x, 1] - rays[above, x, 1]) / (below - above)
                ux, uy, vx, vy = _slopes(G, u, v, w, rxx, ryx, rxy, ryy)
                near_u = REACH * math.sqrt(s00 * ux * ux + 2.0 * s01 * ux * uy + s11 * uy * uy)
                near_v = REACH * math.sqrt(s00 * vx * vx + 2.0 * s01 * vx * vy + s11 * vy * vy)
                edge_u = abs(u - min(max(math.floor(u + 0.5), 0), m))
                edge_v = abs(v - min(max(math.floor(v + 0.5), 0), m))
                if not (edge_u < near_u or edge_v < near_v):
                    continue
                seen += 1
                if not counting and count < len(places):
                    place = places[count]
                    place[0] = image[y, x]
                    place[1] = rx
                    place[2] = ry
                    place[3] = rxx
                    place[4] = ryx
                    place[5] = rxy
                    place[6] = ryy
                    count += 1
        if 3 * seen > most:
            share = most / (3 * seen)
    return count


@compiled
def _covariance(look: Array) -> tuple[float, float, float]:
    """xx, xy, yy of the blur, px^2."""
    a, c = math.exp(look[0]), math.exp(look[2])
    return a * a, look[1] * a, look[1] * look[1] + c * c


@compiled
def _slopes(
    G: Array, u: float, v: float, w: float, rxx: float, ryx: float, rxy: float, ryy: float
) -> tuple[float, float, float, float]:
    """du/dx, du/dy, dv/dx, dv/dy, in modules per px, where `w` is one over the homography's third row."""
    a0 = (G[0, 0] - u * G[2, 0]) * w
    a1 = (G[0, 1] - u * G[2, 1]) * w
    b0 = (G[1, 0] - v * G[2, 0]) * w
    b1 = (G[1, 1] - v * G[2, 1]) * w
    return a0 * rxx + a1 * ryx, a0 * rxy + a1 * ryy, b0 * rxx + b1 * ryx, b0 * rxy + b1 * ryy


@compiled
def _weigh(u: float, sigma: float, kurtosis: float, weights: Array) -> int:
    """Shares of four adjacent modules in a pixel at `u`, under a blur of `sigma` modules.

    Row 0 of `weights` (4, 4) has them, the others their derivatives by u, sigma and the kurtosis; returns the first
    module. A step from 0 to 1 is seen as the normal distribution function with the kurtosis term of Edgeworth's series,
    F(s) = Phi(s) - kurtosis / 24 (s^3 - 3 s) phi(s), and a module as the difference of two steps.
    """
    edge = math.floor(u + 0.5)
    before = (1.0, 0.0, 0.0, 0.0)
    for k in range(3):
        s = (u - (edge - 1 + k)) / sigma
        if s > 4.5:
            here = (1.0, 0.0, 0.0, 0.0)
        elif s < -4.5:
            here = (0.0, 0.0, 0.0, 0.0)
        else:
            square = s * s
            density = _DENSITY * math.exp(-0.5 * square)
            by_kurtosis = -s * (square - 3.0) * density / 24.0
            by_u = density / sigma * (1.0 + kurtosis * (square * square - 6.0 * square + 3.0) / 24.0)
            # Abramowitz and Stegun, 26.2.17: 1 - Phi(|s|) to 7.5e-8, from the density computed above
            t = 1.0 / (1.0 + 0.2316419 * abs(s))
            series = 1.781477937 + t * (-1.821255978 + t * 1.330274429)
            beyond = density * t * (0.319381530 + t * (-0.356563782 + t * series))
            share = 1.0 - beyond if s > 0 else beyond
            here = (share + kurtosis * by_kurtosis, by_u, -s * by_u, by_kurtosis)
        for row in range(4):
            weights[row, k] = before[row] - here[row]
        before = here
    for row in range(4):
        weights[row, 3] = before[row]
    return edge - 2


@compiled
def _accumulate(
    places: Array,
    pattern: NDArray[np.bool_],
    m: int,
    G: Array,
    look: Array,
    cut: float,
    free: bool,
    normal: Array,
    gradient: Array,
) -> tuple[float, float, float]:
    """Fills the normal equations; returns the robust loss, the weighted sum of squares and the sum of weights.

    While `free` is False only the homography, black and white may change.
    """
    for k in range(PARAMETERS):
        gradient[k] = 0.0
        for other in range(PARAMETERS):
            normal[k, other] = 0.0
    J = np.zeros(PARAMETERS)
    wu = np.empty((4, 4))
    wv = np.empty((4, 4))
    s00, s01, s11 = _covariance(look)
    a, b, c = math.exp(look[0]), look[1], math.exp(look[2])
    kurtosis, black, white = look[3], look[4], look[5]
    light = look[6:]
    loss = 0.0
    chi = 0.0
    total = 0.0
    for index in range(len(places)):
        place = places[index]
        w = 1.0 / (G[2, 0] * place[1] + G[2, 1] * place[2] + G[2, 2])
        u = (G[0, 0] * place[1] + G[0, 1] * place[2] + G[0, 2]) * w
        v = (G[1, 0] * place[1] + G[1, 1] * place[2] + G[1, 2]) * w
        if not (u > -RIM and u < m + RIM and v > -RIM and v < m + RIM):
            continue
        ux, uy, vx, vy = _slopes(G, u, v, w, place[3], place[4], place[5], place[6])
        sigma_u = math.sqrt(s00 * ux * ux + 2.0 * s01 * ux * uy + s11 * uy * uy)
        sigma_v = math.sqrt(s00 * vx * vx + 2.0 * s01 * vx * vy + s11 * vy * vy)
        # A tilted marker's blur is correlated in its own coordinates. Mehler's series: the product of two normal
        # distribution functions, plus their covariance times the mixed second derivative.
        askew = s00 * ux * vx + s01 * (ux * vy + uy * vx) + s11 * uy * vy
        first_u = _weigh(u, sigma_u, kurtosis, wu) + RIM
        first_v = _weigh(v, sigma_v, kurtosis, wv) + RIM
        white_share = 0.0  # of the pixel's area, and its derivatives
        by_u = 0.0
        by_v = 0.0
        by_uv = 0.0
        by_sigma_u = 0.0
        by_sigma_v = 0.0
        by_kurtosis = 0.0
        for j in range(4):
            row = min(max(first_v + j, 0), m + 2 * RIM - 1)
            white_0 = 0.0
            white_1 = 0.0
            white_2 = 0.0
            white_3 = 0.0
            for i in range(4):
                if pattern[row, min(max(first_u + i, 0), m + 2 * RIM - 1)]:
                    white_0 += wu[0, i]
                    white_1 += wu[1, i]
                    white_2 += wu[2, i]
                    white_3 += wu[3, i]
            white_share += white_0 * wv[0, j]
            by_uv += white_1 * wv[1, j]
            by_u += white_1 * wv[0, j]
            by_sigma_u += white_2 * wv[0, j]
            by_kurtosis += white_3 * wv[0, j] + white_0 * wv[3, j]
            by_v += white_0 * wv[1, j]
            by_sigma_v += white_0 * wv[2, j]
        white_share += askew * by_uv
        p = u / m - 0.5
        q = v / m - 0.5
        lit = 1.0 + light[0] * p + light[1] * q + light[2] * p * p + light[3] * p * q + light[4] * q * q
        grey = black + (white - black) * white_share
        residual = place[0] - grey * lit
        gain = (white - black) * lit
        by_u *= gain
        by_v *= gain
        by_uv *= gain
        both = by_u * p + by_v * q
        J[0] = by_u
        J[1] = by_u * p
        J[2] = by_u * q
        J[3] = by_v
        J[4] = by_v * p
        J[5] = by_v * q
        J[6] = both * p
        J[7] = both * q
        # d sigma / d covariance, by xx, xy and yy, and from there by a, b and c
        ku = gain * by_sigma_u * 0.5 / sigma_u
        kv = gain * by_sigma_v * 0.5 / sigma_v
        by_xx = ku * ux * ux + kv * vx * vx + by_uv * ux * vx
        by_xy = 2.0 * (ku * ux * uy + kv * vx * vy) + by_uv * (ux * vy + uy * vx)
        by_yy = ku * uy * uy + kv * vy * vy + by_uv * uy * vy
        J[8] = 2.0 * a * a * by_xx + a * b * by_xy
        J[9] = a * by_xy + 2.0 * b * by_yy
        J[10] = 2.0 * c * c * by_yy
        J[11] = gain * by_kurtosis
        J[12] = (1.0 - white_share) * lit
        J[13] = white_share * lit
        J[14] = grey * p
        J[15] = grey * q
        J[16] = grey * p * p
        J[17] = grey * p * q
        J[18] = grey * q * q
        size = abs(residual)
        weight = 1.0
        if size > cut:
            weight = cut / size
            loss += cut * (2.0 * size - cut)
        else:
            loss += size * size
        for k in range(PARAMETERS):
            weighted = weight * J[k]
            gradient[k] += weighted * residual
            for other in range(k + 1):
                normal[k, other] += weighted * J[other]
        chi += weight * residual * residual
        total += weight
    for k in range(PARAMETERS):
        for other in range(k):
            normal[other, k] = normal[k, other]
    _believe(look, max(chi / max(total - PARAMETERS, 1.0), 0.25), free, normal, gradient)
    return loss, chi, total


@compiled
def _believe(look: Array, variance: float, free: bool, normal: Array, gradient: Array) -> None:
    """Adds priors on the blur, its kurtosis and the light, which a tiny marker does not determine."""
    for k in range(8, PARAMETERS):
        if k in (12, 13):
            continue
        if not free:  # far from the optimum a wider blur explains any residual: hold it
            for other in range(PARAMETERS):
                normal[k, other] = normal[other, k] = 0.0
            normal[k, k] = 1.0
            gradient[k] = 0.0
            continue
        sd = 1.0 if k < 11 else 0.5 if k == 11 else 0.3 if k < 16 else 0.1
        believed = LOG_BLUR if k in (8, 10) else 0.0
        normal[k, k] += variance / (sd * sd)
        gradient[k] -= variance / (sd * sd) * (look[k - 8] - believed)


@compiled
def _copy(normal: Array, gradient: Array, other_normal: Array, other_gradient: Array) -> None:
    """Copies entry by entry: whole-array assignments take seconds to compile, for their error checks."""
    for i in range(PARAMETERS):
        other_gradient[i] = gradient[i]
        for j in range(PARAMETERS):
            other_normal[i, j] = normal[i, j]


@compiled
def _moved(G: Array, look: Array, step: Array, m: int) -> tuple[Array, Array, float]:
    """The homography and look after a step, and the largest change of the homography, modules.

    The change d acts on the pattern's coordinates: u grows by d0 + d1 p + d2 q + p (d6 p + d7 q) modules and v by d3 +
    d4 p + d5 q + q (d6 p + d7 q). A step over 0.7 modules is shortened, and so are large changes of the blur.
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
    moved = np.empty(11)
    for k in range(11):
        moved[k] = look[k] + step[8 + k]
    for k in range(3):
        moved[k] = look[k] + min(max(step[8 + k], -0.7), 0.7)
    moved[0] = min(max(moved[0], -2.0), 2.3)
    moved[2] = min(max(moved[2], -2.0), 2.3)
    moved[3] = min(max(moved[3], -1.2), 1.5)
    return back @ (change @ (centred @ G)), moved, largest


@compiled
def _solve(normal: Array, gradient: Array) -> bool:
    """Cholesky, in place: `normal` becomes its factor, `gradient` the solution. False: not positive definite."""
    n = len(gradient)
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

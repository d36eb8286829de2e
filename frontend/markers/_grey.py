"""The grey level of a pixel that sees a printed pattern, with its derivatives by all that is fitted, compiled.

The parameters are, in this order:

    0-7    the change of the homography, see `_alignment`
    8-9    the grey levels of black and white
    10-12  the blur: its covariance is L L' px^2 with L = [[exp(a), 0], [b, exp(c)]], whatever a, b, c
    13     the ink: how far black is grown at every edge, modules
    14     the tone: the logarithm of gamma, where a grey level is the light to the power of 1 / gamma
    15     the amount of sharpening
    16-20  how the light changes over the pattern: 1 + x p + y q + xx p^2 + xy p q + yy q^2
    21-23  the curl: the paper is in front of its plane by xx p^2 + xy p q + yy q^2, in sides of the pattern

All but the first eight are the `look`. p and q are the pattern's centred coordinates, u / m - 1/2 and v / m - 1/2,
where u and v count its m modules from the first corner. The homography is that of the plane that touches the paper in
the pattern's middle.

A camera that sharpens takes from every pixel a wider blur of the picture, and adds the difference. It does so after the
tone curve, which has by then moved every edge towards black: by as much the wider blur's edges are moved here, and its
own curve is straight, which is what a wide blur makes of it.
"""

import math

import numpy as np

from ...core.kernels._small import cross, dot
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._share import BY_INK, BY_SIGMA_U, BY_SIGMA_V, BY_U, BY_UV, BY_V, PAPER, RIM, VALUE, share

PARAMETERS, STIFF = 24, 10
"""All parameters, and the first of them, without the camera's, the printer's and the paper's."""

BLACK, WHITE, A, B, C, INK, TONE, SHARP, LIGHT, CURL = *range(9), 13
"""Where a look has them."""

SHARED = 17
"""Numbers that all pixels share."""

HALO = 1.2
"""px, standard deviation of the wider blur that sharpening takes off."""

BLACKEST = 2.0
"""Least grey level of black; the tone curve has no slope at none."""

SATURATED = 255.0

BUMP = 1 / math.sqrt(math.pi)
"""Integral of F (1 - F), where F is the normal distribution function."""


@compiled
def covariance(look: Array) -> tuple[float, float, float]:
    """xx, xy, yy of the blur, px^2."""
    a, c = math.exp(look[A]), math.exp(look[C])
    return a * a, look[B] * a, look[B] * look[B] + c * c


@compiled
def curve_of(look: Array, m: int, eye: Array, curve: Array) -> None:
    """Fills `curve` (SHARED,) with what all pixels share: the blur's xx, xy, yy, gamma, the logs of black and white.

    Then the light of black and of white, the bend, which is four times how far the curve is above a line in its middle,
    as a share of the contrast, and the bend's derivative by the tone. Then the light of black over its grey level, that
    of white over its, one over the modules `m` and one over gamma. Last the `eye` (3,), see `eye_of`.
    """
    curve[0], curve[1], curve[2] = covariance(look)
    gamma = math.exp(look[TONE])
    log_black, log_white = math.log(look[BLACK]), math.log(look[WHITE])
    dark, bright = math.exp(gamma * log_black), math.exp(gamma * log_white)
    middle = math.exp(math.log(0.5 * (dark + bright)) / gamma)
    curve[3], curve[4], curve[5], curve[6], curve[7] = gamma, log_black, log_white, dark, bright
    contrast = look[WHITE] - look[BLACK]
    curve[8] = 4.0 * (middle - look[BLACK]) / contrast - 2.0
    steeper = (dark * log_black + bright * log_white) / (dark + bright) - math.log(middle)
    curve[9] = 4.0 * middle * steeper / contrast
    curve[10], curve[11] = dark / look[BLACK], bright / look[WHITE]
    curve[12], curve[13] = 1.0 / m, 1.0 / gamma
    curve[14], curve[15], curve[16] = eye


@compiled
def eye_of(G: Array, m: int, other: Array) -> Array:
    """(3,) p and q of the camera's centre, and its height above the pattern's plane, in sides.

    By the homography's slope in the pattern's middle, which is well determined: a square at a distance d is 1 / d wide
    across the way that it leans and cos(lean) / d along it. On which of the two sides it is nearer is told by the
    `other` eye (3,), or, where that is zeros, by perspective: should it be wrong, so is the curl's sign, and its moves
    of edges are the same to first order.
    """
    # rays are multiples of a p + b q + c: by cross products of the centred homography's rows
    P, Q, W = np.empty(3), np.empty(3), G[2]
    for k in range(3):
        P[k], Q[k] = G[0, k] / m - 0.5 * W[k], G[1, k] / m - 0.5 * W[k]
    a, b, c = np.empty(3), np.empty(3), np.empty(3)
    cross(Q, W, a)
    cross(W, P, b)
    cross(P, Q, c)
    far = dot(c, c)
    ac, bc = dot(a, c) / far, dot(b, c) / far
    aa, bb, ab = dot(a, a) / far - ac * ac, dot(b, b) / far - bc * bc, dot(a, b) / far - ac * bc
    half, apart = 0.5 * (aa + bb), math.sqrt(0.25 * (aa - bb) ** 2 + ab * ab)
    widest, narrowest = half + apart, max(half - apart, 0.0)
    distance = 1.0 / math.sqrt(widest)
    eye = np.empty(3)
    eye[0] = distance * math.sqrt(max(1.0 - aa / widest, 0.0))
    eye[1] = distance * math.sqrt(max(1.0 - bb / widest, 0.0)) * (-1.0 if ab > 0.0 else 1.0)
    along = eye[0] * other[0] + eye[1] * other[1]
    if along < 0.0 or (along == 0.0 and eye[0] * ac + eye[1] * bc > 0.0):
        eye[0], eye[1] = -eye[0], -eye[1]
    eye[2] = distance * math.sqrt(narrowest / widest)
    return eye


@compiled
def unroll(p: float, q: float, xx: float, xy: float, yy: float, eye: Array, paper: Array) -> bool:
    """Fills `paper` (12,) with where a ray that meets the plane at p and q meets the curled paper; False: it does not.

    These are p and q along the unrolled paper, their derivatives by the plane's p and q, then those by xx, xy and yy:
    p by each, q by each. The `eye` (3,) is that of `eye_of`. At the share s of the way from the
    plane to the eye, e h high, the ray is s h high and over (p, q) + s (e - (p, q)): where that is the paper's height
    is a quadratic equation. A curled sheet of slope g is by g^2 / 3 longer to its height's foot than its shadow, along
    g: the arc of a parabola to third order.
    """
    to_p, to_q, height = eye[0] - p, eye[1] - q, eye[2]
    start = xx * p * p + xy * p * q + yy * q * q
    slope = height - ((2.0 * xx * p + xy * q) * to_p + (xy * p + 2.0 * yy * q) * to_q)
    square = xx * to_p * to_p + xy * to_p * to_q + yy * to_q * to_q
    root = slope * slope - 4.0 * start * square
    if not (slope > 0.0 and root > 0.0):
        return False
    root = math.sqrt(root)
    s = 2.0 * start / (slope + root)
    at_p, at_q = p + s * to_p, q + s * to_q
    gp, gq = 2.0 * xx * at_p + xy * at_q, xy * at_p + 2.0 * yy * at_q
    third = s * height / 3.0
    paper[0], paper[1] = at_p + gp * third, at_q + gq * third
    nearer = 1.0 - s
    paper[2], paper[3] = nearer * (1.0 + to_p * gp / root), nearer * to_p * gq / root
    paper[4], paper[5] = nearer * to_q * gp / root, nearer * (1.0 + to_q * gq / root)
    for k in range(3):
        base = at_p * at_p if k == 0 else (at_p * at_q if k == 1 else at_q * at_q)
        by_s = base / root
        by_p, by_q, by_third = by_s * to_p, by_s * to_q, by_s * height / 3.0
        more_p = (2.0 * at_p if k == 0 else (at_q if k == 1 else 0.0)) + 2.0 * xx * by_p + xy * by_q
        more_q = (2.0 * at_q if k == 2 else (at_p if k == 1 else 0.0)) + xy * by_p + 2.0 * yy * by_q
        paper[6 + k] = by_p + more_p * third + gp * by_third
        paper[9 + k] = by_q + more_q * third + gq * by_third
    return True


@compiled
def slopes(
    G: Array, u: float, v: float, w: float, rxx: float, ryx: float, rxy: float, ryy: float
) -> tuple[float, float, float, float]:
    """du/dx, du/dy, dv/dx, dv/dy, in modules per px, where `w` is one over the homography's third row."""
    a0 = (G[0, 0] - u * G[2, 0]) * w
    a1 = (G[0, 1] - u * G[2, 1]) * w
    b0 = (G[1, 0] - v * G[2, 0]) * w
    b1 = (G[1, 1] - v * G[2, 1]) * w
    return a0 * rxx + a1 * ryx, a0 * rxy + a1 * ryy, b0 * rxx + b1 * ryx, b0 * rxy + b1 * ryy


@compiled
def predict(
    place: Array,
    pattern: Array,
    G: Array,
    look: Array,
    curve: Array,
    whole: bool,
    table: Array,
    seen: Array,
    paper: Array,
    uv: Array,
    J: Array,
) -> float:
    """The grey level at a `place` (7,), and in `J` (24,) its derivatives; NaN outside the pattern and its rim.

    With `whole` False sharpening and curl are taken for 0 and have no derivatives. `table` (2, 3, 7), `seen` (2, 7) and
    `paper` (12,) are overwritten; `uv` (2,) gets the place on the paper.
    """
    m = len(pattern) - 2 * RIM
    w = 1.0 / (G[2, 0] * place[1] + G[2, 1] * place[2] + G[2, 2])
    u = (G[0, 0] * place[1] + G[0, 1] * place[2] + G[0, 2]) * w
    v = (G[1, 0] * place[1] + G[1, 1] * place[2] + G[1, 2]) * w
    if not (u > -PAPER and u < m + PAPER and v > -PAPER and v < m + PAPER):
        return np.nan
    ux, uy, vx, vy = slopes(G, u, v, w, place[3], place[4], place[5], place[6])
    p, q = u * curve[12] - 0.5, v * curve[12] - 0.5
    if whole:
        if not unroll(p, q, look[CURL], look[CURL + 1], look[CURL + 2], curve[14:], paper):
            return np.nan
        u, v = m * (paper[0] + 0.5), m * (paper[1] + 0.5)
        if not (u > -PAPER and u < m + PAPER and v > -PAPER and v < m + PAPER):
            return np.nan
    uv[0], uv[1] = u, v
    s00, s01, s11 = curve[0], curve[1], curve[2]
    black, white, ink = look[BLACK], look[WHITE], look[INK]
    log_black, log_white, dark, bright, bend = curve[4], curve[5], curve[6], curve[7], curve[8]
    sigma_u = math.sqrt(s00 * ux * ux + 2.0 * s01 * ux * uy + s11 * uy * uy)
    sigma_v = math.sqrt(s00 * vx * vx + 2.0 * s01 * vx * vy + s11 * vy * vy)
    askew = s00 * ux * vx + s01 * (ux * vy + uy * vx) + s11 * uy * vy
    near = seen[0]
    share(u, v, sigma_u, sigma_v, askew, ink, ink, pattern, table, near)
    # light of black and white, and of the pixel
    light = max(dark + (bright - dark) * near[VALUE], 0.05 * dark)
    log_light = math.log(light)
    grey = math.exp(log_light * curve[13])
    by_light = grey / light
    slope = by_light * curve[13]
    gain = slope * (bright - dark)
    by_black = by_light * (1.0 - near[VALUE]) * curve[10]
    by_white = by_light * near[VALUE] * curve[11]
    by_tone = (
        by_light * ((1.0 - near[VALUE]) * dark * log_black + near[VALUE] * bright * log_white)
        - grey * log_light * curve[13]
    )
    by_u, by_v, by_uv = gain * near[BY_U], gain * near[BY_V], gain * near[BY_UV]
    by_sigma_u, by_sigma_v = gain * near[BY_SIGMA_U], gain * near[BY_SIGMA_V]
    by_ink, by_sharp = gain * near[BY_INK], 0.0
    if whole:
        amount = look[SHARP]
        ring = HALO * HALO
        wide_u = math.sqrt(sigma_u * sigma_u + ring * (ux * ux + uy * uy))
        wide_v = math.sqrt(sigma_v * sigma_v + ring * (vx * vx + vy * vy))
        far = seen[1]
        share(u, v, wide_u, wide_v, askew + ring * (ux * vx + uy * vy), 0.0, 0.0, pattern, table, far)
        # its edges are so much blurred that they move in proportion
        shift = ink - bend * BUMP * 0.5 * (sigma_u + sigma_v)
        far[VALUE] += shift * far[BY_INK]
        straight = black + (white - black) * far[VALUE]
        by_sharp = grey - straight
        grey += amount * by_sharp
        more, less = 1.0 + amount, amount * (white - black)
        by_u = more * by_u - less * far[BY_U]
        by_v = more * by_v - less * far[BY_V]
        by_uv = more * by_uv - less * far[BY_UV]
        closer = 0.5 * bend * BUMP * far[BY_INK]
        by_sigma_u = more * by_sigma_u - less * (far[BY_SIGMA_U] * sigma_u / wide_u - closer)
        by_sigma_v = more * by_sigma_v - less * (far[BY_SIGMA_V] * sigma_v / wide_v - closer)
        by_ink = more * by_ink - less * far[BY_INK]
        by_black = more * by_black - amount * (1.0 - far[VALUE])
        by_white = more * by_white - amount * far[VALUE]
        by_tone = more * by_tone + less * curve[9] * BUMP * 0.5 * (sigma_u + sigma_v) * far[BY_INK]
    lit = 1.0 + look[8] * p + look[9] * q + look[10] * p * p + look[11] * p * q + look[12] * q * q
    by_u *= lit
    by_v *= lit
    for k in range(3):
        J[21 + k] = m * (by_u * paper[6 + k] + by_v * paper[9 + k]) if whole else 0.0
    if whole:
        by_u, by_v = by_u * paper[2] + by_v * paper[4], by_u * paper[3] + by_v * paper[5]
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
    ku = lit * by_sigma_u * 0.5 / sigma_u
    kv = lit * by_sigma_v * 0.5 / sigma_v
    by_uv *= lit
    by_xx = ku * ux * ux + kv * vx * vx + by_uv * ux * vx
    by_xy = 2.0 * (ku * ux * uy + kv * vx * vy) + by_uv * (ux * vy + uy * vx)
    by_yy = ku * uy * uy + kv * vy * vy + by_uv * uy * vy
    a = math.sqrt(s00)
    b = look[B]
    J[8] = lit * by_black
    J[9] = lit * by_white
    J[10] = 2.0 * a * a * by_xx + a * b * by_xy
    J[11] = a * by_xy + 2.0 * b * by_yy
    J[12] = 2.0 * (s11 - b * b) * by_yy
    J[13] = lit * by_ink
    J[14] = lit * by_tone
    J[15] = lit * by_sharp
    J[16] = grey * p
    J[17] = grey * q
    J[18] = grey * p * p
    J[19] = grey * p * q
    J[20] = grey * q * q
    return grey * lit

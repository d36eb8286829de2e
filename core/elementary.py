"""Elementary functions with the same bits on every machine.

numpy's sin, cos, arctan2, exp and the like choose code by the processor, and so does the C library, which has them with
and without fused multiply-add: last bits differ, and with them the digest of a log. The functions here use nothing but
addition, subtraction, multiplication, division and roots, which IEEE 754 rounds in one way, in an order that the source
fixes. Their errors are below one unit in the last place, those of arctan2 below 1.2.

Reductions and coefficients are those of fdlibm (Sun Microsystems, 1993), whose comments derive them.
"""

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)

BLOCK = 1 << 15
"""Numbers that are worked on at once: the dozen arrays in between then stay in the processor's cache."""

_FAR = 5e5  # rad; up to here multiples of pi/2 are subtracted with 118 bits of it

_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""pi/2 in pieces: the first two have 33 bits each, so that their multiples by up to 2^20 are exact."""

_SIN = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
_COS = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
_ATAN = (
    3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01, -1.11111104054623557880e-01,
    9.09088713343650656196e-02, -7.69187620504482999495e-02, 6.66107313738753120669e-02, -5.83357013379057348645e-02,
    4.97687799461593236017e-02, -3.65315727442169155270e-02, 1.62858201153657823623e-02,
)  # fmt: skip
_EXP = (
    1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05,
    -1.65339022054652515390e-06, 4.13813679705723846039e-08,
)  # fmt: skip

_NEAR, _MIDDLE = 0.4375, 0.6875
"""Largest tangents of angles used as they are, and as the sum of atan 1/2 and a rest; beyond, of pi/4 and a rest."""

_BASES = (
    (4.63647609000806093515e-01, 2.26987774529616870924e-17),
    (7.85398163397448278999e-01, 3.06161699786838301793e-17),
)
"""atan 1/2 and pi/4, each as the nearest double and its error."""

_PI_LOW = 1.22464679914735317720e-16  # pi minus its nearest double

_LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
"""In two pieces, the first of 32 bits."""


class SinCos(NamedTuple):
    """Sine and cosine of the same angles; scalars for a single one."""

    sin: Array
    cos: Array


def sincos(angle: ArrayLike) -> SinCos:
    """Sine and cosine of `angle` (rad) of any shape; NaN where it is not finite."""
    x = np.asarray(angle, np.float64)
    if not x.ndim:
        s, c = sincos_of_one(float(x))
        return SinCos(np.asarray(s)[()], np.asarray(c)[()])
    if x.size <= BLOCK:
        return _sincos(x)
    sine, cosine, angles = np.empty(x.shape), np.empty(x.shape), x.reshape(-1)
    for first in range(0, x.size, BLOCK):
        some = slice(first, first + BLOCK)
        sine.reshape(-1)[some], cosine.reshape(-1)[some] = _sincos(angles[some])
    return SinCos(sine, cosine)


def _sincos(x: Array) -> SinCos:
    with np.errstate(invalid="ignore"):
        far = np.abs(x) > _FAR
        if far.any():  # exact, and no further off than x itself may be by its rounding
            x = np.where(far, np.fmod(x, 2 * np.pi), x)
        turns = np.rint(x * (2 / np.pi)) + 0.0  # no negative zero
        rest, low = _reduced(x, turns)
        s, c, quarter = _sin(rest, low), _cos(rest, low), np.mod(turns, 4.0)
    odd = (quarter == 1.0) | (quarter == 3.0)
    sine, cosine = np.where(odd, c, s), np.where(odd, s, c)
    return SinCos(np.where(quarter >= 2.0, -sine, sine), np.where((quarter == 1.0) | (quarter == 2.0), -cosine, cosine))


def sincos_of_one(x: float) -> tuple[float, float]:
    """Sine and cosine of `x` (rad): the same bits without numpy's overhead for scalars."""
    if not math.isfinite(x):
        return math.nan, math.nan
    if abs(x) > _FAR:
        x = math.fmod(x, 2 * math.pi)
    turns = round(x * (2 / math.pi))
    rest, low = _reduced(x, float(turns))
    s, c = _sin(rest, low), _cos(rest, low)
    quarter = turns % 4
    if quarter == 0:
        return s, c
    return (c, -s) if quarter == 1 else (-s, -c) if quarter == 2 else (-c, s)


def sin(angle: ArrayLike) -> Array:
    """Sine of `angle` (rad)."""
    return sincos(angle).sin


def cos(angle: ArrayLike) -> Array:
    """Cosine of `angle` (rad)."""
    return sincos(angle).cos


def sinc(angle: ArrayLike) -> Array:
    """sin(angle) / angle, and 1 at 0; of radians, unlike numpy's."""
    x = np.asarray(angle, np.float64)
    zero = x == 0
    return np.where(zero, 1.0, sin(x) / np.where(zero, 1.0, x))[()]


def arctan2(y: ArrayLike, x: ArrayLike) -> Array:
    """The angle of the point (x, y), in [-pi, pi], with signed zeros as in C; NaN where not finite."""
    y, x = np.asarray(y, np.float64), np.asarray(x, np.float64)
    if not y.ndim and not x.ndim:
        return np.asarray(_arctan2_of_one(float(y), float(x)))[()]
    if max(y.size, x.size) <= BLOCK:
        return _arctan2(y, x)
    y, x = np.broadcast_arrays(y, x)
    angle, rise, run = np.empty(x.shape), y.reshape(-1), x.reshape(-1)
    for first in range(0, x.size, BLOCK):
        some = slice(first, first + BLOCK)
        angle.reshape(-1)[some] = _arctan2(rise[some], run[some])
    return angle


def _arctan2(y: Array, x: Array) -> Array:
    high, wide = np.abs(y), np.abs(x)
    least, most = np.minimum(high, wide), np.maximum(high, wide)
    most = np.where(most == 0, 1.0, most)
    with np.errstate(invalid="ignore", over="ignore"):
        near, middle = least < _NEAR * most, least < _MIDDLE * most
        # The angle is a small one, or atan 1/2 or pi/4 and a small one; rise and run are those of the small one.
        rise = np.where(near, least, np.where(middle, least - 0.5 * most, least - most))
        more = np.where(near, 0.0, np.where(middle, 0.5 * least, least))
        base, base_low = (np.where(near, 0.0, np.where(middle, *pieces)) for pieces in zip(*_BASES, strict=True))
        angle = _arctan(rise, most, more, base, base_low)
    steep = np.pi / 2 - (np.copysign(angle, x) - _PI_LOW / 2)
    flat = np.where(np.signbit(x), np.pi - (angle - _PI_LOW), angle)
    return np.copysign(np.where(high > wide, steep, flat), y)


def hypot(x: ArrayLike, y: ArrayLike) -> Array:
    """The length of (x, y), where the squares neither overflow nor underflow."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    return np.sqrt(x * x + y * y)[()]


def exp(power: ArrayLike) -> Array:
    """e to `power`, from -700 to 700."""
    x = np.asarray(power, np.float64)
    doublings = np.rint(x * (1.4426950408889634))
    high, low = x - doublings * _LN2[0], doublings * _LN2[1]
    rest = high - low
    square = rest * rest
    c = rest - square * _polynomial(square, _EXP)
    return np.ldexp(1 - ((low - rest * c / (2 - c)) - high), doublings.astype(np.int64))


def _arctan2_of_one(y: float, x: float) -> float:
    """The same bits for a single point."""
    high, wide = abs(y), abs(x)
    least, most = min(high, wide), max(high, wide)
    if not math.isfinite(high + wide):
        return math.nan
    most = most or 1.0
    if least < _NEAR * most:
        angle = _arctan(least, most, 0.0, 0.0, 0.0)
    elif least < _MIDDLE * most:
        angle = _arctan(least - 0.5 * most, most, 0.5 * least, *_BASES[0])
    else:
        angle = _arctan(least - most, most, least, *_BASES[1])
    if high > wide:
        angle = math.pi / 2 - (math.copysign(angle, x) - _PI_LOW / 2)
    elif math.copysign(1.0, x) < 0:
        angle = math.pi - (angle - _PI_LOW)
    return math.copysign(angle, y)


def _arctan(rise: Number, most: Number, more: Number, base: Number, base_low: Number) -> Number:
    """`base`, an angle in two pieces, plus the small angle whose tangent is `rise` / (`most` + `more`)."""
    run = most + more
    t = rise / run
    t_low = (_less_product(rise, t, run) - t * (more - (run - most))) / run
    square = t * t
    return base - (((t * (square * _polynomial(square, _ATAN)) - base_low) - t_low * (1 - square)) - t)


def _less_product(a: Number, b: Number, c: Number) -> Number:
    """a - b c, which is small, without rounding the product (Dekker, Numerische Mathematik 18, 1971)."""
    (b_high, b_low), (c_high, c_low) = _halves(b), _halves(c)
    return (((a - b_high * c_high) - b_high * c_low) - b_low * c_high) - b_low * c_low


def _halves(x: Number) -> tuple[Number, Number]:
    """Splits `x` into two numbers of 26 bits (Veltkamp)."""
    wide = 134217729.0 * x
    high = wide - (wide - x)
    return high, x - high


def _polynomial(x: Number, coefficients: tuple[float, ...]) -> Number:
    """Horner's rule; coefficients from the constant term on."""
    total: Any = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = coefficient + x * total
    return total


def _reduced(x: Number, turns: Number) -> tuple[Number, Number]:
    """`x` less a number of quarter turns, in [-pi/4, pi/4], as a double and its error."""
    first = x - turns * _HALF_PI[0]
    second = turns * _HALF_PI[1]
    rest = first - second
    third = turns * _HALF_PI[2] - ((first - rest) - second)
    result = rest - third
    return result, (rest - result) - third


def _sin(x: Number, low: Number) -> Number:
    square = x * x
    cube = square * x
    tail = _polynomial(square, _SIN[1:])
    return x - ((square * (0.5 * low - cube * tail) - low) - cube * _SIN[0])


def _cos(x: Number, low: Number) -> Number:
    square = x * x
    half = 0.5 * square
    most = 1 - half
    return most + (((1 - most) - half) + (square * (square * _polynomial(square, _COS)) - x * low))

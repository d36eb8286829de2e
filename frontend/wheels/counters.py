"""Wheel counters that wrap, reset or misread: unwrapped where their width is known, refused where it is not."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array

Flags = NDArray[np.bool_]

COUNTER_BITS = (8, 16, 32)  # widths of the counters in use
MAX_SPEED = 5.0  # m/s; upper limit of a robot's speed

WHEELS = ("left", "right")


def unwrap(counts: Array, bits: int) -> Array:
    """Unwraps `counts` (m, 2) of counters `bits` wide, signed or not.

    No wheel may have turned by half the counter's range between two readings.
    """
    span = 2.0**bits
    steps = np.diff(counts, axis=0)
    steps -= span * np.round(steps / span)
    return np.concatenate((counts[:1], counts[:1] + np.cumsum(steps, axis=0)))


def check_counts(
    t: Array, counts: Array, metres: Array, max_speed: float, source: str, wheels: Sequence[str] = WHEELS
) -> None:
    """Raises InputError for the first implausible of `counts` (m, w) of these `wheels` at `t` (m,), s.

    Implausible are a count that is not finite, a step larger than a wheel of `metres` (w,) per count makes at
    `max_speed`, m/s, and a smaller step that only a wrap or reset explains. As a stream's messages come in bursts, a
    wheel is allowed the time of a typical reading more, and one count.
    """
    for row, wheel in np.argwhere(~np.isfinite(counts)):
        found = f"the {wheels[wheel]} wheel's count is {counts[row, wheel]!s}"
        raise InputError(f"{source}: in reading {row}, at {t[row]} s, {found}, expected a finite number.")
    if len(t) < 2:
        return
    steps, dt = np.diff(counts, axis=0), np.diff(t)
    limit = max_speed * (dt + np.median(dt))[:, None] + np.abs(metres)
    fast = np.abs(steps * metres) > limit
    usual = np.array([np.median(moved) if len(moved := turned[turned > 0]) else 0.0 for turned in np.abs(steps).T])
    for row, wheel in np.argwhere(fast | _wraps(counts, steps, usual) | _resets(counts, steps, usual)):
        before, after = float(counts[row, wheel]), float(counts[row + 1, wheel])
        most = float(limit[row, wheel] / abs(metres[wheel]))
        way = abs((after - before) * metres[wheel])
        raise InputError(
            f"{source}: between readings {row} and {row + 1}, at {t[row]} and {t[row + 1]} s, the {wheels[wheel]} "
            f"wheel's count goes from {before:.0f} to {after:.0f}, {way:.4g} m in {dt[row]:.4g} s; "
            + _cause(before, after, most, max_speed, [bits for bits in COUNTER_BITS if _fit(counts[:, wheel], bits)])
        )


def _cause(before: float, after: float, most: float, max_speed: float, widths: Sequence[int]) -> str:
    """Explains a jump of a counter that may be `widths` wide and changes by at most `most` between two readings."""
    for bits in widths:
        if abs(abs(after - before) - 2.0**bits) <= most and abs(after - before) > 2.0 ** (bits - 1):
            return f"expected a steady count: if this counter of {bits} bits wrapped, set counter_bits = {bits}."
    if abs(after) <= most:
        return "expected a steady count: this looks like a reset, and the motion meanwhile is unknown."
    return f"expected at most max_speed = {max_speed:g} m/s: a misread count, or a wrong wheel size."


def _wraps(counts: Array, steps: Array, usual: Array) -> Flags:
    """(m - 1, w) where a small counter wrapped: within its width, a typical step modulo the range."""
    found = np.zeros(steps.shape, bool)
    for bits in COUNTER_BITS:
        span = 2.0**bits
        inside = np.array([_fit(column, bits) for column in counts.T])
        left_over = np.abs(np.abs(steps) - span)
        found |= inside & (np.abs(steps) > span / 2) & (left_over <= 3 * usual + 2) & (np.abs(steps) > 4 * left_over)
    return found


def _fit(counts: Array, bits: int) -> bool:
    """Tells if a counter `bits` wide, signed or not, can hold all of `counts` (m,)."""
    low, high = counts.min(), counts.max()
    return bool((low >= 0 and high < 2.0**bits) or (low >= -(2.0 ** (bits - 1)) and high < 2.0 ** (bits - 1)))


def _resets(counts: Array, steps: Array, usual: Array) -> Flags:
    """(m - 1, w) where all wheels' counters return to about zero, from much farther than a typical step."""
    jumps = (np.abs(counts[1:]) <= usual + 1) & (np.abs(steps) > 4 * (usual + 1))
    return np.broadcast_to(jumps.all(axis=1, keepdims=True), steps.shape)

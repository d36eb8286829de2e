"""Columns from whatever a user hands in: converted, checked for kind, and read-only."""

from typing import Any

import numpy as np

from .errors import InputError
from .se2 import Array, Ints

ROUNDING = 1e-9
"""Largest relative asymmetry of a covariance that counts as rounding."""


def numbers(name: str, values: Any) -> Array:
    """Converts `values` to floats; InputError names the argument."""
    try:
        found = np.asarray(values)
        if found.dtype.kind in "cmM":
            raise TypeError(f"they are of type {found.dtype}")
        return np.asarray(found, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: found {type(values).__name__}, expected an array of numbers ({error}).") from None


def seconds(name: str, values: Any) -> Array:
    """Converts times to s, those of numpy and pandas since 1970; InputError names the argument."""
    found = np.asarray(values)
    if found.dtype.kind not in "mM":
        return numbers(name, values)
    since = found - np.datetime64(0, "s") if found.dtype.kind == "M" else found
    return since / np.timedelta64(1, "s")


def whole(name: str, values: Any) -> Ints:
    """Converts `values` to integers; InputError names the argument."""
    found = np.asarray(values)
    if found.dtype.kind not in "iu":
        found = numbers(name, values)
        odd = np.flatnonzero(~((np.abs(found) < 2.0**63) & (found == np.rint(found))))
        if len(odd):
            raise InputError(f"{name}: row {odd[0]} is {found.flat[odd[0]]!s}, expected a whole number.")
    return found.astype(np.int64)


def sorted_ids(name: str, values: Any) -> Ints:
    """Converts `values` to ascending integers; InputError names the argument."""
    found = whole(name, values)
    back = np.flatnonzero(np.diff(found) < 0)
    if len(back):
        row = back[0] + 1
        raise InputError(f"{name}: row {row} is {found[row]} after {found[row - 1]}, expected them sorted.")
    return found


def even(cov: Array) -> Array:
    """Symmetrises `cov` (m, k, k) where the halves differ by rounding alone; others are left for `check`."""
    if cov.ndim != 3 or cov.shape[1] != cov.shape[2]:
        return cov
    other = cov.swapaxes(1, 2)
    if np.array_equal(cov, other, equal_nan=True):
        return cov
    variance = np.einsum("mii->mi", cov)
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.abs(variance[:, :, None] * variance[:, None, :]))
        return np.where(np.abs(cov - other) <= ROUNDING * scale, (cov + other) / 2, cov)


def frozen(values: Array) -> Array:
    """A read-only copy of numbers."""
    copy = np.array(values, np.float64)
    copy.flags.writeable = False
    return copy


def frozen_ids(values: Ints) -> Ints:
    """A read-only copy of integers."""
    copy = np.array(values, np.int64)
    copy.flags.writeable = False
    return copy


def numbered(t: Array) -> bool:
    """True if the times (n,) are the numbers of the steps."""
    return np.array_equal(t, np.arange(len(t)))


def length(t: Array) -> float | None:
    """The s from the first to the last of the times (n,); None for one step, or numbered steps."""
    return None if len(t) < 2 or numbered(t) else float(t[-1] - t[0])

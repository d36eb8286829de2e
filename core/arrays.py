"""Columns from whatever a user hands in: converted, checked for kind, and read-only."""

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np

from .errors import InputError
from .se2 import Array, Ints

Column = TypeVar("Column", Array, Ints)

BLOCK = 1 << 18
"""Rows that are worked on at once, where the arrays in between would take as much as a long log does."""

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
    return found.astype(np.int64, copy=False)


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
    if all(np.array_equal(cov[some], other[some], equal_nan=True) for some in slices(len(cov))):
        return cov
    variance = np.einsum("mii->mi", cov)
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.abs(variance[:, :, None] * variance[:, None, :]))
        return np.where(np.abs(cov - other) <= ROUNDING * scale, (cov + other) / 2, cov)


def frozen(values: Array) -> Array:
    """A read-only copy of numbers; they themselves if they are `read_only` already."""
    if _is_read_only(values, np.float64):
        return values
    copy = np.array(values, np.float64)
    copy.flags.writeable = False
    return copy


def frozen_ids(values: Ints) -> Ints:
    """A read-only copy of integers; they themselves if they are `read_only` already."""
    if _is_read_only(values, np.int64):
        return values
    copy = np.array(values, np.int64)
    copy.flags.writeable = False
    return copy


def read_only(values: Column) -> Column:
    """`values` themselves, an array that nobody else writes to, such that a log need not copy them."""
    values.flags.writeable = False
    return values


def _is_read_only(values: Any, kind: Any) -> bool:
    """True for an array of its own memory, of the type, that cannot be written to."""
    return (
        isinstance(values, np.ndarray) and values.base is None and values.dtype == kind and not values.flags.writeable
    )


def slices(rows: int) -> Iterator[slice]:
    """Yields slices of so many rows, BLOCK at most in each."""
    for first in range(0, rows, BLOCK):
        yield slice(first, min(first + BLOCK, rows))


def numbered(t: Array) -> bool:
    """True if the times (n,) are the numbers of the steps."""
    return np.array_equal(t, np.arange(len(t)))


def length(t: Array) -> float | None:
    """The s from the first to the last of the times (n,); None for one step, or numbered steps."""
    return None if len(t) < 2 or numbered(t) else float(t[-1] - t[0])

"""Digests of columns of numbers."""

import hashlib
from collections.abc import Mapping

import numpy as np

from ..se2 import Array, Ints


def digest_of(columns: Mapping[str, Array | Ints | None]) -> str:
    """sha256, in hexadecimal, of columns with their names, types and shapes."""
    total = hashlib.sha256()
    for name, column in columns.items():
        if column is None:
            total.update(f"{name} none\n".encode())
            continue
        little_endian = np.ascontiguousarray(column).astype(column.dtype.newbyteorder("<"), copy=False)
        total.update(f"{name} {little_endian.dtype.str} {little_endian.shape}\n".encode())
        total.update(little_endian.ravel().view(np.uint8).data)
    return total.hexdigest()

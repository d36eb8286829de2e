"""Signatures of sightings: a third number beside range and bearing, by which landmarks differ.

The survey's measurement is (range, bearing, signature), the third with a variance of its own, and a constant of each
landmark: a colour, a height, a brightness. It says nothing of where a landmark is, but which one it is.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import frozen, numbers
from .errors import InputError
from .se2 import Array


@dataclass(frozen=True, eq=False)
class Signatures:
    """The signatures of whole sightings, in their order: those of a log, or of one step."""

    s: Array  # (s,) in any unit
    var: Array  # (s,) its variance, in that unit squared

    @classmethod
    def from_arrays(cls, s: Array, var: Array) -> "Signatures":
        """Those of s sightings; the arrays are copied. InputError for values that are not numbers."""
        return cls(frozen(numbers("signature", s)), frozen(numbers("signature_var", var)))

    def __len__(self) -> int:
        return len(self.s)

    @property
    def columns(self) -> Mapping[str, Array]:
        """Both by name, for digests and archives."""
        return {"signatures.s": self.s, "signatures.var": self.var}

    def rows(self, kept: Any) -> "Signatures":
        """Those of the sightings `kept` alone: ascending indices, a mask, or a slice."""
        s, var = self.s[kept], self.var[kept]
        s.flags.writeable = var.flags.writeable = False
        return Signatures(s, var)


NO_SIGNATURES = Signatures(frozen(np.zeros(0)), frozen(np.zeros(0)))
"""Those of a step of a log without any."""


def signatures_of(s: Array | None, var: Array | None, sightings: int) -> Signatures | None:
    """The signatures of that many sightings; InputError if one column lacks, or for another length."""
    if s is None and var is None:
        return None
    if s is None or var is None:
        lacks, there = ("signature", "signature_var") if s is None else ("signature_var", "signature")
        raise InputError(f"{lacks}: found {there} alone, expected a signature and its variance for each sighting.")
    found = Signatures.from_arrays(s, var)
    for name, column in (("signature", found.s), ("signature_var", found.var)):
        if column.shape != (sightings,):
            raise InputError(f"{name}: found shape {column.shape}, expected ({sightings},), one for each sighting.")
    return found

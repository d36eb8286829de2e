"""Laser scans beside a log, for maps and pictures: no backend sees them, and they are no part of its digest."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .relations import Anchors
from .se2 import Array, Ints, act

Ranges = NDArray[np.float32]


class Scans(NamedTuple):
    """Scans at steps of a log and between them."""

    at: Anchors  # (k,) where they were taken
    ranges: Ranges  # (k, b) m; NaN where there is no return
    angles: Array  # (b,) rad, counter-clockwise from straight ahead of the scanner
    scanner: Array  # (3,) its pose on the robot

    def taken(self, rows: NDArray[np.bool] | Ints) -> "Scans":
        """Some of them."""
        return self._replace(at=self.at.taken(rows), ranges=self.ranges[rows])

    def points(self, k: int) -> Array:
        """The returns of scan k (m, 2), m, in the robot's frame, in the order of the beams."""
        ranges = self.ranges[k].astype(np.float64)
        return returns(ranges, self.angles, self.scanner, np.isfinite(ranges))


def returns(ranges: Array, angles: Array, scanner: Array, valid: NDArray[np.bool]) -> Array:
    """Those `ranges` (b,), m, that are `valid` (b,) as points (k, 2) in the robot's frame."""
    r, a = ranges[valid], angles[valid]
    return act(scanner, np.stack((r * np.cos(a), r * np.sin(a)), axis=-1))


COLUMNS = ("step", "since", "until", "share", "ranges", "angles", "scanner")
"""Names of their arrays in files."""


def scan_columns(scans: Scans) -> dict[str, NDArray[Any]]:
    """The arrays by name."""
    return dict(zip(COLUMNS, (*scans.at, *scans[1:]), strict=True))


def scans_from(columns: Mapping[str, NDArray[Any]]) -> Scans:
    """Restores what `scan_columns` gave."""
    *at, ranges, angles, scanner = (columns[name] for name in COLUMNS)
    return Scans(Anchors(*at), ranges, angles, scanner)


def misfit(columns: Mapping[str, NDArray[Any]], steps: int) -> str:
    """Says why the arrays are not scans of a log of so many steps, what was found and expected; "" if they are."""
    k, b = np.size(columns["step"]), np.size(columns["angles"])
    shapes = {"step": (k,), "since": (k, 3), "until": (k, 3), "share": (k,), "ranges": (k, b), "angles": (b,)}
    for name, shape in (shapes | {"scanner": (3,)}).items():
        found, kind = columns[name], "i" if name == "step" else "f"
        if found.shape != shape or found.dtype.kind != kind:
            expected = f"expected {'whole ' * (kind == 'i')}numbers of {shape}"
            return f"{name} is {found.dtype} of the shape {found.shape}, {expected}"
        if name != "ranges" and not np.isfinite(found).all():
            return f"{name} has what is not a number, expected finite ones"
    step = columns["step"]
    if not k or step.min() < 0 or step.max() >= steps:
        of = f"of the steps {step.min()} to {step.max()}" if k else "none"
        return f"its scans are {of}, expected some of the log's 0 to {steps - 1}"
    return ""

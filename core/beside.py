"""Measurements beside a log, for maps and pictures: no backend sees them, and they are no part of its digest.

A laser log has `Scans`, that of a depth camera `Clouds`. Both say where they were taken between the steps, so that
they can be drawn along any path of the steps, and both are kept in files and records as columns.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .relations import Anchors
from .se2 import Array, Ints, act

Ranges = NDArray[np.float32]
Columns = Mapping[str, NDArray[Any]]
Form = tuple[tuple[int, ...], str]
"""Shape of an array, and the kind of its numbers as numpy has it, with their bytes or any: i, u1 or f."""


class Beams(NamedTuple):
    """The points that a sensor saw from one pose, in the robot's frame there."""

    starts: Array  # (m, 2) m
    ends: Array  # (m, 2) m
    reflected: NDArray[np.bool]  # (m,) the beam hit something at its end


class Scans(NamedTuple):
    """Scans at steps of a log and between them."""

    at: Anchors  # (k,) where they were taken
    ranges: Ranges  # (k, b) m; NaN where there is no return
    angles: Array  # (b,) rad, counter-clockwise from straight ahead of the scanner; (k, b) where they vary
    scanner: Array  # (3,) its pose on the robot

    def taken(self, rows: NDArray[np.bool] | Ints) -> "Scans":
        """Some of them."""
        angles = self.angles[rows] if self.angles.ndim == 2 else self.angles
        return self._replace(at=self.at.taken(rows), ranges=self.ranges[rows], angles=angles)

    def points(self, k: int) -> Array:
        """The returns of scan k (m, 2), m, in the robot's frame, in the order of the beams."""
        ranges = self.ranges[k].astype(np.float64)
        angles = self.angles[k] if self.angles.ndim == 2 else self.angles
        return returns(ranges, angles, self.scanner, np.isfinite(ranges))

    def beams(self, k: int) -> Beams:
        """The beams of scan k that returned, from the scanner on."""
        points = self.points(k)
        return Beams(np.tile(self.scanner[:2], (len(points), 1)), points, np.ones(len(points), np.bool_))

    @staticmethod
    def forms(columns: Columns) -> dict[str, Form]:
        """The expected forms of its arrays that are not those of `Anchors`."""
        k, angles = np.size(columns["step"]), columns["angles"]
        b = np.shape(angles)[-1] if np.ndim(angles) else 0
        return {
            "ranges": ((k, b), "f"),
            "angles": ((k, b) if np.ndim(angles) == 2 else (b,), "f"),
            "scanner": ((3,), "f"),
        }

    @staticmethod
    def problem(columns: Columns) -> str:  # noqa: ARG004 - any arrays of these forms are scans
        """Says what is wrong with arrays of the right forms; "" for nothing."""
        return ""


UNIT = 0.005  # m; the coordinates of a cloud's points are whole multiples of it


class Clouds(NamedTuple):
    """Coloured points of a depth camera at steps of a log, levelled, in the robot's frame on the floor."""

    at: Anchors  # (k,) where they were taken
    first: Ints  # (k + 1,) the points of cloud k are first[k] to first[k + 1]
    points: NDArray[np.int16]  # (n, 3) UNIT: ahead, left, and up from the floor
    colours: NDArray[np.uint8]  # (n, 3) red, green, blue
    camera: Array  # (3,) m, the camera's place on the robot

    def taken(self, rows: NDArray[np.bool]) -> "Clouds":
        """Some of them."""
        counts = np.diff(self.first)
        points = np.repeat(rows, counts)
        first = np.concatenate(([0], np.cumsum(counts[rows])))
        return Clouds(self.at.taken(rows), first, self.points[points], self.colours[points], self.camera)

    def xyz(self, k: int) -> Array:
        """The points of cloud k (m, 3), m."""
        return UNIT * self.points[self.first[k] : self.first[k + 1]].astype(np.float64)

    def rgb(self, k: int) -> NDArray[np.uint8]:
        """Their colours (m, 3)."""
        return self.colours[self.first[k] : self.first[k + 1]]

    @staticmethod
    def forms(columns: Columns) -> dict[str, Form]:
        """The expected forms of its arrays that are not those of `Anchors`."""
        k, n = np.size(columns["step"]), len(columns["points"]) if columns["points"].ndim else 0
        return {"first": ((k + 1,), "i"), "points": ((n, 3), "i"), "colours": ((n, 3), "u1"), "camera": ((3,), "f")}

    @staticmethod
    def problem(columns: Columns) -> str:
        """Says what is wrong with arrays of the right forms; "" for nothing."""
        first, n = columns["first"], len(columns["points"])
        if first[0] != 0 or first[-1] != n or (np.diff(first) < 0).any():
            return f"first goes from {first[0]} to {first[-1]}, expected a row that rises from 0 to its {n} points"
        return ""


KINDS: Mapping[str, type[Scans] | type[Clouds]] = {"scans": Scans, "clouds": Clouds}
"""The kinds by the field of a log that has them."""

_MAY_BE_NAN = ("ranges",)
_NUMBERS = {"i": "whole numbers", "u1": "whole numbers of a byte", "f": "numbers"}


def returns(ranges: Array, angles: Array, scanner: Array, valid: NDArray[np.bool]) -> Array:
    """Those `ranges` (b,), m, that are `valid` (b,) as points (k, 2) in the robot's frame."""
    r, a = ranges[valid], angles[valid]
    return act(scanner, np.stack((r * np.cos(a), r * np.sin(a)), axis=-1))


Beside = TypeVar("Beside", Scans, Clouds)


def head_of(beside: Beside | None, steps: int) -> Beside | None:
    """Those at a log's first `steps` steps and up to the next one; None for none."""
    if beside is None or not (rows := beside.at.step < steps).any():
        return None
    return beside.taken(rows)._replace(at=beside.at.head(steps))


def names(kind: str) -> tuple[str, ...]:
    """The names of the arrays of a kind in files."""
    return (*Anchors._fields, *KINDS[kind]._fields[1:])


def columns_of(kind: str, beside: Scans | Clouds) -> dict[str, NDArray[Any]]:
    """The arrays by name."""
    return dict(zip(names(kind), (*beside.at, *beside[1:]), strict=True))


def restored(kind: str, columns: Columns) -> Any:
    """The scans or clouds that `columns_of` took apart."""
    at, own = Anchors._fields, KINDS[kind]._fields[1:]
    return KINDS[kind](Anchors(*(columns[name] for name in at)), *(columns[name] for name in own))


def misfit(kind: str, columns: Columns, steps: int) -> str:
    """Says why arrays are not of a log of so many steps, what was found and expected; "" if they are."""
    k = np.size(columns["step"])
    forms: dict[str, Form] = {"step": ((k,), "i"), "since": ((k, 3), "f"), "until": ((k, 3), "f"), "share": ((k,), "f")}
    for name, (shape, type_) in (forms | KINDS[kind].forms(columns)).items():
        found = columns[name]
        if found.shape != shape or not f"{found.dtype.kind}{found.dtype.itemsize}".startswith(type_):
            return f"{name} is {found.dtype} of the shape {found.shape}, expected {_NUMBERS[type_]} of {shape}"
        if name not in _MAY_BE_NAN and not np.isfinite(found).all():
            return f"{name} has what is not a number, expected finite ones"
    step = columns["step"]
    if not k or step.min() < 0 or step.max() >= steps:
        of = f"of the steps {step.min()} to {step.max()}" if k else "none"
        return f"its {kind} are {of}, expected some of the log's 0 to {steps - 1}"
    return KINDS[kind].problem(columns)

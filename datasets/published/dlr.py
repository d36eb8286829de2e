"""The DLR spatial cognition log: a wheeled robot with a camera among paper circles on the floor of an office building.

J. Kurlbaum and U. Frese, "A benchmark data set for data association", report 017-02/2009 of SFB/TR 8, University of
Bremen and DLR. The file map.circles documents its own rows:

    STEP image dX dY dPhi cXX cXY cYY cXPhi cYPhi cPhiPhi      a motion, and the image taken after it
    LANDMARK_C pX pY quality cXX cXY cYY ID ...                a circle in that image, in the robot's coordinates

The robot's frame there has -Y forward and X to the right. Seen from above that is a left-handed frame, in which Phi,
from X to Y, grows clockwise; so in ours, x forward and y left,

    x = -Y,   y = -X,   theta = -Phi,

which exchanges the X and Y entries of a covariance and keeps all its signs. A motion is "the location of the robot
after movement in the coordinate system of the robot before moving", and its covariance is that of these numbers: in the
frame before the motion, as ours. (The data confirm it: an error of the heading along a motion (dX, dY) moves its end
along (-dY, dX), and (cXPhi, cYPhi) points there, to 0.01 rad in the median. After the motion it would be off by dPhi.)

An id of -1 is an unidentified circle. One that "has multiple IDs" may be any of them: it is UNKNOWN too.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.coordinates import as_range_bearing
from ...core.csv_values import shortened
from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset, Log, Prior
from ...core.options import option
from ...core.se2 import Array, Ints
from ...core.small_matrices import symmetric
from ..hidden_ids import HiddenIds
from ..registry import Source
from .catalogue import fetched
from .stepwise import FLOORED, FileRow, definite, read_rows

FILE = "map.circles"

_MOTION = ("dX", "dY", "dPhi", "cXX", "cXY", "cYY", "cXPhi", "cYPhi", "cPhiPhi")
_CIRCLE = ("pX", "pY", "quality", "cXX", "cXY", "cYY")
_FRAME = re.compile(r"([0-9]{1,15})(\.[A-Za-z]+)?$")

_NEAREST = 1e-3
"""m. The bearing of a circle nearer to the robot's centre is undefined."""


@dataclass(frozen=True)
class Options(HiddenIds):
    """The location of the log."""

    path: str | None = option(None, f"the file {FILE} or its folder; not given: the copy from bench fetch dlr")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """DLR: a real robot among circles on the floor, 3,297 steps, 14,745 sightings of 576 circles, no ground truth."""
    return read(Path(options.path) if options.path else fetched("dlr", f"dlr[path={FILE}]"))


source = Source(make, Options)


def read(path: Path) -> Dataset:
    """Reads the log in the file `path`, or in that folder's map.circles; InputError names the line of a fault.

    There is no ground truth. The world is the robot's frame at the first image, fixed by the prior's 1e-9 I, and the
    motion before it is left out: nothing was seen earlier.
    """
    path = path / FILE if path.is_dir() else path
    steps, circles, step = _rows(path)
    delta, delta_cov, floored = _motions(steps)
    z, z_cov, quality, raised = _sightings(circles)
    ids, several = _identities(circles)
    kept = _once(step, ids, quality)
    log = Log.from_arrays(
        "dlr",
        Prior(np.zeros(3), 1e-9 * np.eye(3)),
        t=np.arange(len(steps), dtype=float),
        delta=delta,
        delta_cov=delta_cov,
        sighting_step=step[kept],
        ids=ids[kept],
        z=z[kept],
        z_cov=z_cov[kept],
        notes=_notes(
            unknown={"sightings": int((ids == UNKNOWN).sum()), "of these, with several ids": several},
            dropped={"a circle's second sighting in a step, of less quality": len(ids) - len(kept)},
            floored={"motions": floored, "sightings": raised},
        ),
    )
    return Dataset(log, None)


def _rows(path: Path) -> tuple[list[FileRow], list[FileRow], Ints]:
    """The rows of steps, those of circles, and the step of each circle, (s,)."""
    steps, circles, step = list[FileRow](), list[FileRow](), list[int]()
    for row in read_rows(path):
        if row.word == "STEP" and row.cells:
            _check_image(row, steps)
            steps.append(row)
        elif row.word in ("LANDMARK_C", "LANDMARK") and len(row.cells) > len(_CIRCLE):
            if not steps:
                raise row.fault("a sighting before the first STEP, expected it after")
            circles.append(row)
            step.append(len(steps) - 1)
        else:
            wanted = f"STEP, an image and {len(_MOTION)} numbers, or LANDMARK_C, {len(_CIRCLE)} numbers and an id"
            raise row.fault(f"found {shortened(row.word)} and {len(row.cells)} fields, expected {wanted}")
    if not steps:
        raise InputError(f"{path}: found no STEP rows, expected at least one.")
    return steps, circles, np.array(step, np.int64)


def _check_image(row: FileRow, before: list[FileRow]) -> None:
    """Raises InputError unless the image's number follows the last one's: no motion is missing."""
    found = _FRAME.search(row.cells[0])
    if found is None:
        raise row.fault(f"the image is {shortened(row.cells[0])}, expected a name that ends with its number")
    last = _FRAME.search(before[-1].cells[0]) if before else None
    if last and int(found[1]) != int(last[1]) + 1:
        raise row.fault(f"the image has number {int(found[1])}, expected {int(last[1]) + 1}, the next")


def _motions(steps: list[FileRow]) -> tuple[Array, Array, int]:
    """(n, 3) and (n, 3, 3) in our frame, before the motion, and the number of covariances with a floor."""
    table = np.array([row.numbers(_MOTION, row.cells[1:]) for row in steps])
    for k in np.flatnonzero(np.abs(table[:, 2]) > np.pi):
        raise steps[k].fault(f"dPhi is {table[k, 2]!s}, expected radians from -pi to pi")
    dx, dy, dphi, xx, xy, yy, xphi, yphi, phiphi = table.T
    cov, singular = definite(symmetric(np.stack((yy, xy, yphi, xx, xphi, phiphi), axis=-1)), steps)
    return np.stack((-dy, -dx, -dphi), axis=-1), cov, singular


def _sightings(circles: list[FileRow]) -> tuple[Array, Array, Array, int]:
    """Ranges and bearings (s, 2), covariances (s, 2, 2), qualities (s,), and the number of covariances with a floor."""
    table = np.array([row.numbers(_CIRCLE, row.cells[: len(_CIRCLE)]) for row in circles]).reshape(-1, len(_CIRCLE))
    px, py, quality, xx, xy, yy = table.T
    for k in np.flatnonzero((quality < 0) | (quality > 1)):
        raise circles[k].fault(f"quality is {quality[k]!s}, expected 0 to 1")
    for k in np.flatnonzero(hypot(px, py) < _NEAREST):
        raise circles[k].fault(f"the circle is at {px[k]!s}, {py[k]!s}, expected at least {_NEAREST} m away")
    cov, singular = definite(symmetric(np.stack((yy, xy, xx), axis=-1)), circles)
    return *as_range_bearing(np.stack((-py, -px), axis=-1), cov), quality, singular


def _identities(circles: list[FileRow]) -> tuple[Ints, int]:
    """(s,) the id of each circle, and the number of those that are UNKNOWN for having several."""
    named = [[row.identity(cell, UNKNOWN) for cell in row.cells[len(_CIRCLE) :]] for row in circles]
    ids = [names[0] if len(names) == 1 else UNKNOWN for names in named]
    return np.array(ids, np.int64), sum(len(names) > 1 for names in named)


def _once(step: Ints, ids: Ints, quality: Array) -> Ints:
    """The rows to keep, in order: of a circle named repeatedly in a step, the one of the best quality."""
    rank = np.lexsort((-quality, ids, step))  # stable: of equals, the first row
    again = (np.diff(step[rank]) == 0) & (np.diff(ids[rank]) == 0) & (ids[rank[1:]] != UNKNOWN)
    return np.setdiff1d(np.arange(len(ids)), rank[1:][again])


def _notes(**counts: dict[str, int]) -> dict[str, Any]:
    return {
        "source": "DLR spatial cognition, map.circles; Kurlbaum and Frese, SFB/TR 8 report 017-02/2009, Bremen and DLR",
        "licence": "none stated with the file",
        "time": "the file has none: t is the number of the step",
        "frame": "the file's, -Y forward and X right, converted to x forward and y left",
        "covariances": f"the file's, of motions in the frame before the motion; {FLOORED}",
        "sightings": "x, y with their covariance in the file; range and bearing by first-order propagation",
        "start": "the world is the robot's frame at the first image; the motion before it is left out",
        **counts,
    }

"""The Victoria Park log, from the copy in the gtsam wheel: a car with a laser scanner among the trees of a Sydney park.

J. E. Guivant and E. M. Nebot, "Optimization of the simultaneous localization and map-building algorithm for real-time
implementation", IEEE Trans. Robotics and Automation 17(3), 2001; prepared as relative motions and tree sightings with
known ids for iSAM (M. Kaess et al., 2008), in the form

    ODOMETRY i j dx dy dtheta cov(xx xy xt yy yt tt)        pose j from pose i
    LANDMARK i l x y cov(xx xy yy)                          tree l in the body frame of pose i

Pose and tree ids share one name space, so pose ids skip. The file has no times.
"""

from pathlib import Path

import numpy as np

from ..frontend.errors import InputError
from ..frontend.factors import Dataset, Log, Prior
from ..frontend.options import NoOptions
from ..frontend.se2 import Array
from ..frontend.table import symmetric, text
from .registry import Source

_COLUMNS = {"ODOMETRY": 11, "LANDMARK": 7}

_NOTES = {
    "source": "victoria_park.txt as shipped with GTSAM; Guivant and Nebot, University of Sydney, 2001",
    "licence": "none stated for the recording; GTSAM's copy is distributed under GTSAM's BSD licence",
    "time": "the file has none: t is the number of the step",
    "sightings": "x, y with their covariance in the file; range and bearing by first-order propagation",
}


def read(path: Path) -> Dataset:
    """The log in the file `path`; InputError, with its line, for a row that cannot be used. There is no truth."""
    odometry, landmarks = _rows(path)
    before, after = odometry[:, 0], odometry[:, 1]
    for k in np.flatnonzero(before[1:] != after[:-1]) + 1:
        raise _fault(path, odometry[k], f"the motion starts at pose {before[k]:.0f}, expected {after[k - 1]:.0f}")

    poses = np.concatenate((before[:1], after))
    order = np.argsort(poses)
    place = np.minimum(np.searchsorted(poses, landmarks[:, 0], sorter=order), len(poses) - 1)
    step = order[place]
    for k in np.flatnonzero(poses[step] != landmarks[:, 0]):
        raise _fault(path, landmarks[k], f"a sighting from pose {landmarks[k, 0]:.0f}, expected one that is moved to")
    landmarks, step = landmarks[np.argsort(step, kind="stable")], np.sort(step)

    first = np.full((1, 3), np.nan)
    z, z_cov = range_bearing(landmarks[:, 2:4], symmetric(landmarks[:, 4:7]))
    log = Log.from_arrays(
        "victoria-park",
        Prior(np.zeros(3), 1e-9 * np.eye(3)),
        t=np.arange(len(poses), dtype=float),
        delta=np.concatenate((first, odometry[:, 2:5])),
        delta_cov=np.concatenate((first[:, None] * first[..., None], _before_motion(odometry))),
        sighting_step=step,
        ids=landmarks[:, 1].astype(np.int64),
        z=z,
        z_cov=z_cov,
        notes=_NOTES,
    )
    return Dataset(log, None)


def range_bearing(xy: Array, cov: Array) -> tuple[Array, Array]:
    """Points `xy` (s, 2) of the body frame, with `cov` (s, 2, 2), as range and bearing: (s, 2), and (s, 2, 2).

    First order: C' = J C J' with J = [[x/r, y/r], [-y/r^2, x/r^2]].
    """
    x, y = xy.T
    r = np.hypot(x, y)
    xx, xy_, yy = cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]
    rr = (x * x * xx + 2 * x * y * xy_ + y * y * yy) / r**2
    rb = (x * y * (yy - xx) + (x * x - y * y) * xy_) / r**3
    bb = (y * y * xx - 2 * x * y * xy_ + x * x * yy) / r**4
    return np.stack((r, np.arctan2(y, x)), axis=-1), np.stack((rr, rb, rb, bb), axis=-1).reshape(-1, 2, 2)


def _before_motion(odometry: Array) -> Array:
    """(m, 3, 3) in the frame before the motion; GTSAM, and the file with it, has them in the frame after."""
    c, s = np.cos(odometry[:, 4]), np.sin(odometry[:, 4])
    xx, xy, xt, yy, yt, tt = odometry[:, 5:11].T
    return symmetric(
        np.stack(
            (
                c * c * xx - 2 * c * s * xy + s * s * yy,
                c * s * (xx - yy) + (c * c - s * s) * xy,
                c * xt - s * yt,
                s * s * xx + 2 * c * s * xy + c * c * yy,
                s * xt + c * yt,
                tt,
            ),
            axis=-1,
        )
    )


def _rows(path: Path) -> tuple[Array, Array]:
    """The ODOMETRY rows (m, 12) and LANDMARK rows (s, 8), each followed by the number of its line."""
    rows: dict[str, list[list[float]]] = {kind: [] for kind in _COLUMNS}
    for number, line in enumerate(text(path).splitlines(), start=1):
        kind, *fields = line.split() or [""]
        if len(fields) != _COLUMNS.get(kind):
            wanted = "ODOMETRY and 11 numbers or LANDMARK and 7"
            raise _fault(path, [number], f"found {kind!r} and {len(fields)} fields, expected {wanted}")
        try:
            rows[kind].append([*map(float, fields), number])
        except ValueError as error:
            raise _fault(path, [number], f"{error}, expected numbers after {kind}") from None
    if not rows["ODOMETRY"]:
        raise InputError(f"{path}: there is no ODOMETRY row, expected at least one.")
    return np.array(rows["ODOMETRY"]), np.array(rows["LANDMARK"]).reshape(-1, 8)


def _fault(path: Path, row: Array | list[int], message: str) -> InputError:
    """The error that says `message` of a row that ends with the number of its line."""
    return InputError(f"{path}, line {row[-1]:.0f}: {message}.")


def make(options: NoOptions, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - the same log for everybody
    """Victoria Park: a real car among trees, 6,969 steps, 3,640 sightings of 151 known trees, no truth."""
    import gtsam

    return read(Path(gtsam.findExampleDataFile("victoria_park.txt")))


source = Source(make)

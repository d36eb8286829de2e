"""The Robot Mapping course's simulated log: nine landmarks of known position, sighted along an unknown path.

C. Stachniss, "Robot Mapping", University of Freiburg, WS 2013/14, the exercise on EKF SLAM. A folder holds

    sensor_data.dat     ODOMETRY rot1 trans rot2       turn, go straight, turn
                        SENSOR id range bearing        a sighting at the end of that motion
    world.dat           id x y                         the landmarks' positions

The robot starts at the world's origin. The first row is a motion, so the first sightings are from the pose after it:
that pose is step 0, its motion and its covariance are the prior.

The files do not state the noise. The course's filters add diag(0.1, 0.1, 0.01) m^2 and rad^2 to the covariance of the
pose in the world, after every motion of 0.1 m, and assume 0.01 m^2 and rad^2 for sightings; `motion=course` and
`bearing_sd=0.1` are that (the same in every direction of the plane, so the same in the world and in the body). Those
settings are the exercise's and not the simulation's: at the batch optimum with the landmarks fixed at their true
positions, ranges scatter by 0.1 m, but bearings by 0.05 rad, and the motions by a hundredth or less of the stated
noise. The default is therefore a variance of the turns and of the distance, with rounded maximum-likelihood
coefficients from all sightings given the true landmarks, the path integrated out. With it chi2 at the batch optimum is
0.95 of its 2,406 degrees of freedom, and the map 0.055 m off, NEES 0.93 of one; with the course's settings 0.37, 0.30 m
and 1.01.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.csv_values import shortened
from ...core.elementary import sincos
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ...core.small_matrices import propagated
from ...core.table import LARGEST, read_spaced
from ..hidden_ids import HiddenIds
from ..registry import Source
from .catalogue import fetched
from .stepwise import FLOORED, FileRow, definite, read_rows

_MOTION = ("rot1", "trans", "rot2")
_SENSOR = ("id", "range", "bearing")

START = 1e-9  # the variance of the origin, m^2 and rad^2: the course starts with zero
COURSE = (0.1, 0.1, 0.01)  # the course's variances of (x, y, heading) per motion, m^2 and rad^2

NEAREST = 1e-3
"""m. Replaces a range that noise has made zero or negative: a range has to be more than 0."""

_UNLIKELY = 5.0  # standard deviations below zero at which a range is an error rather than noise


@dataclass(frozen=True)
class Options(HiddenIds):
    """Location of the log, and its noise."""

    path: str | None = option(None, "folder with sensor_data.dat and world.dat; not given: the copy from bench fetch")
    motion: str = option("turns", "the motion's noise: of its turns, or as in the course", choices=("turns", "course"))
    alpha1: float = option(1e-5, "variance of a turn, per its square (motion=turns)", minimum=0.0)
    alpha2: float = option(3e-5, "variance of a turn, rad^2 per squared metre driven", minimum=0.0)
    alpha3: float = option(1e-5, "variance of the distance, per its square", minimum=0.0)
    alpha4: float = option(1e-5, "variance of the distance, m^2 per squared radian turned", minimum=0.0)
    range_sd: float = option(0.1, "standard deviation of ranges, m", minimum=1e-6)
    bearing_sd: float = option(0.05, "standard deviation of bearings, rad", minimum=1e-6)


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Freiburg: the Robot Mapping course's simulation, 331 steps, 1,212 sightings of 9 landmarks of known position."""
    return read(Path(options.path) if options.path else fetched("freiburg", "freiburg[path=FOLDER]"), options)


source = Source(make, Options)


def read(folder: Path, options: Options) -> Dataset:
    """Reads the log in `folder`, and its landmarks as ground truth; InputError names the file and line of a fault."""
    path = folder / "sensor_data.dat"
    motions, sightings, step = _rows(path)
    turns = np.array([row.numbers(_MOTION, row.cells) for row in motions])
    for k in np.flatnonzero(np.abs(turns[:, [0, 2]]).max(axis=1) > np.pi):
        raise motions[k].fault(f"it turns by {turns[k, 0]!s} and {turns[k, 2]!s}, expected radians from -pi to pi")
    delta, by_turns = relative(turns)
    if options.motion == "course":
        cov = np.broadcast_to(np.diag(COURSE), (len(delta), 3, 3))
    else:
        cov = propagated(by_turns, turns_cov(turns, options))
    delta_cov, floored = definite((cov + cov.swapaxes(1, 2)) / 2, motions)

    ids, z, lifted = _sightings(sightings, step, options)
    landmarks = _world(folder / "world.dat")
    for k in np.flatnonzero(~np.isin(ids, landmarks.ids)):
        raise sightings[k].fault(f"landmark {ids[k]} is not in world.dat")
    log = Log.from_arrays(
        "freiburg",
        Prior(delta[0], delta_cov[0] + START * np.eye(3)),
        t=np.arange(len(delta), dtype=float),
        delta=delta,
        delta_cov=delta_cov,
        sighting_step=step,
        ids=ids,
        z=z,
        z_cov=np.broadcast_to(np.diag([options.range_sd**2, options.bearing_sd**2]), (len(ids), 2, 2)),
        notes=_notes(options, lifted, floored),
    )
    return Dataset(log, Truth(np.zeros(0), np.zeros((0, 3)), landmarks, None, "truth"))


def relative(turns: Array) -> tuple[Array, Array]:
    """Converts `turns` (m, 3), each (rot1, trans, rot2), to motions (dx, dy, dtheta), (m, 3), and Jacobians (m, 3, 3).

    dx = trans cos rot1, dy = trans sin rot1, dtheta = rot1 + rot2: in the body frame before the motion.
    """
    first, way, second = turns.T
    s, c = sincos(first)
    jacobian = np.zeros((len(turns), 3, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -way * s, c
    jacobian[:, 1, 0], jacobian[:, 1, 1] = way * c, s
    jacobian[:, 2, 0] = jacobian[:, 2, 2] = 1.0
    return np.stack((way * c, way * s, wrap(first + second)), axis=-1), jacobian


def turns_cov(turns: Array, options: Options) -> Array:
    """(m, 3, 3), diagonal: the variances of `turns` (m, 3), each (rot1, trans, rot2).

    Thrun, Burgard and Fox, Probabilistic Robotics, table 5.6: rot_i: alpha1 rot_i^2 + alpha2 trans^2; trans: alpha3
    trans^2 + alpha4 (rot1^2 + rot2^2).
    """
    first, way, second = np.square(turns).T
    turn, slip = options.alpha1, options.alpha2 * way
    columns = (turn * first + slip, options.alpha3 * way + options.alpha4 * (first + second), turn * second + slip)
    return np.stack(columns, axis=-1)[:, :, None] * np.eye(3)


def _rows(path: Path) -> tuple[list[FileRow], list[FileRow], Ints]:
    """The rows of motions, those of sightings, and the step of each of these, (s,)."""
    motions, sightings, step = list[FileRow](), list[FileRow](), list[int]()
    for row in read_rows(path):
        if row.word == "ODOMETRY":
            motions.append(row)
        elif row.word != "SENSOR":
            raise row.fault(
                f"found {shortened(row.word)}, expected ODOMETRY {' '.join(_MOTION)} or SENSOR {' '.join(_SENSOR)}"
            )
        elif not motions:
            raise row.fault("a sighting before the first ODOMETRY, expected it after")
        else:
            sightings.append(row)
            step.append(len(motions) - 1)
    if not motions:
        raise InputError(f"{path}: found no ODOMETRY rows, expected at least one.")
    return motions, sightings, np.array(step, np.int64)


def _sightings(rows: list[FileRow], step: Ints, options: Options) -> tuple[Ints, Array, int]:
    """Ids (s,), ranges and bearings (s, 2), and the number of ranges set to NEAREST."""
    for row in rows:
        row.check_count(_SENSOR, row.cells)
    z = np.array([row.numbers(_SENSOR[1:], row.cells[1:]) for row in rows]).reshape(-1, 2)
    ids = np.array([row.identity(row.cells[0], 0) for row in rows], np.int64)
    seen = set[tuple[int, int]]()
    for row, key in zip(rows, zip(step.tolist(), ids.tolist(), strict=True), strict=True):
        if key in seen:
            raise row.fault(f"landmark {key[1]} occurs twice after one motion, expected once")
        seen.add(key)
    least = -_UNLIKELY * options.range_sd
    for k in np.flatnonzero(z[:, 0] < least):
        raise rows[k].fault(f"range is {z[k, 0]!s}, expected more than 0, or at least {least:g} if that is noise")
    for k in np.flatnonzero(np.abs(z[:, 1]) > 2 * np.pi):
        raise rows[k].fault(f"bearing is {z[k, 1]!s}, expected radians of at most a full turn")
    lifted = z[:, 0] < NEAREST
    return ids, np.stack((np.where(lifted, NEAREST, z[:, 0]), wrap(z[:, 1])), axis=-1), int(lifted.sum())


def _world(path: Path) -> Map:
    """The landmarks in the file `path`."""
    table = read_spaced(path, ("id", "x", "y")).finite()
    ids = table.whole("id")
    _, first = np.unique(ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(ids)), first):
        raise table.fault(row, f"landmark {ids[row]} occurs twice, expected once")
    for row in np.flatnonzero(ids < 0):
        raise table.fault(row, f"id is {ids[row]}, expected 0 or more")
    return Map(ids, table.bounded(-LARGEST, LARGEST, "x", "y").rows[:, 1:], None)


def _notes(options: Options, lifted: int, floored: int) -> dict[str, Any]:
    settings = asdict(options)
    del settings["path"], settings["ids"]
    return {
        "source": "Robot Mapping course, EKF SLAM exercise; C. Stachniss, University of Freiburg, WS 2013/14",
        "licence": "none stated with the files",
        "time": "the file has none: t is the number of the motion",
        "covariances": f"none in the file: settings, of motions in the frame before the motion; {FLOORED}",
        "start": "the world's origin; the motion to step 0 is the prior",
        "truth": "the landmarks' positions; the path is unknown",
        "settings": settings,
        "lifted": {f"ranges that noise took below {NEAREST:g} m, set to it": lifted},
        "floored": {"motions": floored},
    }

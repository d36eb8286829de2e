"""The Victoria Park log as it was recorded: tree detections without ids, the car's speed and steering, and GPS.

J. E. Guivant and E. M. Nebot, "Optimization of the simultaneous localization and map-building algorithm for real-time
implementation", IEEE Trans. Robotics and Automation 17(3), 2001. A folder holds

    inputs.dat          t speed steering              m/s of the rear left wheel, rad; each held until the next
    measurements.dat    t range bearing diameter      of a trunk's centre, m and rad, straight ahead being pi / 2
    gps.dat             t x y                         m, with dead spots, and jumps of some metres among the trees

each perhaps packed, as inputs.dat.gz. The detections are from the laser's scans by Guivant's detector, whose ranges are
those of the trunks' centres; people, cars and poles are among them.

The body's frame is the laser's. The antenna is taken to be there, too: with an offset of a metre ahead or back, dead
reckoning through curves of 25 s fits GPS less well. Every scan with a detection is a step. The files have no
covariances: those of the factors follow from the options. A steering error that lasts is taken as white noise with the
same effect over a longer time. Dead reckoning is 71 m from GPS in the median, and 48 or 78 m with a tenth of a degree
more or less of steering.

With `gps_every`, a fix of GPS every so many seconds is a measurement, at the first scan then that has one; the truth is
GPS at the other scans. The receiver's errors last and jump by metres among the trees, so they are no white noise.

GPS has no heading: the true one is its course, over a second before and after, which the car keeps while it stands.
"""

from dataclasses import asdict, dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from ...core.elementary import sincos
from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset, Log, Prior, Truth
from ...core.fixes import FixTable
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ...core.table import Table, read_spaced
from ...frontend.wheels.encoder import Floors, compose, roll
from ..courses import GAP, courses
from ..on_demand.fixes import due
from ..registry import Source
from .catalogue import fetched

LENGTH, HALF_AXLE = 2.83, 0.76
"""m, wheel base, and from the middle of the rear axle to the wheel whose speed is measured."""

AHEAD, LEFT = 3.78, 0.5  # m, of the laser from the middle of the rear axle
LASTING = 1.0  # s that a steering error lasts
STANDING = 0.01  # m/s; a slower car stands
HOLE = 1.0  # s; longest time without a reading of speed and steering, which come every 0.025 s
START_SD = 1e-3  # m and rad, of the prior, which fixes the world's frame to that of GPS
COURSE_SD = 0.1  # rad, of a course of GPS, as those of 2.5 s apart and the odometry between them tell
TENTH = 10  # of so many detections one is left out
_LATEST, _FARTHEST, _FASTEST = 1e6, 1e5, 50.0  # s, m and m/s; the log lasts half an hour


@dataclass(frozen=True)
class Options:
    """Location of the log, and its noise."""

    path: str | None = option(None, "folder with the three files; not given: the copy from bench fetch")
    range_sd: float = option(0.3, "standard deviation of ranges, m", minimum=1e-6)
    bearing_sd: float = option(0.0175, "standard deviation of bearings, rad", minimum=1e-6)
    forward: float = option(0.2, "motion noise along the body, m per root second", minimum=1e-6)
    lateral: float = option(0.2, "motion noise across the body, m per root second", minimum=1e-6)
    turn: float = option(0.0175, "noise of the turn, rad per root second", minimum=1e-6)
    steering: float = option(0.035, "error of the steering angle, rad, which lasts a second", minimum=0.0)
    rest: float = option(0.05, "share of the motion noise while the car stands", minimum=1e-6)
    gps_every: float = option(0.0, "time between positions by GPS in the log, s; 0: none", minimum=0.0, maximum=1e6)
    gps_sd: float = option(
        2.0, "standard deviation of x and y of these, m", minimum=1e-3, maximum=1e3, beside="gps_every"
    )
    left_out: int = option(
        0,
        "leave out every tenth detection, from the first to the tenth on: ten logs of one drive",
        minimum=0,
        maximum=10,
    )


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Victoria Park as recorded: 7,230 scans, 52,974 detections without ids, clutter among them; GPS is the truth."""
    given = "victoria-park-raw[path=FOLDER]"
    return read(Path(options.path) if options.path else fetched("victoria-park-raw", given), options)


source = Source(make, Options)


def read(folder: Path, options: Options) -> Dataset:
    """Reads the log and ground truth in `folder`; InputError names the file and line of a fault."""
    inputs, seen, gps = _inputs(folder), _measurements(folder), _gps(folder)
    t, step = np.unique(seen.column("t"), return_inverse=True)
    _check_driven(inputs, seen)
    delta, delta_cov = _motions(t, inputs, options)
    poses, known = courses(gps.rows, t)
    kept = np.arange(len(step)) % TENTH != options.left_out - 1 if options.left_out else slice(None)
    step, z = step[kept], np.stack((seen.column("range"), wrap(seen.column("bearing") - pi / 2)), axis=-1)[kept]
    fixed = np.flatnonzero(known)[due(t[known], options.gps_every)]
    log = Log.from_arrays(
        "victoria-park-raw",
        _start(poses[0], options),
        t,
        delta,
        delta_cov,
        sighting_step=step,
        ids=np.full(len(step), UNKNOWN),
        z=z,
        z_cov=np.broadcast_to(np.diag([options.range_sd**2, options.bearing_sd**2]), (len(step), 2, 2)),
        fixes=_fixes(len(t), fixed, poses, options.gps_sd),
        notes=_notes(options),
    )
    known[fixed] = False
    return Dataset(log, Truth(t[known], poses[known], words="GPS"))


def _start(pose: Array, options: Options) -> Prior:
    """The first position and course of GPS, which are the world's frame, or, among its fixes, no better than these."""
    sds = (options.gps_sd, options.gps_sd, COURSE_SD) if options.gps_every else (START_SD,) * 3
    return Prior(pose, np.diag(np.square(sds)))


def _fixes(steps: int, step: Ints, poses: Array, sd: float) -> FixTable:
    """The positions of the poses (n, 3) at those steps."""
    z, cov = poses[step].copy(), np.full((len(step), 3, 3), np.nan)
    z[:, 2] = np.nan
    cov[:, :2, :2] = sd**2 * np.eye(2)
    return FixTable.from_arrays(steps, step, z, cov)


def _inputs(folder: Path) -> Table:
    table = _timed(folder, "inputs.dat", ("t", "speed", "steering"))
    table.bounded(-_FASTEST, _FASTEST, "speed").bounded(-pi / 3, pi / 3, "steering")
    t = table.column("t")
    for row in np.flatnonzero(np.diff(t) > HOLE) + 1:
        raise table.fault(
            row, f"t is {t[row]!s} after {t[row - 1]!s}, expected no more than {HOLE:g} s between readings"
        )
    return table


def _measurements(folder: Path) -> Table:
    table = _timed(folder, "measurements.dat", ("t", "range", "bearing", "diameter"))
    for row in np.flatnonzero(table.column("range") <= 0):
        raise table.fault(row, f"range is {table.column('range')[row]!s}, expected more than 0")
    return table.bounded(0.0, _FARTHEST, "range", "diameter").bounded(-pi / 2, 3 * pi / 2, "bearing")


def _gps(folder: Path) -> Table:
    table = _timed(folder, "gps.dat", ("t", "x", "y")).bounded(-_FARTHEST, _FARTHEST, "x", "y")
    t = table.column("t")
    for row in np.flatnonzero(np.diff(t) == 0) + 1:
        raise table.fault(row, f"t is {t[row]!s} twice, expected one fix at a time")
    return table


def _timed(folder: Path, name: str, columns: tuple[str, ...]) -> Table:
    """The rows of the file, sorted by time, at least one."""
    path = folder / name
    packed = folder / f"{name}.gz"
    table = read_spaced(packed if packed.exists() and not path.exists() else path, columns).finite()
    if not len(table.rows):
        raise InputError(f"{table.path}: found no rows, expected the columns {' '.join(columns)}.")
    t = table.bounded(0.0, _LATEST, "t").column("t")
    for row in np.flatnonzero(np.diff(t) < 0) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected no earlier than {t[row - 1]!s}")
    return table


def _check_driven(inputs: Table, seen: Table) -> None:
    """Raises InputError for a scan at a time of which speed and steering are not known."""
    t, driven = seen.column("t"), inputs.column("t")
    for row in np.flatnonzero((t < driven[0] - HOLE) | (t > driven[-1] + HOLE)):
        found = f"t is {t[row]!s}, and {inputs.path.name} is from {driven[0]!s} to {driven[-1]!s} s"
        raise seen.fault(row, f"{found}, expected scans within that time")


def _motions(t: Array, inputs: Table, options: Options) -> tuple[Array, Array]:
    """(n, 3) and (n, 3, 3): the laser's motion up to each step and its covariance; row 0 is not used.

    With w the turning rate and v the speed of the middle of the axle, the laser moves at v - w LEFT ahead and w AHEAD
    to the left: Guivant's model, here along exact arcs.
    """
    read, speed, steering = inputs.rows.T
    edges = np.union1d(t, read[(read > t[0]) & (read < t[-1])])
    held = np.maximum(np.searchsorted(read, edges[:-1], side="right") - 1, 0)
    dt, (s, c) = np.diff(edges), sincos(steering[held])
    inside = 1 - s / c * HALF_AXLE / LENGTH  # the measured wheel's speed over that of the axle
    v = speed[held] / inside
    pieces, _ = roll(np.stack((v * dt, v * s / c / LENGTH * dt), axis=-1), "arc")
    sn, cs = sincos(pieces[:, 2])
    pieces[:, 0] += (cs - 1) * AHEAD - sn * LEFT
    pieces[:, 1] += sn * AHEAD + (cs - 1) * LEFT
    share = np.where(np.abs(speed[held]) < STANDING, options.rest, 1.0)
    faster = v / inside * HALF_AXLE / LENGTH / c**2  # m/s per rad of steering
    turning = v / LENGTH / c**2 + s / c / LENGTH * faster
    by_steering = np.stack(
        (faster - turning * (sn * AHEAD + cs * LEFT), turning * (cs * AHEAD - sn * LEFT), turning), -1
    )
    lasting = LASTING * options.steering**2 * by_steering[:, :, None] * by_steering[:, None, :]
    white = np.diag(np.square([options.forward, options.lateral, options.turn]))
    cov = (share**2 * dt)[:, None, None] * (white + lasting)
    delta, delta_cov = np.zeros((len(t), 3)), np.zeros((len(t), 3, 3))
    first = np.searchsorted(edges, t)
    for k in range(1, len(t)):
        between = slice(first[k - 1], first[k])
        delta[k], delta_cov[k] = compose(pieces[between], cov[between], Floors(0.0, 0.0))
    return delta, delta_cov


def _notes(options: Options) -> dict[str, Any]:
    settings = asdict(options)
    del settings["path"]
    return {
        "source": "Victoria Park, University of Sydney; Guivant and Nebot, 2001; detections as in RFS-SLAM's copy",
        "licence": "none stated with the recording; the copy is under RFS-SLAM's New BSD licence",
        "truth": f"GPS, interpolated between fixes up to {GAP} s apart; the heading is its course",
        "covariances": "none in the files; made of the settings, the motion's in the body frame before it",
        "settings": settings,
    }

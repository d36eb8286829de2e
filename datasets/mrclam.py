"""The UTIAS Multi-Robot Cooperative Localization and Mapping logs, one robot of them at a time.

K. Y. K. Leung, Y. Halpern, T. D. Barfoot and H. H. T. Liu, "The UTIAS multi-robot cooperative localization and mapping
dataset", International Journal of Robotics Research 30(8):969-974, 2011. A folder holds for every robot n

    Robot<n>_Odometry.dat       t v omega             commanded, each held until the next
    Robot<n>_Measurement.dat    t barcode range bearing
    Robot<n>_Groundtruth.dat    t x y theta           Vicon, about 100 Hz, with gaps
    Barcodes.dat                subject barcode       subjects 1-5 are the robots, 6-20 the landmarks
    Landmark_Groundtruth.dat    subject x y sd sd

The log spans the time for which odometry and truth both exist, and starts at the true pose. Keyframes are the times of
the landmark sightings and every full second between; the motion up to each is one factor.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frontend.encoder import Floors, compose, roll
from ..frontend.errors import InputError
from ..frontend.factors import Dataset, Log, Map, Prior, Truth
from ..frontend.options import option
from ..frontend.se2 import Array, Ints, wrap
from ..frontend.table import Table, read_spaced
from .registry import Source

Flags = NDArray[np.bool_]

LAST_ROBOT = 5
"""Subjects up to this one are robots."""

GAP = 0.15
"""s. Between truth samples further apart than this, steps have no truth; they usually are 0.01 to 0.03 s apart."""

START_SD = 1e-3
"""The prior's standard deviation in x and y (m) and heading (rad): about what the Vicon system resolves."""


@dataclass(frozen=True)
class Options:
    """Which log, and one set of noise settings for all robots; the defaults are rounded from sets 6 and 7."""

    path: str | None = option(None, "the folder of an MRCLAM dataset")
    robot: int = option(1, "whose log, 1 to 5", minimum=1, maximum=LAST_ROBOT)
    range_sd: float = option(0.15, "standard deviation of ranges, m", minimum=1e-6)
    bearing_sd: float = option(0.03, "standard deviation of bearings, rad", minimum=1e-6)
    forward: float = option(0.05, "motion noise along the body, m per root second", minimum=1e-6)
    lateral: float = option(0.01, "motion noise across the body, m per root second", minimum=1e-6)
    turn: float = option(0.1, "noise of the turn, rad per root second", minimum=1e-6)
    rest: float = option(0.05, "share of the motion noise that is left where the command is to stand", minimum=1e-6)


class Sightings(NamedTuple):
    """A robot's sightings of landmarks, sorted by time, and how many others were left out, by reason."""

    t: Array  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    dropped: dict[str, int]


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - a file is the same for everybody
    """UTIAS MRCLAM: a small robot among barcodes, commanded speeds, Vicon truth: mrclam[path=FOLDER,robot=1]."""
    if options.path is None:
        found = "option path of dataset mrclam is not given"
        raise InputError(f"{found}, expected the folder of an MRCLAM dataset: mrclam[path=FOLDER].")
    return read(Path(options.path), options)


source = Source(make, Options)


def read(folder: Path, options: Options) -> Dataset:
    """The log and truth of one robot; InputError names the file and line of what cannot be used."""
    robot = folder / f"Robot{options.robot}"
    odometry = _timed(Path(f"{robot}_Odometry.dat"), ("t", "v", "omega"))
    truth = _timed(Path(f"{robot}_Groundtruth.dat"), ("t", "x", "y", "theta"))
    start, end = _span(odometry, truth)
    seen = _sightings(folder, Path(f"{robot}_Measurement.dat"), start, end)

    t = np.union1d(np.arange(np.floor(round(end - start, 6)) + 1), seen.t)
    delta, delta_cov = _motions(t, _since(odometry, start), odometry.rows[:, 1:], options)
    poses, known = _interpolated(truth, start, t)
    noise = np.diag([options.range_sd**2, options.bearing_sd**2])
    log = Log.from_arrays(
        f"mrclam-robot-{options.robot}",
        Prior(poses[0], START_SD**2 * np.eye(3)),
        t,
        delta,
        delta_cov,
        sighting_step=np.searchsorted(t, seen.t),
        ids=seen.ids,
        z=seen.z,
        z_cov=np.broadcast_to(noise, (len(seen.ids), 2, 2)),
        notes=_notes(folder, options, start, seen.dropped),
    )
    places = read_spaced(folder / "Landmark_Groundtruth.dat", ("subject", "x", "y", "x_sd", "y_sd")).finite()
    landmarks = Map(places.whole("subject"), places.rows[:, 1:3], None)
    return Dataset(log, Truth(t[known], poses[known], landmarks, None, "truth"))


def _timed(path: Path, columns: tuple[str, ...]) -> Table:
    """The rows of `path`, of which there are some, sorted by time; equal times occur."""
    table = read_spaced(path, columns).finite()
    if not len(table.rows):
        raise InputError(f"{path}: there is no row, expected the columns {' '.join(columns)}.")
    t = table.column("t")
    for row in np.flatnonzero(np.diff(t) < 0) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected no earlier than {t[row - 1]!s}")
    return table


def _since(table: Table, start: float) -> Array:
    """(r,) seconds since `start`, to the microsecond: what doubles that count from 1970 can tell apart."""
    return np.round(table.column("t") - start, 6).astype(float)


def _span(odometry: Table, truth: Table) -> tuple[float, float]:
    """When the log starts, at a command for which there is a truth, and when either of the two ends."""
    t = odometry.column("t")
    tracked = np.flatnonzero(_tracked(truth.column("t"), t))
    if not len(tracked):
        raise InputError(f"{odometry.path}: no command falls into the time of {truth.path.name}.")
    return float(t[tracked[0]]), float(min(t[-1], truth.rows[-1, 0]))


def _tracked(samples: Array, t: Array) -> Flags:
    """(n,) whether there is truth at `t`, given the times of its samples."""
    after = np.clip(np.searchsorted(samples, t), 1, max(len(samples) - 1, 1))
    near = np.diff(samples, append=np.inf)[after - 1] <= GAP
    return (samples[0] <= t) & (t <= samples[-1]) & (near | np.isin(t, samples))


def _interpolated(truth: Table, start: float, t: Array) -> tuple[Array, Flags]:
    """Poses (n, 3) at `t` (n,), headings interpolated on the circle, and whether they are known, (n,)."""
    samples, (x, y, heading) = _since(truth, start), truth.rows[:, 1:].T
    places = [np.interp(t, samples, column) for column in (x, y, np.unwrap(heading))]
    places[2] = wrap(places[2])
    return np.stack(places, axis=-1), _tracked(samples, t)


def _motions(t: Array, commanded: Array, velocities: Array, options: Options) -> tuple[Array, Array]:
    """(n, 3) and (n, 3, 3): the motion up to each keyframe, along exact arcs, and its covariance; row 0 is not used."""
    inside = commanded[(commanded > t[0]) & (commanded < t[-1])]
    edges = np.union1d(t, inside)
    dt = np.diff(edges)
    v, omega = velocities[np.searchsorted(commanded, edges[:-1], side="right") - 1].T
    pieces, _ = roll(np.stack((v * dt, omega * dt), axis=-1), "arc")
    share = np.where((v == 0) & (omega == 0), options.rest, 1.0)
    variance = np.square([options.forward, options.lateral, options.turn])
    cov = (share**2 * dt)[:, None, None] * np.diag(variance)
    delta, delta_cov = np.zeros((len(t), 3)), np.zeros((len(t), 3, 3))
    first = np.searchsorted(edges, t)
    for k in range(1, len(t)):
        between = slice(first[k - 1], first[k])
        delta[k], delta_cov[k] = compose(pieces[between], cov[between], Floors(0.0, 0.0))
    return delta, delta_cov


def _sightings(folder: Path, path: Path, start: float, end: float) -> Sightings:
    """What of `path` are landmarks, sighted from `start` to `end`, each once at a time."""
    barcodes = read_spaced(folder / "Barcodes.dat", ("subject", "barcode")).finite()
    names = dict(zip(barcodes.whole("barcode").tolist(), barcodes.whole("subject").tolist(), strict=True))
    table = _timed(path, ("t", "barcode", "range", "bearing"))
    for row in np.flatnonzero(table.column("range") <= 0):
        raise table.fault(row, f"range is {table.column('range')[row]!s}, expected more than 0")
    for row in np.flatnonzero(np.abs(table.column("bearing")) > np.pi):
        raise table.fault(row, f"bearing is {table.column('bearing')[row]!s}, expected radians from -pi to pi")

    t = _since(table, start)
    ids = np.array([names.get(code, 0) for code in table.whole("barcode").tolist()], np.int64)
    outside = (table.column("t") < start) | (table.column("t") > end)
    robot, unknown = (ids > 0) & (ids <= LAST_ROBOT), ids <= 0
    kept = np.flatnonzero(~(outside | robot | unknown))
    _, first = np.unique(np.stack((t[kept], ids[kept])), axis=1, return_index=True)
    once = kept[np.sort(first)]
    dropped = {
        "of another robot": int(np.sum(robot & ~outside)),
        "with an unknown barcode": int(np.sum(unknown & ~outside)),
        "outside the log's time": int(np.sum(outside)),
        "repeated at one time": len(kept) - len(once),
    }
    return Sightings(t[once], ids[once], table.rows[once, 2:], dropped)


def _notes(folder: Path, options: Options, start: float, dropped: dict[str, int]) -> dict[str, Any]:
    settings = asdict(options)
    del settings["path"]
    return {
        "source": f"UTIAS MRCLAM, {folder.name}; Leung, Halpern, Barfoot, Liu, IJRR 30(8):969-974, 2011",
        "licence": "none stated with the files",
        "start": start,
        "time": "seconds since start, which is in seconds since 1970",
        "truth": f"interpolated between samples up to {GAP} s apart",
        "settings": settings,
        "dropped": dropped,
    }

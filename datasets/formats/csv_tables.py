"""A log from two CSV tables: odometry and detections.

    odometry     t,x,y,heading      poses of the robot's own odometry, in its own frame; or
                 t,dx,dy,dtheta     the motion since the row before, in the body frame before it; or
                 t,v,omega          m/s and rad/s, held until the next row
    detections   t,id,range,bearing or t,id,x,y, the landmark in the body frame: x ahead, y to the left

Keyframes are the times of detections, with regular ones between; the motion up to each is one factor. Between two rows
of odometry, motion is interpolated evenly; where rows are missing, with the noise of `frontend.wheels.holes` and
without regular keyframes. The noise is set by the options. What is legal yet odd is a remark on the log.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.csv_values import digits_lost
from ...core.dead_reckoning import summed
from ...core.elementary import arctan2, hypot
from ...core.errors import InputError
from ...core.factors import REMARKS, UNKNOWN, Dataset, Log, Map, Prior, Truth
from ...core.options import option
from ...core.pauses import longest_pause
from ...core.se2 import Array, Ints, wrap
from ...core.table import LARGEST, MOST, Table
from ...core.tum import read_tum
from ...frontend.wheels.encoder import Floors, roll
from ...frontend.wheels.holes import Holes, outside
from ...frontend.wheels.motion import Track, TrackNoise
from ...frontend.wheels.units import fast_turns, in_degrees
from ..registry import Source
from ..truth import other_clock, sample
from .columns import read_columns

POSES = ("t", "x", "y", "heading")
MOTIONS = ("t", "dx", "dy", "dtheta")
SPEEDS = ("t", "v", "omega")
SIGHTINGS = ("t", "id", "range", "bearing")
POINTS = ("t", "id", "x", "y")
PLACES = ("id", "x", "y")

MOST_KEYFRAMES = 500_000
"""More indicate an error: times in nanoseconds, or a detection from another year."""


@dataclass(frozen=True)
class Options:
    """The files and their noise."""

    odometry: str | None = option(None, "CSV file with t,x,y,heading or t,dx,dy,dtheta or t,v,omega")
    detections: str | None = option(None, "CSV file with t,id,range,bearing or t,id,x,y; id -1 is unknown")
    truth: str | None = option(None, "CSV file with t,x,y,heading, or a TUM file")
    landmarks: str | None = option(None, "CSV file with the landmarks' true positions: id,x,y")
    ignore: str = option("", "ids to leave out, such as those of moving objects: 5;14;23")
    angles: str = option("radians", "unit of angles in the CSV files", choices=("radians", "degrees"))
    range_sd: float = option(0.1, "standard deviation of a range, m", minimum=1e-6, maximum=1e3)
    range_share: float = option(0.0, "growth of that with the range, as a share of the range", minimum=0.0, maximum=1.0)
    bearing_sd: float = option(0.02, "standard deviation of a bearing, rad", minimum=1e-6, maximum=3.0)
    forward: float = option(0.05, "motion noise, m per root metre driven", minimum=0.0, maximum=10.0)
    turning: float = option(0.03, "motion noise, rad per root metre driven", minimum=0.0, maximum=10.0)
    turning_by_turn: float = option(0.05, "motion noise, rad per root radian turned", minimum=0.0, maximum=10.0)
    floor_position: float = option(1e-3, "motion noise of every factor, m", minimum=1e-6, maximum=10.0)
    floor_heading: float = option(1e-3, "motion noise of every factor, rad", minimum=1e-6, maximum=3.0)
    every: float = option(1.0, "longest time between keyframes, s", minimum=1e-3, maximum=1e6)
    max_speed: float = option(50.0, "faster motion counts as a misreading, m/s", minimum=1e-3, maximum=1e6)
    start_x: float | None = option(None, "initial x, m; not given: from the ground truth, else 0")
    start_y: float | None = option(None, "initial y, m")
    start_heading: float | None = option(None, "initial heading, rad", minimum=-np.pi, maximum=np.pi)
    start_sd: float | tuple[float, float] = option(
        1e-3, "standard deviation of the initial pose: of m and rad alike, or of m;rad", minimum=1e-9, maximum=1e3
    )


class Detections(NamedTuple):
    """Sightings in order of time, and the numbers left out: outside the odometry's time, and ignored."""

    t: Array  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    outside: int
    ignored: int


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Your own log from a CSV of odometry and a CSV of detections: csv[odometry=FILE,detections=FILE]."""
    if options.odometry is None or options.detections is None:
        missing = "odometry" if options.odometry is None else "detections"
        raise InputError(f"option {missing} of dataset csv is not given, expected csv[odometry=FILE,detections=FILE].")
    remarks = list[str]()
    track = _track(Path(options.odometry), options, remarks)
    seen = _detections(Path(options.detections), options, track.t[0], track.t[-1], remarks)
    t = _keyframes(track.t[0], track.t[-1], seen.t, options.every, track.holes)
    motions = track.motions(t)
    truth = _truth(options, t, remarks)
    if not isinstance(options.start_sd, tuple) and options.start_sd > np.pi:
        sd = f"start_sd={options.start_sd:g}"
        remarks.append(f"option {sd} is of the heading in rad, too: {sd};0.1 says that it is known to 0.1 rad")
    first = np.full((1, 3), np.nan)
    log = Log.from_arrays(
        Path(options.odometry).stem,
        _prior(options, truth, t[0]),
        t,
        np.concatenate((first, motions.delta)),
        np.concatenate((first[..., None] * first, motions.cov)),
        sighting_step=np.searchsorted(t, seen.t),
        ids=seen.ids,
        z=seen.z,
        z_cov=_noise(seen.z, options),
        notes=_notes(options, seen)
        | longest_pause(t[0], t[-1], track.t, seen.t)
        | ({REMARKS: remarks} if remarks else {}),
    )
    return Dataset(log, truth)


source = Source(make, Options)


def _track(path: Path, options: Options, remarks: list[str]) -> Track:
    """Converts the odometry, in any of its forms, to poses in a frame of its own."""
    table = _in_order(read_columns(path, POSES, MOTIONS, SPEEDS, remarks=remarks), strictly=False)
    t, turn = table.column("t"), _radians(options)
    last = np.append(np.diff(t) > 0, True)  # of rows at equal times, as a coarse clock gives, the last counts
    lost = "" if last.all() else digits_lost(t.tolist())
    if lost and 2 * last.sum() < len(t):
        raise table.fault(int(np.flatnonzero(~last)[0]) + 1, f"t is as in the row before{lost}")
    if table.columns == POSES:
        poses = _poses(table, options, remarks)
        for row in np.flatnonzero(~last[:-1] & (np.diff(poses, axis=0) != 0).any(1)) + 1:
            expected = f"expected a later one{lost}"
            raise table.fault(row, f"t is {t[row]!s} as in the row before, with another pose, {expected}")
    elif table.columns == MOTIONS:
        motions = table.rows[1:, 1:] * np.array([1.0, 1.0, turn])  # the motion before the first row is unknown
        poses = summed(np.zeros(3), motions)
    else:
        remarks += fast_turns(str(path), table.column("omega") * turn)
        dt = np.diff(t)[:, None]
        rolling = table.rows[:-1, 1:] * np.array([1.0, turn]) * dt
        poses = summed(np.zeros(3), roll(rolling, "arc")[0])
    if not np.isfinite(poses).all():
        raise InputError(f"{path}: the motions add up to an infinite position, expected metres and {options.angles}.")
    poses[:, 2] = wrap(poses[:, 2])
    floors = Floors(options.floor_position, options.floor_heading)
    noise = TrackNoise(options.forward, options.turning, options.turning_by_turn, floors)
    bridged = table.columns == POSES
    track = Track(t[last], poses[last], noise, options.max_speed, str(path), bridged)
    track.check()
    remarks += track.remarks(t[0], t[-1])
    return track


def _poses(table: Table, options: Options, remarks: list[str]) -> Array:
    """(m, 3) the poses of a table of POSES; InputError for one beyond LARGEST."""
    for name in POSES[1:]:
        table.bounded(-LARGEST, LARGEST, name)
    if options.angles == "radians" and in_degrees(table.rows[:, 1:]):
        remarks.append(
            f"{table.path}: the robot drives along its headings if they are in degrees, and across them as radians: "
            "are they in degrees? Option angles=degrees reads them so"
        )
    return table.rows[:, 1:] * np.array([1.0, 1.0, _radians(options)])


def _detections(path: Path, options: Options, start: float, end: float, remarks: list[str]) -> Detections:
    """The detections from `start` to `end`, s."""
    table = _in_order(read_columns(path, SIGHTINGS, POINTS, remarks=remarks), strictly=False)
    ids, t = table.whole("id"), table.column("t")
    for row in np.flatnonzero((ids < UNKNOWN) | (ids > MOST)):
        raise table.fault(row, f"id is {ids[row]}, expected 0 to {MOST}, or {UNKNOWN} for unknown")
    order = np.lexsort((ids, t))
    twin = (np.diff(t[order]) == 0) & (np.diff(ids[order]) == 0) & (ids[order[1:]] != UNKNOWN)
    for row in np.sort(order[1:][twin]):
        raise table.fault(row, f"id {ids[row]} occurs twice at t {t[row]!s}, expected once")
    z = table.rows[:, 2:]
    if table.columns == POINTS:
        z = np.stack((hypot(*z.T), arctan2(z[:, 1], z[:, 0])), axis=-1)
    else:
        z = z * np.array([1.0, _radians(options)])
        for row in np.flatnonzero(np.abs(z[:, 1]) > np.pi):
            found = f"bearing is {table.column('bearing')[row]!s} {options.angles}"
            raise table.fault(row, f"{found}, expected at most half a turn: wrap it, or set the unit by option angles")
    for row in np.flatnonzero(~((z[:, 0] > 0) & np.isfinite(z[:, 0]))):
        raise table.fault(row, f"the range is {z[row, 0]!s}, expected more than 0")
    inside = (start <= t) & (t <= end)
    ignored = _ignored(options)
    left_out = np.isin(ids, ignored)
    remarks += [
        f"option ignore={options.ignore}: {path} has no detection of id {name}, which is to be left out"
        for name in np.setdiff1d(ignored, ids).tolist()
    ]
    if not inside.any():
        raise InputError(
            f"{path}: its times, {t[0]!s} to {t[-1]!s} s, are outside the odometry's, {start!s} to "
            f"{end!s} s; expected the same clock."
        )
    kept = inside & ~left_out
    clock = f"before or after the odometry, {start:.10g} to {end:.10g} s"
    remarks += outside(str(path), int((~inside).sum()), len(t), "detection", clock)
    return Detections(t[kept], ids[kept], z[kept], int((~inside).sum()), int((inside & left_out).sum()))


def _ignored(options: Options) -> list[int]:
    """Parses the ids to leave out."""
    names = [name.strip() for name in options.ignore.split(";") if name.strip()]
    for name in names:
        if not (name.isascii() and name.removeprefix("-").isdigit()):
            raise InputError(
                f"option ignore={options.ignore} of dataset csv: found {name!r}, expected ids as in 5;14;23."
            )
    return [int(name) for name in names]


def _keyframes(start: float, end: float, seen: Array, every: float, holes: Holes) -> Array:
    """(n,) s: `start`, `end`, the times `seen`, and evenly spaced ones wherever gaps exceed `every`, but in no hole."""
    at = np.unique(np.concatenate(([start, end], seen, holes.start, holes.end)))
    pieces = np.maximum(np.ceil(np.diff(at) / every * (1 - 1e-9)), 1)
    pieces[holes.between(at)] = 1
    if pieces.sum() > MOST_KEYFRAMES:
        raise InputError(
            f"option every={every:g} of dataset csv: splits {end - start:g} s into {pieces.sum():.0f} keyframes, "
            f"expected at most {MOST_KEYFRAMES}; are the times in seconds?"
        )
    count = pieces.astype(int)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    spread = number * np.repeat(np.diff(at) / pieces, count) + np.repeat(at[:-1], count)
    return np.unique(np.concatenate((spread, at)))


def _noise(z: Array, options: Options) -> Array:
    """(s, 2, 2) the covariances set by the options."""
    cov = np.zeros((len(z), 2, 2))
    cov[:, 0, 0] = (options.range_sd + options.range_share * z[:, 0]) ** 2
    cov[:, 1, 1] = options.bearing_sd**2
    return cov


def _truth(options: Options, t: Array, remarks: list[str]) -> Truth | None:
    known = None if options.landmarks is None else _places(Path(options.landmarks))
    if options.truth is None:
        return None if known is None else Truth(np.zeros(0), np.zeros((0, 3)), known, None, "truth")
    path = Path(options.truth)
    if path.suffix.lower() == ".csv":
        table = read_columns(path, POSES)
        repeated = np.append(False, (np.diff(table.rows, axis=0) == 0).all(axis=1))
        table = _in_order(table.take(np.flatnonzero(~repeated)), strictly=True)
        poses = _poses(table, options, remarks)
        poses[:, 2] = wrap(poses[:, 2])
        times = table.column("t")
    else:
        times, poses = read_tum(path)
    found = sample(Truth(times, poses, known, None, "truth"), t)
    if not len(found.t):
        raise InputError(f"{path}: has no pose at the time of the odometry, expected the same clock.")
    remarks += other_clock(str(path), times, t, len(found.t))
    return found


def _places(path: Path) -> Map:
    table = read_columns(path, PLACES)
    ids = table.whole("id")
    _, first = np.unique(ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(ids)), first):
        raise table.fault(row, f"id {ids[row]} occurs twice, expected once")
    return Map(ids, table.rows[:, 1:], None)


def _prior(options: Options, truth: Truth | None, start: float) -> Prior:
    """The prior from the options, filled up from the ground truth at that time, or 0."""
    pose = np.zeros(3)
    if truth is not None and len(truth.t) and truth.t[0] == start:
        pose = truth.poses[0].copy()
    for k, given in enumerate((options.start_x, options.start_y, options.start_heading)):
        if given is not None:
            pose[k] = given
    position, heading = sd if isinstance(sd := options.start_sd, tuple) else (sd, sd)
    return Prior(pose, np.diag([position**2, position**2, heading**2]))


def _notes(options: Options, seen: Detections) -> dict[str, Any]:
    files = {
        name: Path(given).name
        for name in ("odometry", "detections", "truth", "landmarks")
        if (given := getattr(options, name)) is not None
    }
    noise = ("range_sd", "range_share", "bearing_sd", "forward", "turning", "turning_by_turn")
    return {
        "source": "CSV files: " + ", ".join(files.values()),
        "files": files,
        "noise": {name: getattr(options, name) for name in noise},
        "dropped": {"detections before or after the odometry": seen.outside, "of ignored ids": seen.ignored},
    }


def _in_order(table: Table, *, strictly: bool) -> Table:
    """Returns itself; InputError for a time that is earlier than the one before or, with `strictly`, equal."""
    t = table.column("t")
    late = np.diff(t) <= 0 if strictly else np.diff(t) < 0
    for row in np.flatnonzero(late) + 1:
        wanted = "later than" if strictly else "no earlier than"
        raise table.fault(row, f"t is {t[row]!s}, expected {wanted} {t[row - 1]!s}{digits_lost(t.tolist())}")
    return table


def _radians(options: Options) -> float:
    return 1.0 if options.angles == "radians" else np.pi / 180

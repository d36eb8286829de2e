"""A log from CSV tables: odometry and detections, or ranges, bearings, positions and headings alone.

    odometry     t,x,y,heading      poses of the robot's own odometry, in its own frame; or
                 t,dx,dy,dtheta     the motion since the row before, in the body frame before it; or
                 t,v,omega          m/s and rad/s, held until the next row, or as option `speeds` says
    detections   t,id,range,bearing or t,id,x,y, the landmark in the body frame: x ahead, y to the left;
                 and signature, where option signature_sd states its noise
    ranges       t,id,range; bearings t,id,bearing; positions t,x,y or t,lat,lon; headings t,heading
    imu          t,gyro_x,gyro_y,gyro_z, as `inertial.imu_csv` reads it

Keyframes are the times of detections and of all others, with regular ones between; the motion up to each is one factor.
Between two rows of odometry, the robot is on an arc; where rows are missing, with the noise of
`frontend.wheels.holes` and without regular keyframes. The noise is set by the options. What is legal yet odd is a
remark on the log.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.csv_values import digits_lost
from ...core.errors import InputError
from ...core.factors import REMARKS, Dataset, Log, Map, Prior, Systematic, Truth
from ...core.lines import Lines
from ...core.se2 import Array, summed, wrap
from ...core.table import LARGEST, Table
from ...core.truth.tum import read_tum
from ...frontend.pauses import longest_pause
from ...frontend.wheels.encoder import Floors
from ...frontend.wheels.held import Held, held, way
from ...frontend.wheels.holes import Holes
from ...frontend.wheels.track import Poses, Track, TrackNoise
from ...frontend.wheels.units import fast_turns, in_degrees
from ..formats.columns import in_order, read_columns, repeated_motions
from ..inertial.open import beside, open_imu_csv
from ..registry import Source
from ..remarks import DETECTED
from ..truth import other_clock, sample, start
from .csv_fixes import World, world
from .csv_options import Options
from .csv_parts import Alone, alone
from .csv_sightings import NO_DETECTIONS, Detections, detections

POSES = ("t", "x", "y", "heading")
MOTIONS = ("t", "dx", "dy", "dtheta")
SPEEDS = ("t", "v", "omega")
PLACES = ("id", "x", "y")

MEASURED = ("detections", "ranges", "bearings", "positions", "headings")
"""Options of files with measurements, one of which there has to be."""

START = ("start_x", "start_y", "start_heading")
START_UNKNOWN = "the start there is not known"  # in a remark: its pose is none that anybody states

EARLY = 0.25  # share of the steps, after which a truth that begins does not tell the start

MOST_KEYFRAMES = 500_000
"""More indicate an error: times in nanoseconds, or a detection from another year."""


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Your own log from a CSV of odometry and a CSV of detections: csv[odometry=FILE,detections=FILE]."""
    measured = [name for name in MEASURED if getattr(options, name) is not None]
    if options.odometry is None or not measured:
        if options.odometry is None:
            raise InputError(
                "option odometry of dataset csv is not given, expected csv[odometry=FILE,detections=FILE]."
            )
        raise InputError(
            f"dataset csv: found odometry alone, expected what the robot measured, too: {', '.join(MEASURED[:-1])} or "
            f"{MEASURED[-1]}."
        )
    remarks = list[str]()
    track, table = _track(Path(options.odometry), options, remarks)
    ends = track.t[0], track.t[-1]
    seen = NO_DETECTIONS
    if options.detections is not None:
        seen = detections(Path(options.detections), options, *ends, remarks)
    parts, fixes = alone(options, *ends, remarks), world(options, track, remarks)
    t = _keyframes(*ends, np.concatenate((seen.t, parts.t, fixes.t)), options.every, track.holes)
    motions = track.motions(t)
    truth = _truth(options, t, remarks)
    starts = [getattr(options, name) for name in START]
    told_start = None not in starts or options.start_sd != Options.start_sd
    if len(fixes.t) and (truth is None or not len(truth.t)) and not told_start:
        missing = [name for name in START if getattr(options, name) is None]
        given = [name for name in START if name not in missing]
        known = f": {' and '.join(given)} {'is' if len(given) == 1 else 'are'} given, but not" if given else ": options"
        remarks.append(
            f"positions or headings are in the world, but {START_UNKNOWN}"
            f"{known} {', '.join(missing)}{'; start_sd states how well' if given else ' and start_sd state it'}"
        )
    if not isinstance(options.start_sd, tuple) and options.start_sd > np.pi:
        sd = f"start_sd={options.start_sd:g}"
        remarks.append(f"option {sd} is of the heading in rad, too: {sd},0.1 says that it is known to 0.1 rad")
    told = dict[str, Any]()
    inertial = None
    if options.imu is not None:
        inertial = open_imu_csv(
            Path(options.imu),
            options.imu_table,
            Poses(track.t, track.poses),
            told,
            remarks,
            None if truth is None or len(truth.t) < 2 else Poses(truth.t, truth.poses),
        )
    first = np.full((1, 3), np.nan)
    delta = np.concatenate((first, motions.delta))
    log = Log.from_arrays(
        _name(options, Path(options.odometry)),
        _prior(options, truth, t, delta),
        t,
        delta,
        np.concatenate((first[..., None] * first, motions.cov)),
        sighting_step=np.searchsorted(t, seen.t),
        ids=seen.ids,
        z=seen.z,
        z_cov=seen.z_cov,
        signature=seen.signature,
        signature_var=None if options.signature_sd is None else np.full(len(seen.t), options.signature_sd**2),
        partial=parts.table(t),
        fixes=fixes.table(t),
        notes=_notes(options, seen, parts, fixes)
        | told
        | longest_pause(t[0], t[-1], track.t, np.sort(np.concatenate((seen.t, parts.t, fixes.t))))
        | ({REMARKS: remarks} if remarks else {}),
    )
    lines = {"odometry": _lines(table, t)} | ({} if seen.lines is None else {"sightings": seen.lines})
    return Dataset(replace(beside(log, inertial), lines=lines), truth)


source = Source(make, Options)


def _track(path: Path, options: Options, remarks: list[str]) -> tuple[Track, Table]:
    """Converts the odometry, in any of its forms, to poses in a frame of its own; these and the table of its file."""
    table = in_order(read_columns(path, POSES, MOTIONS, SPEEDS, remarks=remarks), strictly=False)
    if table.columns == POSES:
        table = table.without_repeats(remarks)
    t, turn = table.column("t"), options.unit("odometry")
    last = np.append(np.diff(t) > 0, True)  # of rows at equal times, as a coarse clock gives, the last counts
    speeds, along = np.zeros((0, 2)), None
    lost = "" if last.all() else digits_lost(t.tolist())
    if lost and 2 * last.sum() < len(t):
        raise table.fault(int(np.flatnonzero(~last)[0]) + 1, f"t is as in the row before{lost}")
    if table.columns == POSES:
        poses = _poses(table, "odometry", options, remarks)
        for row in np.flatnonzero(~last[:-1] & (np.diff(poses, axis=0) != 0).any(1)) + 1:
            expected = f"expected a later one{lost}"
            raise table.fault(row, f"t is {t[row]!s} as in the row before, with another pose, {expected}")
        rates = np.zeros(0)
    elif table.columns == MOTIONS:
        remarks += repeated_motions(table)
        motions = table.rows[1:, 1:] * np.array([1.0, 1.0, turn])  # the motion before the first row is unknown
        poses = summed(np.zeros(3), motions)
        rates = motions[:, 2] * len(motions) / (np.ptp(t) or np.inf)  # by the mean time: stamps may come in bursts
    else:
        speeds = held(table.rows[:, 1:] * np.array([1.0, turn]), options.speeds)[last]
        along = way(t[last], speeds, str(path))
        poses, rates = along.poses, speeds[:, 1]
    if table.columns != SPEEDS and options.speeds != Options.speeds:
        found = f"option speeds={options.speeds} of dataset csv: {path} has {','.join(table.columns)}"
        raise InputError(f"{found}, expected {','.join(SPEEDS)}, or this option left out.")
    reads = f": option {options.with_degrees('odometry')} reads them so" if turn == 1 else ""
    remarks += [found + reads for found in fast_turns(str(path), rates)]
    if not np.isfinite(poses).all():
        unit = "radians" if turn == 1 else "degrees"
        raise InputError(f"{path}: the motions add up to an infinite position, expected metres and {unit}.")
    poses[:, 2] = wrap(poses[:, 2])
    floors = Floors(options.floor_position, options.floor_heading)
    noise = TrackNoise(options.forward, options.turning, options.turning_by_turn, floors)
    if along is not None:
        track = Held(along.t, poses, noise, options.max_speed, str(path), rates=speeds, rows=along.rows)
    else:
        track = Track(t[last], poses[last], noise, options.max_speed, str(path), table.columns == POSES)
    track.check()
    remarks += track.remarks(t[0], t[-1])
    return track, table


def _lines(table: Table, t: Array) -> Lines:
    """The lines of the odometry that tell the motion into each of the steps at `t` (n,)."""
    held = table.columns == SPEEDS  # from its row on
    before = np.concatenate((t[:1], t[:-1]))
    first = np.searchsorted(table.column("t"), before, "right") - held
    last = np.searchsorted(table.column("t"), t, "left") - held
    first, last = (np.clip(one, 0, len(table.rows) - 1) for one in (np.minimum(first, last), last))
    return Lines(str(table.path), table.lines[first], table.lines[last])


def _poses(table: Table, file: str, options: Options, remarks: list[str]) -> Array:
    """(m, 3) the poses of a table of POSES in `file`, odometry or truth; InputError for one beyond LARGEST."""
    for name in POSES[1:]:
        table.bounded(-LARGEST, LARGEST, name)
    unit = options.unit(file)
    if unit == 1 and in_degrees(table.rows[:, 1:]):
        remarks.append(
            f"{table.path}: the robot drives along its headings if they are in degrees, and across them as radians: "
            f"option {options.with_degrees(file)} reads the headings of this file as degrees"
        )
    return table.rows[:, 1:] * np.array([1.0, 1.0, unit])


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


def _truth(options: Options, t: Array, remarks: list[str]) -> Truth | None:
    known = None if options.landmarks is None else _places(Path(options.landmarks))
    if options.truth is None:
        return None if known is None else Truth(np.zeros(0), np.zeros((0, 3)), known, None, "truth")
    path = Path(options.truth)
    if path.suffix.lower() == ".csv":
        table = read_columns(path, POSES)
        repeated = np.append(False, (np.diff(table.rows, axis=0) == 0).all(axis=1))
        table = in_order(table.take(np.flatnonzero(~repeated)), strictly=True)
        poses = _poses(table, "truth", options, remarks)
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


def _prior(options: Options, truth: Truth | None, t: Array, delta: Array) -> Prior:
    """The prior from the options, filled up from an early ground truth, by the motions `delta` before it, or 0.

    A truth that begins late, as where the end of a drive was measured, is in the frame of the start.
    """
    early = truth is not None and len(truth.t) and truth.t[0] <= t[int(EARLY * (len(t) - 1))]
    pose = start(t, delta, truth).copy() if truth is not None and early else np.zeros(3)
    for k, given in enumerate((options.start_x, options.start_y, options.start_heading)):
        if given is not None:
            pose[k] = given
    position, heading = sd if isinstance(sd := options.start_sd, tuple) else (sd, sd)
    constant = Systematic(options.range_scale, options.range_offset, options.heading_offset)
    return Prior(pose, np.diag([position**2, position**2, heading**2]), systematic=constant)


def _name(options: Options, odometry: Path) -> str:
    """The log's name: as given, else that of the folder of its files, which often have the same names in all."""
    return options.name or odometry.parent.name or odometry.stem


def _notes(options: Options, seen: Detections, parts: Alone, fixes: World) -> dict[str, Any]:
    files = {
        name: Path(given).name
        for name in ("odometry", *MEASURED, "imu", "truth", "landmarks")
        if (given := getattr(options, name)) is not None
    }
    sights = ("range_sd", "range_share", "bearing_sd") if options.xy_sd is None else ("xy_sd",)
    noise = (*sights, "forward", "turning", "turning_by_turn")
    dropped = {"detections before or after the odometry": seen.outside, "of ignored ids": seen.ignored}
    if more := parts.outside + fixes.outside:
        dropped["other measurements before or after it"] = more
    return {
        "source": "CSV files: " + ", ".join(files.values()),
        "files": files,
        "noise": {name: getattr(options, name) for name in noise},
        "dropped": dropped,
        **({DETECTED: ",".join(seen.columns)} if seen.columns else {}),
        **fixes.notes,
    }

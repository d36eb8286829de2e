"""Positions and headings in the world of a log from CSV tables.

positions   t,x,y or t,lat,lon, and perhaps sd     m, or degrees; m
headings    t,heading, and perhaps sd              from x, or a compass': from north; rad
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.fixes import FixTable
from ...core.se2 import Array, wrap
from ...core.table import LARGEST, Table
from ...frontend.wheels.holes import other_unit, outside
from ...frontend.wheels.track import Track
from ..fixes.degrees import ORIGIN, exchanged
from ..fixes.far import far_off
from ..fixes.geodetic import metres
from ..formats.columns import in_order, read_columns
from .csv_options import Options

XY, GLOBE, HEADING, SD = ("t", "x", "y"), ("t", "lat", "lon"), ("t", "heading"), ("sd",)

TURN = 2 * np.pi + 1e-9  # rad; a larger heading is in degrees


class World(NamedTuple):
    """Positions and headings in order of time, the number outside the odometry's time, and the origin's notes."""

    t: Array  # (f,)
    z: Array  # (f, 3)
    cov: Array  # (f, 3, 3)
    arm: Array  # (f, 2)
    outside: int
    notes: dict[str, Any]

    def table(self, t: Array) -> FixTable:
        """The fixes of a log with steps at the times `t` (n,), all of these among them."""
        return FixTable.from_arrays(len(t), np.searchsorted(t, self.t), self.z, self.cov, self.arm)


def world(options: Options, track: Track, remarks: list[str]) -> World:
    """Reads the positions and headings in the time of the odometry, which tells how far they can be apart."""
    start, end = track.t[0], track.t[-1]
    found = World(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 2)), 0, {})
    for name, read in (("positions", _positions), ("headings", _headings)):
        if (given := getattr(options, name)) is not None:
            found = _joined(
                found, read(Path(given), options, track, remarks), Path(given), name[:-1], start, end, remarks
            )
    order = np.argsort(found.t, kind="stable")
    return found._replace(t=found.t[order], z=found.z[order], cov=found.cov[order], arm=found.arm[order])


def _joined(one: World, other: World, path: Path, noun: str, start: float, end: float, remarks: list[str]) -> World:
    inside = (start <= other.t) & (other.t <= end)
    left_out = int((~inside).sum())
    clock = f"before or after the odometry, {start:.10g} to {end:.10g} s"
    remarks += outside(str(path), left_out, len(inside), noun, clock, other_unit(other.t, start, end))
    t, z, cov, arm = (np.concatenate((mine, its[inside])) for mine, its in zip(one[:4], other[:4], strict=True))
    return World(t, z, cov, arm, one.outside + left_out, one.notes | other.notes)


def _positions(path: Path, options: Options, track: Track, remarks: list[str]) -> World:
    table = in_order(read_columns(path, XY + SD, GLOBE + SD, XY, GLOBE), strictly=False).without_repeats(remarks)
    sd, notes = _sds(table, options.position_sd, "position_sd"), dict[str, Any]()
    if table.columns[1] == "lat":
        table.bounded(-90, 90, "lat").bounded(-360, 360, "lon")
        origin, stated = table.rows[0, 1:3], options.origin_lat is not None and options.origin_lon is not None
        if stated:
            origin = np.array([options.origin_lat, options.origin_lon])
        elif options.origin_lat is not None or options.origin_lon is not None:
            raise InputError("options origin_lat and origin_lon of dataset csv: found one, expected both or none.")
        xy, at = metres(table.rows[:, 1:3], origin), f"{origin[0]:.8g}, {origin[1]:.8g}"
        remarks += exchanged(str(path), table.rows[:, 1:3], origin)
        notes["origin"] = f"latitude and longitude {at}, x being east and y north"
        notes[ORIGIN] = [float(one) for one in origin]
        if not stated:
            said = "x and y are metres east and north of its first fix, latitude and longitude"
            remarks.append(f"{path}: {said} {at}: options origin_lat and origin_lon state another origin")
    else:
        xy = table.bounded(-LARGEST, LARGEST, "x", "y").rows[:, 1:3]
    driven = float(np.hypot(*np.diff(track.poses[:, :2], axis=0).T).sum())
    for row in far_off(xy, sd, driven):
        off, found = float(np.hypot(*(xy[row] - np.median(xy, axis=0)))), tuple(table.rows[row, 1:3].tolist())
        swapped = table.columns[1] == "lat" and not len(far_off(_swapped(table, row), sd, driven, [row]))
        remarks.append(
            f"{path}, line {table.lines[row]}: the position {found[0]:.10g}, {found[1]:.10g} is {_length(off)} from "
            f"the middle of the others, which are {_length(_spread(xy, row))} from it at most, and the robot drives "
            f"{_length(driven)}{': perhaps lat and lon are swapped in this row' * swapped}"
        )
    z, cov = np.full((len(xy), 3), np.nan), np.full((len(xy), 3, 3), np.nan)
    z[:, :2], cov[:, :2, :2] = xy, sd[:, None, None] ** 2 * np.eye(2)
    return World(table.column("t"), z, cov, np.tile((options.antenna_x, options.antenna_y), (len(xy), 1)), 0, notes)


def _headings(path: Path, options: Options, track: Track, remarks: list[str]) -> World:  # noqa: ARG001 - as _positions
    table = in_order(read_columns(path, HEADING + SD, HEADING), strictly=False).without_repeats(remarks)
    sd, unit = _sds(table, options.heading_sd, "heading_sd"), options.unit("headings")
    measured = table.column("heading") * unit
    for row in np.flatnonzero(np.abs(measured) > TURN):
        hint = f" radians, expected at most a turn; headings in degrees take option {options.with_degrees('headings')}"
        said = hint if unit == 1 else " degrees, expected at most a turn"
        raise table.fault(row, f"heading is {table.column('heading')[row]!s}{said}")
    measured = (np.pi / 2 - measured if options.headings_from == "north" else measured) - options.declination
    z, cov = np.full((len(sd), 3), np.nan), np.full((len(sd), 3, 3), np.nan)
    z[:, 2], cov[:, 2, 2] = wrap(measured), sd**2
    return World(table.column("t"), z, cov, np.zeros((len(sd), 2)), 0, {})


def _swapped(table: Table, row: int) -> Array:
    """(r, 2) m: the positions with latitude and longitude of one row exchanged, around their middle."""
    degrees = table.rows[:, 1:3].copy()
    degrees[row] = degrees[row, ::-1]
    return metres(degrees, np.median(degrees, axis=0))


def _spread(xy: Array, row: int) -> float:
    """m, the farthest of the other positions from the middle of all."""
    return float(np.hypot(*(np.delete(xy, row, axis=0) - np.median(xy, axis=0)).T).max())


def _length(size: float) -> str:
    return f"{size / 1e3:,.0f} km" if size >= 1e4 else f"{size:.3g} m"


def _sds(table: Table, stated: float | None, option: str) -> Array:
    """(r,) standard deviations: the column of a file, else the option's."""
    if table.columns[-1:] == SD:
        sd = table.column("sd")
        for row in np.flatnonzero(~((sd > 0) & (sd <= LARGEST))):
            raise table.fault(row, f"sd is {sd[row]!s}, expected a standard deviation, more than 0")
        return sd
    if stated is None:
        raise InputError(
            f"option {option} of dataset csv is not given, and {table.path} has no column sd, expected one of them."
        )
    return np.full(len(table.rows), stated)

"""The detections of a log from CSV tables, and their noise as that of ranges and bearings.

Noise in x and y alone, of standard deviation s, is s along the range and s / r across it where the range r is well
beyond s. Nearer, a bearing says less and less, and in the end nothing: its variance is that of all angles, pi^2 / 3.
The place is then anywhere around the point that was measured, and the covariance is the mean square by which range and
bearing of a place drawn from there differ from that point's (S. O. Rice, Bell System Technical Journal 24, 1945, has
the densities of both).
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.csv_values import header_names, shown
from ...core.elementary import arctan2, hypot
from ...core.errors import InputError
from ...core.factors import UNKNOWN
from ...core.lines import Lines
from ...core.mounting import NONE, from_body
from ...core.options import parts
from ...core.se2 import Array, Ints
from ...core.table import MOST, Table, text
from ...frontend.wheels.holes import other_unit, outside
from ..formats.columns import in_order, read_columns
from ..remarks import POINTS
from .csv_options import Options, within_half

SIGHTINGS = ("t", "id", "range", "bearing")
SIGNATURE = ("signature",)

FAR = 10.0  # standard deviations; ranges beyond it are taken as well beyond the noise: bearings are then 0.5 % better
NEAR = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, FAR])
ALONG = np.array(
    [2.0000, 1.4886, 1.1696, 0.9895, 0.9029, 0.8734, 0.8752, 0.9105, 0.9440, 0.9645, 0.9825, 0.9893, 0.9947, 0.9975]
)
ACROSS = np.array(
    [3.2899, 2.6830, 2.1306, 1.6497, 1.2489, 1.4510, 1.5356, 1.4720, 1.3105, 1.1861, 1.0789, 1.0454, 1.0216, 1.0103]
)
"""At these ranges, in standard deviations of x and y: the variance of the range over theirs, and that of the bearing
times the square of the range in them, or of 1 if that is more."""


class Detections(NamedTuple):
    """Sightings in order of time, and the numbers left out: outside the odometry's time, and ignored."""

    t: Array  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    z_cov: Array  # (s, 2, 2)
    outside: int
    ignored: int
    signature: Array | None = None  # (s,)
    lines: Lines | None = None
    columns: tuple[str, ...] = ()  # of their file


NO_DETECTIONS = Detections(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)), 0, 0)
"""Those of a log without a file of them."""


def detections(path: Path, options: Options, start: float, end: float, remarks: list[str]) -> Detections:
    """Reads the detections from `start` to `end`, s."""
    table, signature = _read(path, options, remarks)
    if options.xy_sd is not None and table.columns != POINTS:
        raise InputError(
            f"option xy_sd={options.xy_sd:g} of dataset csv: {path} has {','.join(SIGHTINGS)}, expected "
            f"{','.join(POINTS)}, or options range_sd and bearing_sd."
        )
    ids, t = table.whole("id"), table.column("t") - options.sensor_delay
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
        z = z * np.array([1.0, options.unit("detections")])
        for row in np.flatnonzero(np.abs(z[:, 1]) > options.largest_bearing):
            found, half = f"bearing is {table.column('bearing')[row]!s}", "expected at most half a turn"
            if "detections" in options.in_degrees():
                raise table.fault(row, f"{found} degrees, {half}, 180: wrap it")
            cause = f"bearings in degrees take option {options.with_degrees('detections')}"
            raise table.fault(row, f"{found} radians, {half}: wrap it; {cause}, or angles=degrees if all angles are")
        z[:, 1] = within_half(z[:, 1])
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
            f"{end!s} s; expected the same clock{other_unit(t, start, end)}."
        )
    kept = inside & ~left_out
    clock = f"before or after the odometry, {start:.10g} to {end:.10g} s"
    remarks += outside(str(path), int((~inside).sum()), len(t), "detection", clock, other_unit(t, start, end))
    z, cov = z[kept], _noise(z[kept], options)
    place = options.sensor._replace(delay=0.0)
    if place != NONE:
        z, cov = from_body(z, cov, place.place)
    counts = int((~inside).sum()), int((inside & left_out).sum())
    signs = None if signature is None else signature[kept]
    return Detections(t[kept], ids[kept], z, cov, *counts, signs, table.lines_of(np.flatnonzero(kept)), table.columns)


def _read(path: Path, options: Options, remarks: list[str]) -> tuple[Table, Array | None]:
    """The table of SIGHTINGS or POINTS, and the signatures of its rows, if they are used."""
    more = () if options.signature_sd is None else SIGNATURE
    header = [name.strip('"') for name in header_names(text(path).partition("\n")[0])]
    if more and "signature" not in header and any(set(names) <= set(header) for names in (SIGHTINGS, POINTS)):
        raise InputError(
            f"{path}, line 1: option signature_sd has no effect without a column signature, expected both; found the "
            f"columns {shown(header)}."
        )
    table = in_order(read_columns(path, SIGHTINGS + more, POINTS + more, remarks=remarks), strictly=False)
    table = table.without_repeats(remarks)
    if more:
        return table._replace(columns=table.columns[:-1], rows=table.rows[:, :-1]), table.rows[:, -1]
    if "signature" in header:
        remarks.append(f"{path}: its column signature is not used: option signature_sd states its standard deviation")
    return table, None


def _ignored(options: Options) -> list[int]:
    """Parses the ids to leave out."""
    names = [name for name in parts(options.ignore) if name]
    for name in names:
        if not (name.isascii() and name.removeprefix("-").isdigit()):
            raise InputError(
                f"option ignore={options.ignore} of dataset csv: found {name!r}, expected ids as in 5,14,23."
            )
    return [int(name) for name in names]


def _noise(z: Array, options: Options) -> Array:
    """(s, 2, 2) the covariances set by the options."""
    cov = np.zeros((len(z), 2, 2))
    if options.xy_sd is not None:
        cov[:, 0, 0], cov[:, 1, 1] = of_points(z[:, 0], options.xy_sd)
        return cov
    cov[:, 0, 0] = (options.range_sd + options.range_share * z[:, 0]) ** 2
    cov[:, 1, 1] = options.bearing_sd**2
    return cov


def of_points(r: Array, sd: float) -> tuple[Array, Array]:
    """The variances (n,) of ranges (m^2) and bearings (rad^2) of points at `r` (n,), m, known to `sd` in x and in y."""
    times = r / sd
    far = times >= FAR
    along = np.where(far, 1.0, np.interp(times, NEAR, ALONG))
    across = np.where(far, 1.0, np.interp(times, NEAR, ACROSS))
    return sd**2 * along, across / np.maximum(times, 1.0) ** 2

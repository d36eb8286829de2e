"""Reads and writes paths in the TUM format, lines of `t x y z qx qy qz qw`, as evo and most trajectory tools do.

Commas may stand between the numbers, and a line may be repeated.

A planar pose has z = qx = qy = 0. All values, headings included, read back bit for bit.
"""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..csv_values import digits_lost
from ..elementary import arctan2, sincos
from ..files import number_rows
from ..scan import Scan, strict
from ..se2 import Array
from ..table import LARGEST, Table, scan_spaced

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")


ROUNDED = 1e-2  # largest deviation of a quaternion's length from 1: two digits of each entry

LEVEL = 30.0
"""degrees; a larger angle of the z axis with the vertical is of a camera's frame, or of no robot on a floor."""


def write_tum(path: Path, t: Array, poses: Array) -> None:
    """Writes poses (n, 3) at times `t` (n,)."""
    qz, qw = _quaternion(poses[:, 2])
    zero = np.zeros(len(t), np.int64)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("# " + " ".join(COLUMNS) + "\n")
        file.writelines(number_rows([t, *poses[:, :2].T, zero, zero, zero, qz, qw], " "))


def read_tum(path: Path) -> tuple[Array, Array]:
    """Reads times (n,), increasing, and poses (n, 3); poses out of the plane are projected to it.

    InputError names the file and line of what is invalid.
    """
    return strict(scan_tum(path))


def scan_tum(path: Path, times: Array | None = None) -> Scan[tuple[Array, Array]]:
    """Scans as `read_tum` reads, without invalid lines; with `times`, lines at other times are faults."""
    table = yield from scan_spaced(path, COLUMNS)
    table = yield from table.scan_finite()
    for name in COLUMNS[1:3]:
        far = ~(np.abs(table.column(name)) <= LARGEST)
        table = yield from table.refuse(far, _words(table, name, f"expected metres, at most {LARGEST:g}"))
    if times is not None:
        t = table.column("t")
        table = yield from table.refuse(
            ~np.isin(t, times), lambda row: f"t is {t[row]!s}, expected a time in odometry.csv"
        )
    table = table.sound()
    repeated = np.append(False, (np.diff(table.rows, axis=0) == 0).all(axis=1))[: len(table.rows)]
    table = table.take(np.flatnonzero(~repeated))
    t, qz, qw = table.column("t"), table.column("qz"), table.column("qw")
    back = np.append(False, np.diff(t) <= 0)[: len(t)]
    lost, order = digits_lost(t.tolist()) if back.any() else "", _other_order(table)
    table = yield from table.refuse(back, lambda row: f"t is {t[row]!s}, expected later than {t[row - 1]!s}{lost}")
    table = yield from table.refuse(
        (qz == 0) & (qw == 0), lambda _: f"qz and qw are both 0, expected a turn about z{order}"
    )
    table = yield from _scan_level(table.sound(), order)
    table = table.sound()
    heading = _heading(table.column("qz"), table.column("qw"))
    return table.column("t"), np.stack((table.column("x"), table.column("y"), heading), axis=-1)


def _words(table: Table, name: str, expected: str) -> Callable[[int], str]:
    return lambda row: f"{name} is {table.column(name)[row]!s}, {expected}"


def _other_order(table: Table) -> str:
    """A hint, at the end of a sentence, where the poses are all level only if the quaternion begins with qw."""
    squares = table.rows[:, 4:] ** 2
    signs = np.array([[-1, -1, 1, 1], [1, -1, -1, 1]])  # of qx qy qz qw, and of qw qx qy qz
    as_it_is, other = (squares @ signs.T > np.cos(np.deg2rad(LEVEL)) * squares.sum(axis=1)[:, None]).T
    return "; the columns are perhaps qw qx qy qz, expected qx qy qz qw" if other.all() and not as_it_is.all() else ""


def _scan_level(table: Table, order: str) -> Scan[Table]:
    """Yields a fault for each quaternion that is not of unit length, or of a pose that is not level.

    Its sentence ends in the hint `order`.
    """
    x, y, z, w = table.rows[:, 4:].T
    norm = np.sqrt(x**2 + y**2 + z**2 + w**2)
    table = yield from table.refuse(
        np.abs(norm - 1) > ROUNDED, lambda row: f"the quaternion has length {norm[row]:.3g}, expected 1"
    )
    upright = (w**2 + z**2 - x**2 - y**2) / norm**2
    tilt = np.rad2deg(np.arccos(np.clip(upright, -1, 1)))
    return (
        yield from table.refuse(
            tilt > LEVEL, lambda row: f"the pose is tilted by {tilt[row]:.0f} degrees, expected one on a floor{order}"
        )
    )


def _heading(qz: Array, qw: Array) -> Array:
    """2 atan2(qz, qw) in (-pi, pi]; q and -q are the same rotation."""
    qz, qw = np.where(qw < 0, -qz, qz), np.abs(qw)
    heading = 2 * arctan2(qz, qw)
    return np.where(heading == -np.pi, np.pi, heading)


def _quaternion(heading: Array) -> tuple[Array, Array]:
    """(qz, qw) of headings in (-pi, pi], adjusted by the few last-place units that restore the heading exactly."""
    qz, qw = sincos(heading / 2)
    qw = np.abs(qw)
    sine, cosine = qz.copy(), qw.copy()
    nudges = sorted(itertools.product(range(-4, 5), repeat=2), key=lambda pair: abs(pair[0]) + abs(pair[1]))
    wrong = np.flatnonzero(_heading(qz, qw) != heading)
    for by_sine, by_cosine in nudges:
        if not len(wrong):
            break
        qz[wrong] = sine[wrong] + by_sine * np.spacing(sine[wrong])
        qw[wrong] = cosine[wrong] + by_cosine * np.spacing(cosine[wrong])
        wrong = wrong[_heading(qz[wrong], qw[wrong]) != heading[wrong]]
    return qz, qw

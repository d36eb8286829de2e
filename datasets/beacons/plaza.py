"""CMU's Plaza logs from the gtsam wheel: a mower with wheel and gyro odometry, and ranges to four radio beacons.

J. Djugash, B. Hamner and S. Roth, "Navigating with ranging radios: five data sets with ground truth", Journal of Field
Robotics 26(9), 2009. A file of Matlab holds

    DR  t d a            m and rad since the row before, along an arc; every 0.2 s (1) or 0.1 s (2)
    DRp t x y heading    dead reckoning: of its first row, the start
    TD  t _ id range     m
    GT  t x y heading    RTK GPS, to 2 cm
    TL  id x y           the beacons

Every range is a step at its own time, with steps between where ranges are more than a second apart; a motion is split
evenly within a row of DR.

Ranges are 7.0 % too long in both logs, all beacons alike: their scale is a constant error in the prior, unless `scale`
divides them by a known one. Around that they scatter by 0.54 m in the first and 0.56 m in the second log: Gaussian
(kurtosis 3.04), and independent, the correlation of two ranges of a beacon being below 0.03 at every time between them.
`noise=others` states for each log what the other one tells.

Until the robots move, for 45 and 17 s, the gyro of the first turns by 1e-5 rad/s and that of the second by -0.0070:
`gyro` takes that off, as no robot turns on wheels that stand. By GPS, the distance along the path is off by 0.05 m per
root metre in both, over 5 to 300 m, and across by 0.02 to 0.05. Turns, with what the gyro had at rest taken off, are
off by 0.0069 and 0.0084 rad per root second over 20 s, 0.0054 and 0.0139 over 40 s, beyond the scatter of courses; the
second gyro still drifts by 0.0014 rad/s. One setting for both is `turn`, the root mean square of all four, rounded up.
The headings of GT are not used: those of the first log are the odometry's own, those of the second point backwards. The
true heading is the course of GPS.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Prior, Systematic, Truth
from ...core.options import option
from ...core.partial import RANGE, PartialTable
from ...core.se2 import Array, wrap
from ...core.table import LARGEST
from ...frontend.wheels.encoder import Floors, compose, roll
from ..courses import GAP, courses
from ..formats import gtsam_text
from ..noise.model import Model
from ..noise.noise_file import read_noise
from ..noise.stated import stated
from ..noise.systematic import Systematic as Errors
from ..registry import Source

OTHERS = "others"
MEASURED = Path(__file__).parent / "noise"
"""What `make plaza-noise` measures on each of the logs."""

NO_ERRORS = Errors()

COLUMNS = {"DR": 3, "DRp": 4, "TD": 4, "GT": 4, "TL": 3}
STILL = 0.02  # m/s of wheels that stand
EVERY = 1.0  # s, the longest time between steps
FLOORS = Floors(1e-3, 1e-4)  # m and rad, of a step's motion: between some ranges there is 1 ms
START_SD = (1e-3, 1e-3, 0.1)  # m, m, rad: once the robots move, their courses are 0.02 and 0.17 rad off that of DRp


@dataclass(frozen=True)
class Options:
    """Which log, its noise, and what is known of the ranges."""

    log: int = option(1, "the log: 1 of 32 minutes, 2 of 7", minimum=1, maximum=2)
    path: str | None = option(None, "another file of that format; not given: the one that ships with GTSAM")
    scale: float = option(1.0, "known scale of the ranges, which are divided by it", minimum=0.5, maximum=2.0)
    range_scale: float = option(
        0.1, "standard deviation of a scale of the ranges that is not known; 0: none", minimum=0.0, maximum=1.0
    )
    range_offset: float = option(0.0, "likewise of a constant offset, m", minimum=0.0, maximum=100.0)
    wheel_scale: float = option(
        0.0, "standard deviation of a scale of the wheels that is not known; 0: none", minimum=0.0, maximum=1.0
    )
    each: bool = option(False, "every beacon has a scale and an offset of its own")
    range_sd: float = option(0.55, "standard deviation of a range, m", minimum=1e-3, maximum=100.0)
    forward: float = option(0.05, "motion noise along the body, m per root metre", minimum=1e-6, maximum=10.0)
    lateral: float = option(0.03, "motion noise across the body, m per root metre", minimum=1e-6, maximum=10.0)
    gyro: bool = option(True, "take off the turn rate that the gyro has while the wheels stand still at the start")
    turn: float = option(0.01, "noise of the turn, rad per root second", minimum=1e-6, maximum=3.0)
    noise: str | None = option(
        None,
        "a file of bench noise --save, of which the ranges' noise is stated; others: as measured on the other log, "
        "without their scale",
    )


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Plaza 1 and 2: a mower among four radio beacons, 3,527 or 1,816 ranges alone, all 7 % too long; truth is GPS."""
    path = _file(options)
    tables = _tables(path)
    motions, start = tables["DR"], tables["DRp"][0]
    offset = _offset(motions, start[0]) if options.gyro else 0.0
    motions = motions - np.column_stack(
        (np.zeros((len(motions), 2)), offset * np.diff(motions[:, 0], prepend=start[0]))
    )
    seen, dropped = _ranges(path, tables["TD"], start[0], motions[-1, 0])
    t = _steps(np.concatenate((start[:1], seen[:, 0], motions[-1:, 0])))
    delta, delta_cov = _motions(t, start[0], motions, options)
    known = tables["TL"]
    poses, covered = courses(tables["GT"][:, :3], t)
    prior = Prior(
        np.append(start[1:3], wrap(start[3])),
        np.diag(np.square(START_SD)),
        systematic=Systematic(
            options.range_scale, options.range_offset, each=options.each, wheel_scale=options.wheel_scale
        ),
    )
    count = len(seen)
    partial = PartialTable.from_arrays(
        len(t),
        np.searchsorted(t, seen[:, 0]),
        seen[:, 2].astype(np.int64),
        np.full(count, RANGE),
        seen[:, 3] / options.scale,
        np.full(count, options.range_sd**2),
    )
    settings = asdict(options)
    del settings["path"], settings["noise"]
    notes = {
        "source": f"{path.name} as shipped with GTSAM; Djugash, Hamner and Roth, Carnegie Mellon University, 2009",
        "licence": "none stated for the recording; GTSAM's copy is distributed under GTSAM's BSD licence",
        "truth": f"RTK GPS, interpolated between fixes up to {GAP} s apart; the heading is its course",
        "covariances": "none in the file; made of the settings, the motion's in the body frame before it",
        "dropped": {"ranges of a beacon at the time of another": dropped},
        "settings": settings,
    }
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2))
    log = Log.from_arrays(f"plaza{options.log}", prior, t, delta, delta_cov, *nothing, partial=partial, notes=notes)
    places = Map(known[:, 0].astype(np.int64), known[:, 1:].copy(), None)
    if options.noise is not None:
        log = stated(log, _noise(options))
    return Dataset(log, Truth(t[covered], poses[covered], places, words="GPS"))


def _noise(options: Options) -> Model:
    """The noise of ranges to state. Errors that stay are left to be found."""
    return read_noise(_noise_file(options))._replace(odometry=None, bearing=None, systematic=NO_ERRORS)


def _noise_file(options: Options) -> Path:
    """A given file, or that of the other log."""
    return MEASURED / f"plaza-{3 - options.log}.toml" if options.noise == OTHERS else Path(str(options.noise))


def _file(options: Options) -> Path:
    return gtsam_text.shipped(f"Plaza{options.log}_.mat") if options.path is None else Path(options.path)


def _files(options: Options) -> Sequence[Path]:
    return [_file(options)] if options.noise is None else [_file(options), _noise_file(options)]


source = Source(make, Options, files=_files)


def _tables(path: Path) -> dict[str, Array]:
    """The tables of a file; InputError where it is none of these."""
    from scipy.io import loadmat

    if not path.is_file():
        raise InputError(f"{path}: there is no such file, expected one of Matlab with {', '.join(COLUMNS)}.")
    try:
        found = loadmat(path, variable_names=list(COLUMNS))
    except Exception as error:  # a damaged file raises almost any exception
        said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise InputError(f"{path}: is damaged or no file of Matlab ({said}).") from None
    tables = dict[str, Array]()
    for name, columns in COLUMNS.items():
        table = found.get(name)
        if not isinstance(table, np.ndarray) or table.ndim != 2 or table.shape[1] != columns or not len(table):
            raise InputError(f"{path}: found no table {name} of {columns} columns, expected one.")
        tables[name] = _numbers(path, name, table)
    for name in ("DR", "GT"):
        for row in np.flatnonzero(np.diff(tables[name][:, 0]) <= 0) + 1:
            late = f"t is {tables[name][row, 0]!s}, expected later than {tables[name][row - 1, 0]!s}"
            raise InputError(f"{path}: {name} row {row}: {late}.")
    return tables


def _numbers(path: Path, name: str, table: np.ndarray) -> Array:
    if table.dtype.kind not in "iuf":
        raise InputError(f"{path}: {name} is of type {table.dtype}, expected numbers.")
    rows = table.astype(np.float64)
    for row, column in np.argwhere(~(np.abs(rows) <= LARGEST)):
        found = f"found {rows[row, column]!s}, expected a number, at most {LARGEST:g}"
        raise InputError(f"{path}: {name} row {row}: {found}.")
    return rows


def _ranges(path: Path, table: Array, start: float, end: float) -> tuple[Array, int]:
    """The rows of TD in order of time, the first of a beacon at a time; and how many others there are."""
    for row in np.flatnonzero((table[:, 3] <= 0) | (table[:, 2] < 0) | (table[:, 2] % 1 != 0)):
        found = f"found id {table[row, 2]:g} and range {table[row, 3]!s}"
        raise InputError(f"{path}: TD row {row}: {found}, expected a whole id and a range above 0.")
    for row in np.flatnonzero((table[:, 0] < start) | (table[:, 0] > end)):
        expected = f"expected {start!s} to {end!s}, as odometry has"
        raise InputError(f"{path}: TD row {row}: t is {table[row, 0]!s}, {expected}.")
    rows = table[np.lexsort((table[:, 2], table[:, 0]))]
    again = np.concatenate(([False], (np.diff(rows[:, [0, 2]], axis=0) == 0).all(axis=1)))
    return rows[~again], int(again.sum())


def _steps(times: Array) -> Array:
    """(n,) s: the times, and evenly spaced ones wherever they are more than EVERY apart."""
    at = np.unique(times)
    pieces = np.ceil(np.diff(at) / EVERY * (1 - 1e-9)).astype(int)
    return np.unique(np.concatenate([np.linspace(a, b, n + 1) for a, b, n in zip(at, at[1:], pieces, strict=False)]))


def _offset(rows: Array, start: float) -> float:
    """rad/s, the mean turn rate of rows of DR until the wheels move at more than STILL."""
    dt = np.diff(rows[:, 0], prepend=start)
    moves = np.flatnonzero(np.abs(rows[:, 1]) > STILL * dt)
    first = int(moves[0]) if len(moves) else len(rows)
    return float(rows[:first, 2].sum() / dt[:first].sum()) if first else 0.0


def _motions(t: Array, start: float, rows: Array, options: Options) -> tuple[Array, Array]:
    """(n, 3) and (n, 3, 3): the motion up to each step and its covariance; row 0 is not used."""
    read = np.concatenate(([start], rows[:, 0]))
    edges = np.union1d(t, read)
    row = np.clip(np.searchsorted(read, edges[1:]) - 1, 0, len(rows) - 1)
    dt = np.diff(edges)
    rolling = rows[row, 1:] * (dt / np.diff(read)[row])[:, None]
    pieces, _ = roll(rolling, "arc")
    way = np.abs(rolling[:, 0])
    cov = np.zeros((len(dt), 3, 3))
    cov[:, 0, 0], cov[:, 1, 1] = options.forward**2 * way, options.lateral**2 * way
    cov[:, 2, 2] = options.turn**2 * dt
    delta, delta_cov = np.zeros((len(t), 3)), np.zeros((len(t), 3, 3))
    first = np.searchsorted(edges, t)
    for k in range(1, len(t)):
        between = slice(first[k - 1], first[k])
        delta[k], delta_cov[k] = compose(pieces[between], cov[between], FLOORS)
    return delta, delta_cov

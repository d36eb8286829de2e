"""Draws the panels beside a log's map: along its time, and of its sensor."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.ticker import MaxNLocator

from ...core.factors import UNKNOWN, Log, Truth
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.errors import sighting_errors
from ..drawing.axes import stretches
from ..measure.stated_noise import typical
from ..words.numerals import TIMES, number
from ..words.styles import COLOURS
from .numbers import empty_runs, sightings_a_step, times
from .part_errors import PartErrors
from .revisits import Returns

INK = "#222222"
FIRST, AGAIN, SOFT, EMPTY = COLOURS[0], COLOURS[1], COLOURS[4], "#f3d9cc"

STRETCHES = 300  # of the log's time, in a curve
COLUMNS, ROWS = 420, 150  # cells of the picture of returns, each coloured where any sighting falls into it
LONG = 0.004  # share of the log from which on a stretch without sightings is shaded

MOST_DOTS = 4_000

BINS = 12  # of ranges, with equally many sightings each
DEGREES, INTO = "degrees", 180 / np.pi  # of an angle in rad

LEAST_BIN = 8  # sightings; a bin with fewer shows no error


def seen(axes: Axes, log: Log) -> None:
    """Draws sightings per step along the log, with stretches without one shaded."""
    t = _time(log)
    count = sightings_a_step(log).astype(float)
    middle, mean = stretches(t, count, STRETCHES)
    runs = empty_runs(log)
    half = np.concatenate((np.diff(t) / 2, np.zeros(1)))
    before = np.concatenate((np.zeros(1), np.diff(t) / 2))
    shaded = 0
    for first, last in runs:
        start, end = float(t[first] - before[first]), float(t[last] + half[last])
        if end - start >= LONG * max(t[-1], 1e-9) and shaded < STRETCHES:
            axes.axvspan(start, end, color=EMPTY, linewidth=0, zorder=0)
            shaded += 1
    averaged = len(t) > STRETCHES
    axes.fill_between(middle, 0, mean, color=FIRST, alpha=0.35, linewidth=0, step=None if averaged else "mid")
    axes.plot(middle, mean, color=FIRST, linewidth=0.9, drawstyle="default" if averaged else "steps-mid")
    _along(axes, log)
    axes.set_ylim(0, max(1.0, 1.08 * float(np.nanmax(mean))))
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=not 0 < float(np.nanmax(mean)) < 2))
    shade = "; shaded: nothing seen" if shaded else ""
    axes.set_title(f"Sightings per step{', mean' if averaged else ''}{shade}")


def returns(axes: Axes, log: Log, found: Returns) -> None:
    """Draws the landmarks seen over time; with loop closures alone, the pairs of steps."""
    t = _time(log)
    parts = _parts_seen(log)
    if len(found.row):
        came = f"orange: again after {number(found.after)} m without it" if found.visit.any() else "no returns"
        _raster(axes, t, found, f"; {came}")
    elif len(log.loop_to):
        axes.plot(t[log.loop_step], t[log.loop_to], ".", color=AGAIN, markersize=3, markeredgewidth=0)
        axes.plot([t[0], t[-1]], [t[0], t[-1]], color=INK, linewidth=0.6)
        axes.set_ylim(t[0], max(t[-1], 1e-9))
        axes.set_ylabel("earlier step seen" if times(log) is None else "time of the step seen, s")
        axes.set_title("Loop closures; far below the line: a large loop")
    elif len(parts.row):
        _raster(axes, t, parts, ", in part")
    else:
        axes.set_yticks([])
        unnamed = log.partial is not None and len(log.partial)
        _nothing(axes, "no sighting has an id" if unnamed else "no landmark is sighted, so there is no return")
        axes.set_title("When each landmark was seen")
    _along(axes, log)


def _parts_seen(log: Log) -> Returns:
    """The ranges and bearings alone that have an id; none of them is taken for a return."""
    table = log.partial
    row = np.zeros(0, np.int64) if table is None else np.flatnonzero(table.ids != UNKNOWN)
    if table is None or not len(row):
        return Returns(row, row, row, row, row, np.zeros(0, bool), 0.0)
    _, first, landmark = np.unique(table.ids[row], return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    nothing = np.zeros(len(row), np.int64)
    return Returns(row, table.step[row], rank[landmark], nothing, nothing - 1, nothing > 0, 0.0)


def sensor(axes: Axes, log: Log) -> None:
    """Draws where landmarks are seen from the robot, ahead being up; of parts alone, their ranges or bearings."""
    z = log.z
    if not len(z) and log.partial is not None:
        _parts(axes, log.partial)
        return
    axes.set_title("Where it sees, ahead is up")
    if not len(z):
        _nothing(axes, "no sighting")
        axes.set_xticks([])
        axes.set_yticks([])
        return
    some = np.unique(np.linspace(0, len(z) - 1, min(len(z), MOST_DOTS)).astype(np.int64))
    ahead, left = z[some, 0] * np.cos(z[some, 1]), z[some, 0] * np.sin(z[some, 1])
    dots = float(np.clip(120 / np.sqrt(len(some)), 1.8, 6))
    axes.plot(-left, ahead, ".", color=FIRST, markersize=dots, alpha=0.45, markeredgewidth=0, rasterized=True)
    axes.plot(0, 0, "^", color=INK, markersize=8)
    far = float(np.percentile(z[:, 0], 99.5))
    inside = z[some, 0] <= far
    low = min(0.0, float(ahead[inside].min())) - 0.08 * far
    wide = 1.08 * max(float(np.abs(left[inside]).max()), 0.4 * far)
    axes.set_xlim(-wide, wide)
    axes.set_ylim(low, 1.05 * max(float(ahead[inside].max()), 0.2 * far))
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    axes.set_xlabel("left and right, m")
    axes.set_ylabel("ahead, m")


def _parts(axes: Axes, found: PartialTable) -> None:
    """Draws how many ranges alone there are of each length, or else how many bearings of each direction."""
    ranges = found.z[found.kind == RANGE]
    name, unit = ("Ranges", "m") if len(ranges) else ("Bearings", "degrees to the left")
    values = ranges if len(ranges) else np.degrees(found.z)
    axes.hist(values, bins=min(30, max(5, len(values) // 20)), color=FIRST, alpha=0.6)
    axes.set_title(f"{name} alone")
    axes.set_xlabel(f"{name.lower()[:-1]}, {unit}")
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))


def part_noise(axes: Axes, table: PartialTable, wrong: PartErrors | None) -> None:
    """Draws stated noise of ranges alone over range, else of bearings alone over bearing, and their errors."""
    kind = RANGE if (table.kind == RANGE).any() else BEARING
    unit, along, scale = ("m", "range, m", 1.0) if kind == RANGE else (DEGREES, "bearing, degrees to the left", INTO)
    mine = table.kind == kind
    z = scale * table.z
    bins = int(np.clip(mine.sum() // LEAST_BIN, 1, BINS))
    edges = np.unique(np.quantile(z[mine], np.linspace(0, 1, bins + 1)))
    place = np.clip(np.searchsorted(edges, z, "right") - 1, 0, max(len(edges) - 2, 0))
    filled = np.unique(place[mine])
    middle = np.array([np.median(z[mine & (place == k)]) for k in filled])
    stated = np.array([scale * np.median(np.sqrt(table.var[mine & (place == k)])) for k in filled])
    marker = "" if len(filled) > 1 else "s"
    axes.plot(middle, stated, color=FIRST, linewidth=2.4, marker=marker, label=along.partition(",")[0] + " alone")
    highest = float(stated.max())
    axes.set_title("Its noise, as stated")
    if wrong is not None:
        errors = [scale * wrong.values[mine[wrong.row] & (place[wrong.row] == k)] for k in filled]
        actual = np.array([typical(one) if len(one) >= LEAST_BIN else np.nan for one in errors])
        against = "actual, from fitted places" if wrong.fitted else "actual, against truth"
        against += ", without scale and offset" if kind == RANGE and wrong.constant is not None else ""
        axes.plot(middle, actual, "o", markeredgecolor=FIRST, markerfacecolor="none", markersize=5, label=against)
        highest = max(highest, float(np.nanmax(actual, initial=0.0)))
        axes.set_title("Its noise, stated and actual")
    if kind == RANGE:
        axes.set_xlim(0, 1.05 * float(edges[-1]))
    axes.set_ylim(0, 1.45 * highest)
    axes.set_xlabel(along)
    axes.set_ylabel(f"standard deviation, {unit}")
    axes.legend(loc="upper left", handlelength=1.4, borderpad=0.1, labelspacing=0.25)


def noise(axes: Axes, log: Log, truth: Truth | None, *, medians: bool) -> None:
    """Draws stated noise of sightings over range, m, and errors against a truth, with `medians` of landmarks."""
    axes.set_title("Its noise, as stated")
    if not len(log.z):
        _nothing(axes, "no sighting")
        axes.set_xticks([])
        axes.set_yticks([])
        return
    bins = int(np.clip(len(log.z) // LEAST_BIN, 1, BINS))
    edges = np.unique(np.quantile(log.z[:, 0], np.linspace(0, 1, bins + 1)))
    place = np.clip(np.searchsorted(edges, log.z[:, 0], "right") - 1, 0, max(len(edges) - 2, 0))
    filled = np.unique(place)
    middle = np.array([np.median(log.z[place == k, 0]) for k in filled])
    wrong = _errors(log, truth)
    sd = np.sqrt(np.einsum("kii->ki", log.z_cov))
    stated = np.column_stack((sd[:, 0], log.z[:, 0] * sd[:, 1]))
    highest = 0.0
    parts = ((0, FIRST, "-", "in range"), (1, COLOURS[2], (0, (2, 2)), f"across: range {TIMES} bearing"))
    for column, colour, dash, name in parts:
        line = np.array([np.median(stated[place == k, column]) for k in filled])
        marker, width = ("" if len(filled) > 1 else "s"), 2.4 if column == 0 else 1.5
        axes.plot(middle, line, color=colour, linestyle=dash, linewidth=width, marker=marker, label=name)
        highest = max(highest, float(line.max()))
        if wrong is None:
            continue
        row, errors = wrong
        mine = [errors[place[row] == k, column] for k in filled]
        actual = np.array([typical(one) if len(one) >= LEAST_BIN else np.nan for one in mine])
        axes.plot(middle, actual, "o", markeredgecolor=colour, markerfacecolor="none", markersize=5)
        highest = max(highest, float(np.nanmax(actual, initial=0.0)))
    if wrong is not None:
        against = "actual, from median places" if medians else "actual, against truth"
        axes.plot([], [], "o", markeredgecolor=INK, markerfacecolor="none", markersize=5, label=against)
        axes.set_title("Its noise, stated and actual")
    axes.set_xlim(0, 1.05 * float(edges[-1]))
    axes.set_ylim(0, 1.45 * highest)
    axes.set_xlabel("range, m")
    axes.set_ylabel("standard deviation, m")
    axes.legend(loc="upper left", handlelength=1.4, borderpad=0.1, labelspacing=0.25)


def _errors(log: Log, truth: Truth | None) -> tuple[Ints, Array] | None:
    """The sightings with a known error, and these errors (m, 2) in m: in range, and across."""
    if truth is None:
        return None
    found = sighting_errors(log, truth)
    if len(found.row) < LEAST_BIN:
        return None
    return found.row, np.column_stack((found.values[:, 0], log.z[found.row, 0] * found.values[:, 1]))


def _raster(axes: Axes, t: Array, found: Returns, came: str) -> None:
    landmarks = int(found.rank.max()) + 1
    columns, rows = min(COLUMNS, len(t)), min(ROWS, landmarks)
    length = max(float(t[-1]), 1e-9)
    column = np.minimum((t[found.step] / length * columns).astype(np.int64), columns - 1)
    row = found.rank * rows // landmarks
    cells = np.full((rows, columns), np.nan)
    back = found.visit > 0
    cells[row[back], column[back]] = 1.0
    cells[row[~back], column[~back]] = 0.0  # last: in a large log a cell holds both, and first visits are the few
    axes.imshow(
        np.ma.masked_invalid(cells),
        cmap=ListedColormap([FIRST, AGAIN]),
        vmin=0,
        vmax=1,
        aspect="auto",
        origin="lower",
        extent=(0, length, 0.5, landmarks + 0.5),
        interpolation="none",
        zorder=2,
    )
    axes.set_ylabel("landmark, by first sighting")
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True, min_n_ticks=1))
    axes.set_title(f"When each landmark was seen{came}")


def _along(axes: Axes, log: Log) -> None:
    t = _time(log)
    axes.set_xlim(0, max(float(t[-1]), 1e-9))
    axes.set_xlabel("step" if times(log) is None else "time, s")


def _time(log: Log) -> Array:
    return log.t - log.t[0]


def _nothing(axes: Axes, words: str) -> None:
    axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", va="center", color="#777777")
    axes.grid(visible=False)

"""Axes that the figures share: stretches of a run, logarithmic axes in plain numbers, a legend above the plot."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ...core.se2 import Array
from ..words.numerals import plain

SIZES = (1e-100, 1e100)  # least and largest number that an axis can have: matplotlib multiplies them
LONGEST = 34  # characters of a label that a figure has room for


def short(label: str, longest: int = LONGEST) -> str:
    """Shortens the label, its middle left out where it is too long."""
    return label if len(label) <= longest else f"{label[: longest - 13]}…{label[-12:]}"


def labelled(figure: Figure, x: str, y: str, *, equal: bool = False) -> Axes:
    """Makes the only axes of a figure, `equal` for a map: a metre is as long along both."""
    axes = figure.subplots()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if equal:
        axes.set_aspect("equal", adjustable="datalim")
    return axes


def stretches(t: Array, values: Array, count: int) -> tuple[Array, Array]:
    """Averages `values` (n,) over `count` equal stretches of time, at their centres; NaN without a value."""
    if len(t) <= count:
        return t, values
    edges = np.linspace(t[0], t[-1], count + 1)
    place = np.clip(np.searchsorted(edges, t, "right") - 1, 0, count - 1)
    known = np.isfinite(values)
    number = np.bincount(place[known], minlength=count)
    total = np.bincount(place[known], values[known], minlength=count)
    means = np.full(count, np.nan)
    np.divide(total, number, out=means, where=number > 0)
    return (edges[:-1] + edges[1:]) / 2, means


def fits(value: float) -> bool:
    """True for a positive number that a logarithmic axis can have."""
    return SIZES[0] <= value <= SIZES[1]


def drawable(values: Array) -> Array:
    """The values with NaN for those that no axis can have: infinite, or beyond SIZES."""
    sizes = np.abs(values)
    return np.where((sizes == 0) | ((sizes >= SIZES[0]) & (sizes <= SIZES[1])), values, np.nan)


def logarithmic(axis: str, axes: Axes, low: float, high: float) -> None:
    """Makes "x" or "y" logarithmic over low to high with plain ticks; leaves it linear if low is not above 0."""
    if not SIZES[0] <= low <= high <= SIZES[1]:
        return
    low, high = low / 1.3, high * 1.3
    if high < 12 * low:  # room for at least a decade, or there are too few ticks
        low, high = np.sqrt(low * high / 12), np.sqrt(low * high * 12)
    if axis == "x":
        axes.set_xscale("log")
        axes.set_xlim(low, high)
    else:
        axes.set_yscale("log")
        axes.set_ylim(low, high)
    which = axes.xaxis if axis == "x" else axes.yaxis
    decades = np.log10(high / low)
    which.set_major_locator(
        LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,), numticks=5 if axis == "x" else 9)
    )
    which.set_major_formatter(FuncFormatter(lambda value, _: plain(value)))
    which.set_minor_locator(NullLocator())


def fitted(axis: str, axes: Axes, values: Iterable[float]) -> None:
    """Makes the axis logarithmic over the positive ones of `values`; a "y" over five decades at most."""
    positive = [value for value in values if fits(value)]
    if positive:
        high = max(positive)
        low = min(positive) if axis == "x" else max(min(positive), 1e-5 * high)
        logarithmic(axis, axes, low, high)


def legend_columns(labels: Iterable[str], width: float) -> int:
    """Returns how many names fit beside each other in `width` points."""
    return int(np.clip(width // (28 + 4.2 * max(len(short(label)) for label in labels)), 1, 4))


def legend(figure: Figure, axes: Axes, columns: int) -> None:
    """Adds a legend above the axes, each entry with its backend's mark."""
    handles, labels = axes.get_legend_handles_labels()
    names = [short(label) for label in labels]
    tight: dict[str, Any] = {"borderpad": 0.1, "borderaxespad": 0, "columnspacing": 1.2, "handlelength": 2.2}
    made = figure.legend(handles, names, loc="upper left", ncols=columns, **tight)
    for handle, key, text in zip(handles, made.legend_handles, made.get_texts(), strict=True):
        gid = _gid(handle)
        if key is not None and gid is not None:
            key.set_gid(gid)
            text.set_gid(gid)


def _gid(handle: Any) -> str | None:
    return handle.get_gid() if isinstance(handle, Artist) else _gid(handle[0])

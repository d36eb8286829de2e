"""Writes a figure as a file, in the plain style that all figures share."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure

from ...core.files import replaced

KINDS = (".png", ".svg", ".pdf")  # formats, by the ending of a picture's name

PLAIN: Mapping[str, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "text.parse_math": False,  # a label may hold dollar signs
}
"""the style of every figure, in a file or on a page"""

GRID: Mapping[str, Any] = {"axes.grid": True, "axes.axisbelow": True, "grid.color": "#e6e6e6", "grid.linewidth": 0.6}
"""the style of those with a grid"""

_STYLE: dict[str, Any] = {**PLAIN, "font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left"}
_DATE = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


@contextmanager
def picture(path: Path, size: tuple[float, float], more: Mapping[str, Any] | None = None) -> Generator[Figure]:
    """Yields a figure of `size` (inches), then writes it to `path`, whole, in the format of its suffix."""
    kind = path.suffix.lower()
    with style.context(["default", _STYLE | dict(more or {})]), replaced(path) as part:
        figure = Figure(figsize=size, layout="constrained")
        yield figure
        figure.savefig(part, format=kind.removeprefix("."), dpi=120, metadata=_DATE[kind])

"""Figures as lean SVG text that takes its ink and paper from the page it stands on.

Nothing of matplotlib's global state is touched: its own defaults and the style below hold while a figure is drawn.
"""

import io
import re
import warnings
from collections.abc import Callable
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure

from .picture import GRID, PLAIN

INK, RULE, PAPER = "#010203", "#040506", "#070809"
"""Stand-ins for the colours of the page: they are replaced once the figure is text."""

FONT = "system-ui, sans-serif"

_ON_PAGE = {INK: "currentColor", RULE: "var(--rule)", PAPER: "var(--paper)"}
_ALONE = {INK: "#222222", RULE: "#dddddd", PAPER: "#ffffff"}

_STYLE: dict[str, Any] = {
    **PLAIN,
    **GRID,
    "svg.fonttype": "none",  # text stays text
    "path.simplify_threshold": 0.3,  # points; thins what cannot be seen
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": RULE,
    "lines.linewidth": 1.3,
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
}


def drawn(name: str, width: float, height: float, draw: Callable[[Figure], None]) -> str:
    """The figure that `draw` makes, width x height in points, as SVG with stand-in colours; the same text every time.

    `name` keeps its marks apart from those of other figures on a page.
    """
    with style.context(["default", _STYLE | {"svg.hashsalt": name}]), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # matplotlib only measures; the reader has more fonts
        figure = Figure((width / 72, height / 72), layout="constrained")
        draw(figure)
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return _lean(text.getvalue())


def on_page(svg: str) -> str:
    """As an element of an HTML page: the page's colours, no name space."""
    return _coloured(svg.replace(' xmlns="http://www.w3.org/2000/svg"', ""), _ON_PAGE)


def alone(svg: str) -> str:
    """As a file: dark on a white card."""
    card = re.sub(r"(<svg[^>]*>)", rf'\1<rect width="100%" height="100%" fill="{PAPER}"/>', svg, count=1)
    return _coloured(card, _ALONE) + "\n"


def _lean(svg: str) -> str:
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<defs>\s*<style.*?</style>\s*</defs>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"font-family: [^;\"]*", f"font-family: {FONT}", svg)
    svg = re.sub(r"<[^>]+>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag[0]), svg)
    svg = re.sub(r'(?<=<g) id="(of-\d+)"', r' class="\1"', svg)
    svg = re.sub(r'(?<=<g) id="[^"]*"| xmlns:xlink="[^"]*"| transform="rotate\(-0 [^"]*"', "", svg)
    svg = svg.replace("xlink:href", "href").replace("<svg ", '<svg stroke-linejoin="round" ', 1)
    return re.sub(r"\s*\n\s*", " ", svg).replace("> <", "><").strip()


def _coloured(svg: str, colours: dict[str, str]) -> str:
    for stand_in, colour in colours.items():
        svg = svg.replace(stand_in, colour)
    return svg

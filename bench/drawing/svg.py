"""Draws figures as lean SVG text with stand-ins for the colours of its page.

matplotlib's global state stays untouched: its defaults and the style below hold while a figure is drawn.
"""

import io
import re
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure

from .picture import GRID, PLAIN

INK, RULE, PAPER = "#010203", "#040506", "#070809"  # stand-ins for the page's colours, replaced in the text

FONT = "system-ui, sans-serif"

EDGE = 3  # points that stay free around a figure
DPI = 300  # of a PNG for print
Draw = Callable[[Figure], None]  # draws on an empty figure
_BLUE = "#0072b2"  # the one colour that is too dark on a dark page, which has a --blue for it

_ON_PAGE = {_BLUE: f"var(--blue,{_BLUE})", INK: "currentColor", RULE: "var(--rule)", PAPER: "var(--paper)"}
_ALONE = {INK: "#222222", RULE: "#dddddd", PAPER: "#ffffff"}

_STYLE: dict[str, Any] = {
    **PLAIN,
    **GRID,
    "svg.fonttype": "none",  # text stays text
    "pdf.fonttype": 42,  # so does it in print, in fonts that journals take
    "path.simplify_threshold": 0.3,  # points; thins what cannot be seen
    "text.hinting": "none",  # else measured up to a tenth narrower than it is drawn
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 0,  # the grid says where they are, and every one would be three elements of a page
    "ytick.major.size": 0,
    "lines.linewidth": 1.3,
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
}
_PRINT_DATE: dict[str, dict[str, None]] = {"pdf": {"CreationDate": None}, "png": {}}


def drawn(name: str, width: float, height: float, draw: Draw) -> tuple[str, Figure]:
    """Draws a figure, width x height in points, as SVG with stand-in colours; the same text every time.

    Returns the figure, too, for the position of its axes. `name` keeps its ids apart from other figures' on a page.
    """
    with _figure(width, height, draw, {"svg.hashsalt": name, "grid.color": RULE, "figure.facecolor": PAPER}) as figure:
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return _lean(text.getvalue()), figure


def printed(width: float, height: float, draw: Draw, form: str) -> bytes:
    """Draws the figure on white, `form` being pdf or png; the same bytes every time."""
    with _figure(width, height, draw, {"grid.color": _ALONE[RULE], "figure.facecolor": _ALONE[PAPER]}) as figure:
        file = io.BytesIO()
        figure.savefig(file, format=form, dpi=DPI, metadata=_PRINT_DATE[form])
    return file.getvalue()


@contextmanager
def _figure(width: float, height: float, draw: Draw, more: dict[str, Any]) -> Generator[Figure]:
    with style.context(["default", _STYLE | more]), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # only measured here; the reader has more fonts
        figure = Figure((width / 72, height / 72))
        draw(figure)
        lay_out(figure)
        yield figure


def lay_out(figure: Figure) -> None:
    """Gives the figure's only axes all the room that labels and legend leave, in a third of matplotlib's time.

    Several axes stay where they are.
    """
    if len(figure.axes) > 1:
        return
    (axes,) = figure.axes
    room = figure.bbox.padded(-EDGE * figure.dpi / 72)
    top = sum(legend.get_window_extent().height for legend in figure.legends)
    outer = axes.get_tightbbox(bbox_extra_artists=[], for_layout_only=True)
    if outer is None:
        return
    inner = axes.get_window_extent()
    figure.subplots_adjust(
        (room.x0 + inner.x0 - outer.x0) / figure.bbox.width,
        (room.y0 + inner.y0 - outer.y0) / figure.bbox.height,
        (room.x1 + inner.x1 - outer.x1) / figure.bbox.width,
        (room.y1 + inner.y1 - outer.y1 - top) / figure.bbox.height,
    )


def on_page(svg: str) -> str:
    """Makes an element of an HTML page: the page's colours, no name space."""
    return _coloured(svg.replace(' xmlns="http://www.w3.org/2000/svg"', ""), _ON_PAGE)


def alone(svg: str) -> str:
    """Makes a standalone file, dark on a white card."""
    card = re.sub(r"(<svg[^>]*>)", rf'\1<rect width="100%" height="100%" fill="{PAPER}"/>', svg, count=1)
    return _coloured(card, _ALONE) + "\n"


def _lean(svg: str) -> str:
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<defs>\s*<style.*?</style>\s*</defs>", "", svg, flags=re.DOTALL)
    svg = re.sub(r" ?font-family: [^;\"]*;?", "", svg)
    svg = re.sub(r"<[^>]+>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag[0]), svg)
    svg = re.sub(r'(?<=<g) id="(of-\d+)"', r' class="\1"', svg)
    svg = re.sub(r'(?<=<g) id="[^"]*"| xmlns:xlink="[^"]*"| transform="rotate\(-0 [^"]*"', "", svg)
    svg = svg.replace(' style="image-rendering:crisp-edges;image-rendering:pixelated"', "")  # smooth where it is shrunk
    svg = svg.replace("xlink:href", "href").replace("<svg ", f'<svg stroke-linejoin="round" font-family="{FONT}" ', 1)
    svg = re.sub(r'<path d="[^"]*" style="fill: none"/>', "", svg)  # invisible backgrounds
    return _ungrouped(re.sub(r"\s*\n\s*", " ", svg).replace("> <", "><").strip())


def _ungrouped(svg: str) -> str:
    """Removes groups without attributes or content: half of all elements."""
    kept: list[bool] = []

    def tag(found: re.Match[str]) -> str:
        if found[0] == "</g>":
            return "</g>" if kept.pop() else ""
        kept.append(found[0] != "<g>")
        return found[0] if kept[-1] else ""

    return re.sub(r"<g(?=[ >])[^>]*>|</g>", tag, re.sub(r"<g(?: [^>]*)?/>", "", svg))


def _coloured(svg: str, colours: dict[str, str]) -> str:
    for stand_in, colour in colours.items():
        svg = svg.replace(stand_in, colour)
    return svg

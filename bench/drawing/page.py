"""Renders templates: pages of HTML that need no network, and Markdown."""

import base64
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..words.names import tags
from ..words.numerals import LARGEST
from ..words.styles import Look
from .figure import Axis, Plot
from .table import Table

TEMPLATES = Path(__file__).with_name("templates")

PURPOSES = {"online": "Online", "final": "The path afterwards", "map": "The map"}  # headings

GLYPHS = {
    "o": "M9 5a3 3 0 1 0 6 0a3 3 0 1 0-6 0",
    "s": "M9.3 2.3h5.4v5.4h-5.4z",
    "D": "M12 1.2l3.8 3.8-3.8 3.8-3.8-3.8z",
    "^": "M12 1.4l3.7 6.4h-7.4z",
    "v": "M12 8.6l3.7-6.4h-7.4z",
    "P": "M10.8 1.6h2.4v2.2h2.2v2.4h-2.2v2.2h-2.4v-2.2h-2.2v-2.4h2.2z",
    "X": "M9.7 1.2l2.3 2.2 2.3-2.2 1.5 1.5-2.2 2.3 2.2 2.3-1.5 1.5-2.3-2.2-2.3 2.2-1.5-1.5 2.2-2.3-2.2-2.3z",
    ".": "M10.4 5a1.6 1.6 0 1 0 3.2 0a1.6 1.6 0 1 0-3.2 0",
}
"""markers of figures as paths, in the middle of a sample of a line 24 wide and 10 high"""


def rendered(template: str, page: Mapping[str, Any]) -> str:
    """Renders the named template; what goes into one of HTML is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from .svg import alone, on_page

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=template.endswith(".html.jinja"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    filters: dict[str, Any] = {
        "md": _markdown, "on_page": on_page, "alone": alone, "tags": tags, "url": quote, "dashes": _dashes,
        "answers": answers, "worded": _worded, "sentence": lambda text: f"{text[:1].upper()}{text[1:]}",
        "base64": lambda content: base64.b64encode(content).decode(),
        "sortable": lambda value: "" if math.isnan(value) else f"{value:.9g}".replace("inf", "Infinity"),
    }  # fmt: skip
    environment.filters.update(filters)
    return environment.get_template(template).render({"glyphs": GLYPHS, "purposes": PURPOSES, **page})


def script(name: str) -> dict[str, str]:
    """The `text` of a script, and its `digest` for the page's content security policy."""
    text = f"\n{(TEMPLATES / name).read_text(encoding='utf-8')}"
    return {"text": text, "digest": f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"}


def answers(plot: Plot, looks: Mapping[str, Look]) -> str:
    """Encodes plot data as JSON that HTML takes unescaped; null where there is no value."""
    told = {
        "box": [round(edge, 1) for edge in plot.box],
        "x": _axis(plot.x),
        "y": _axis(plot.y),
        "timed": plot.timed,
        "curves": [
            {
                "of": looks[curve.label].place if curve.label in looks else -1,
                "label": curve.label,
                "final": curve.final,
                "x": _known(curve.x),
                "y": _known(curve.y),
                "t": _known(curve.t),
            }
            for curve in plot.curves
        ],
    }
    text = json.dumps(told, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _axis(axis: Axis) -> dict[str, Any]:
    return {"name": axis.name, "low": float(axis.low), "high": float(axis.high), "log": axis.log}


def _known(values: Sequence[float]) -> list[float | None]:
    """Converts to whole numbers where possible, and None where not finite."""
    return [None if not math.isfinite(v) else int(v) if v == int(v) and abs(v) < LARGEST else float(v) for v in values]


def _worded(table: Table) -> list[bool]:
    """Returns for each column whether it holds words alone."""
    return [all(row.entries[k].value is None for row in table.rows) for k in range(len(table.headings))]


def _dashes(look: Look) -> str:
    return "" if isinstance(look.dash, str) else " ".join(f"{length:g}" for length in look.dash[1])


def _markdown(text: object) -> str:
    """Escapes text for Markdown, on one line and inside a table too."""
    escaped = " ".join(str(text).replace("&", "&amp;").replace("<", "&lt;").split())
    return re.sub(r"([\\`*_\[\]|#$~])", r"\\\1", escaped)

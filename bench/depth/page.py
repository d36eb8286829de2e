"""Writes the page of a depth camera's drive, detection.html, and the picture of its clouds from above, map.png."""

import base64
import shlex
from pathlib import Path

import cv2

from ...core.files import write_whole
from ...frontend.maps.obstacles import HIGH
from ...frontend.maps.top_view import top_view
from ..camera.folder import MAP, PAGE
from ..drawing.map_picture import CELL, MOST, map_picture
from ..drawing.page import rendered
from ..words.numerals import number
from .findings import DepthFindings, advice, headline, left_out, places_turned_down, seconds, turned_down

WIDE = 800
"""px that a small map is enlarged to."""


def write_page(folder: Path, out: Path, findings: DepthFindings) -> None:
    """Writes both into `folder`, beside log.toml; the page calls the log by `out`."""
    from .figures import again_figure, height_figure, path_figure, tilt_figure

    f = findings
    view = top_view(f.clouds, f.path, CELL, MOST)
    picture = map_picture(view, f.path, max(1, WIDE // max(view.colours.shape)))
    _, encoded = cv2.imencode(".png", picture.image)
    content = encoded.tobytes()
    figures = [path_figure(f), tilt_figure(f), height_figure(f)]
    figures += [again_figure(f)] if len(f.again) else []
    page = {
        "f": f,
        "headline": headline(f),
        "advice": advice(f),
        "turned_down": turned_down(f),
        "places_turned_down": places_turned_down(f),
        "left_out": left_out(f),
        "seconds": number(seconds(f)),
        "figures": figures,
        "map": base64.b64encode(content).decode(),
        "picture": picture,
        "cell": view.size,
        "high": HIGH,
        "searched": f.log.notes["depth"]["loops"]["searched"],
        "places": f.log.notes["depth"]["loops"]["places"],
        "settings": (folder / "log.toml").read_text(encoding="utf-8"),
        "command": f"bench run --dataset {shlex.quote(str(out))}",
    }
    write_whole(folder / PAGE, rendered("depth.html.jinja", page))
    write_whole(folder / MAP, content)

"""Writes the page of matched scans, detection.html, and the picture of their map, map.png."""

import base64
import shlex
from pathlib import Path

import cv2

from ...core.files import write_whole
from ...frontend.maps.occupancy import occupancy
from ..camera.folder import MAP, PAGE
from ..drawing.map_picture import CELL, MOST, map_picture
from ..drawing.page import rendered
from ..words.numerals import number
from .findings import LaserFindings, advice, headline, seconds, turned_down


def write_page(folder: Path, out: Path, findings: LaserFindings) -> None:
    """Writes both into `folder`, beside log.toml; the page calls the log by `out`."""
    from .figures import loop_figure, path_figure

    f, picture = findings, map_picture(occupancy(findings.scans, findings.path, CELL, MOST), findings.path)
    _, encoded = cv2.imencode(".png", picture.image)
    content = encoded.tobytes()
    figures = [path_figure(f)]
    figures += [loop_figure(f)] if len(f.log.loop_to) else []
    page = {
        "f": f,
        "headline": headline(f),
        "advice": advice(f),
        "turned_down": turned_down(f),
        "seconds": number(seconds(f)),
        "figures": figures,
        "map": base64.b64encode(content).decode(),
        "picture": picture,
        "settings": (folder / "log.toml").read_text(encoding="utf-8"),
        "command": f"bench run --dataset {shlex.quote(str(out))}",
    }
    write_whole(folder / PAGE, rendered("laser.html.jinja", page))
    write_whole(folder / MAP, content)

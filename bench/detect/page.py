"""Writes the page of a detection, detection.html: one file that needs no network."""

import shlex
from pathlib import Path
from typing import Any

from ...core.files import write_whole
from ..drawing.map_picture import MapPicture
from ..drawing.page import rendered
from ..words.numerals import number
from .findings import Findings
from .pictures import encoded

PAGE, MAP, SHEET, NOISE = "detection.html", "map.png", "contact.png", "noise.toml"

FILES = (
    "log.toml", "odometry.csv", "sightings.csv", "loops.csv", "gyro.csv", "truth.tum", "landmarks.csv", "scans.npz",
    "clouds.npz", NOISE, MAP, SHEET,
)  # fmt: skip
"""All that a detection writes beside its page."""


def write_page(folder: Path, out: Path, findings: Findings) -> None:
    """Writes the page and the sensor's own files into `folder`, beside log.toml; the page calls the log by `out`."""
    page = {
        "f": findings,
        **findings.shown(folder),
        "headline": findings.sentences(),
        "number": number,
        "figures": findings.figures(),
        "command": f"bench run --dataset {shlex.quote(str(out))}",
        "settings": (folder / "log.toml").read_text(encoding="utf-8"),
        "files": [name for name in FILES if (folder / name).is_file()],
    }
    write_whole(folder / PAGE, rendered(findings.template, page))


def write_map(folder: Path, picture: MapPicture) -> dict[str, Any]:
    """Writes the map into `folder`; returns what a template shows of it."""
    content = encoded(picture.image, ".png")
    (folder / MAP).write_bytes(content)
    return {"picture": picture, "map": content}

"""The report of a detection: detection.html, one page in one file that needs no network, and contact.png."""

import base64
import shlex
from collections.abc import Sequence
from pathlib import Path

from ...frontend.files import write_whole
from ..drawing.page import rendered
from ..words.numerals import number
from .kept_frames import Picture, encoded, sheet
from .noise_calibration import HONEST, toml
from .summary import Findings, headline, left_out, marker_rows

PAGE, SHEET = "detection.html", "contact.png"


def write_detection_report(folder: Path, out: Path, findings: Findings, pictures: Sequence[Picture]) -> None:
    """Write both into `folder`, where log.toml is already; the page calls the log by `out`, where it will be."""
    from .figures import path_figure, seen_figures, true_figures

    f = findings
    figures = list(seen_figures(f.sightings, f.t, f.max_range)) if len(f.sightings.ids) else []
    if f.true is not None and f.bins:
        figures += true_figures(f.sightings, f.true)
    figures.append(path_figure(f.log, f.truth))
    page = {
        "f": f,
        "headline": headline(f),
        "left_out": left_out(f.log),
        "markers": marker_rows(f),
        "figures": figures,
        "pictures": [(one, base64.b64encode(encoded(one.image, ".jpg")).decode()) for one in pictures],
        "noise": toml(f.calibration) if f.calibration else "",
        "honest": HONEST,
        "number": number,
        "settings": (folder / "log.toml").read_text(encoding="utf-8"),
        "command": f"bench run --dataset {shlex.quote(str(out))}",
    }
    write_whole(folder / PAGE, rendered(f"{PAGE}.jinja", page))
    if pictures:
        (folder / SHEET).write_bytes(encoded(sheet(list(pictures)), ".png"))

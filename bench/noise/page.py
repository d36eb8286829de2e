"""Writes the page of a log's noise."""

from pathlib import Path

from ...core.files import write_whole
from ..drawing.page import rendered
from .figures import figures
from .measured import Noise
from .words import rows, sentences


def write_page(path: Path, noise: Noise) -> None:
    """Writes one HTML page that needs no network, whole or not at all."""
    lead, *rest = sentences(noise)
    page = {
        "labels": noise.labels,
        "lead": lead,
        "sentences": rest,
        "remarks": noise.remarks,
        "rows": list(rows(noise)),
        "figures": figures(noise),
    }
    write_whole(path, rendered("noise.html.jinja", page))

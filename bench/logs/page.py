"""A log's picture and numbers as one HTML page that needs no network."""

import base64
import tempfile
from pathlib import Path

from ...frontend.files import write_whole
from ..drawing.page import rendered
from .facts import facts, headline, noted
from .picture import Subject, write_picture


def write_page(path: Path, subject: Subject) -> None:
    """Write it, whole or not at all."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "log.png"
        write_picture(picture, subject)
        content = base64.b64encode(picture.read_bytes()).decode()
    page = {
        "label": subject.label,
        "headline": headline(subject.numbers),
        "facts": list(facts(subject.numbers, subject.shown.words)),
        "notes": noted(subject.dataset.log.notes, settings=True),
        "picture": content,
    }
    write_whole(path, rendered("log.html.jinja", page))

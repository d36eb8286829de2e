"""A published log brought onto this machine: from its publisher, from an address the user gives, or from a file.

Every address is tried in order. What arrives is checked before anything is put in place, and what was there stays until
then. Where nothing helps, the sentence says what was found where, and how to do it by hand.
"""

import html
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urljoin

from ...frontend.errors import InputError
from . import installed
from .catalogue import PUBLISHED
from .download import Watch, downloaded
from .unpack import NotFound

HREF = re.compile(r"""href\s*=\s*["']?([^"'\s>]+)""", re.IGNORECASE)


def fetch(name: str, watch: Watch, *, url: str | None = None, again: bool = False) -> installed.Arrival | None:
    """Bring the published log `name` from its publisher, or from `url`; None where it is here already.

    `again`: even then. Raises InputError with what every address answered, and with the way by hand.
    """
    if installed.here(name) and not again:
        return None
    answers: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for address in [url] if url else _addresses(name, Path(folder), watch, answers):
            try:
                return installed.install(name, downloaded(address, Path(folder), watch), address)
            except NotFound as error:
                answers.append(str(error))
    log, listed = PUBLISHED[name], "".join(f"\n  {answer}" for answer in answers)
    known = "" if url else f"About these addresses: {log.addresses}.\n"
    by_hand = f"By hand: open {log.page} , {log.by_hand}, then: bench fetch {name} --from FILE."
    raise InputError(f"{name} could not be fetched:{listed}\n{known}{by_hand}")


def take(name: str, source: Path) -> installed.Arrival:
    """Put the published log `name` in its place out of the file or folder `source`. Raises InputError and OSError."""
    source = Path(os.path.abspath(source))  # what `.` is called may tell what it holds
    expected = f"expected a file or folder with {PUBLISHED[name].title}"
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder; {expected}.")
    if not (source.is_file() or source.is_dir()):  # a pipe may never end, nor even begin
        raise InputError(f"{source}: a pipe, a socket or a device; {expected}.")
    return installed.install(name, source, str(source))


def _addresses(name: str, folder: Path, watch: Watch, answers: list[str]) -> Iterator[str]:
    """The addresses to be tried; where pages are known, those that they link to. Joins to `answers` what pages say."""
    log = PUBLISHED[name]
    if not log.link:
        yield from log.urls
        return
    for page in log.urls:
        try:
            text = downloaded(page, folder, watch).read_text(encoding="utf-8", errors="replace")
        except NotFound as error:
            answers.append(str(error))
            continue
        links = dict.fromkeys(urljoin(page, html.unescape(link)) for link in HREF.findall(text))
        matching = [link for link in links if re.search(log.link, link, re.IGNORECASE)]
        if not matching:
            answers.append(f"{page}: no link to the archive was recognised on it.")
        yield from matching

"""Fetches a published log: from its publisher, from an address the user gives, or from a file.

Addresses are tried in order. Downloads are verified before an earlier copy is replaced. If all fail, the error lists
the results, and how to do it by hand.
"""

import html
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urljoin

from ...core.errors import InputError
from . import installed
from .catalogue import FILE, PUBLISHED
from .download import Watch, downloaded
from .unpack import NotFound, check_page

HREF = re.compile(r"""href\s*=\s*["']?([^"'\s>]+)""", re.IGNORECASE)


def fetch(name: str, watch: Watch, *, url: str | None = None, again: bool = False) -> installed.Arrival | None:
    """Fetches the published log `name` from its publisher, or from `url`; None if it is here already.

    `again`: even then. Raises InputError with the result of every address, and the manual way.
    """
    if installed.here(name) and not again:
        return None
    answers: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for address in [url] if url else _addresses(name, Path(folder), watch, answers):
            try:
                return installed.install(name, _arrived(name, address, Path(folder), watch), address)
            except NotFound as error:
                answers.append(str(error))
    log, listed = PUBLISHED[name], "".join(f"\n  {answer}" for answer in answers)
    known = "" if url else f"About these addresses: {log.addresses}.\n"
    by_hand = f"By hand: open {log.page} , {log.by_hand}, then: bench fetch {name} --from FILE."
    raise InputError(f"{name} could not be fetched:{listed}\n{known}{by_hand}")


def _arrived(name: str, address: str, folder: Path, watch: Watch) -> Path:
    """Downloads the archive at an address, or each file by itself, into the folder; returns it, or a folder of them."""
    if FILE not in address:
        return downloaded(address, folder, watch, PUBLISHED[name].largest)
    parts = folder / "parts"
    parts.mkdir(exist_ok=True)
    for file in PUBLISHED[name].files:
        url = address.replace(FILE, file)
        part = downloaded(url, folder, watch, PUBLISHED[name].largest)
        check_page(part, url)
        os.replace(part, parts / file)
    return parts


def take(name: str, source: Path) -> installed.Arrival:
    """Installs the published log `name` from the file or folder `source`. Raises InputError and OSError."""
    source = Path(os.path.abspath(source))  # the name behind `.` may identify the log
    expected = f"expected a file or folder with {PUBLISHED[name].title}"
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder; {expected}.")
    if not (source.is_file() or source.is_dir()):  # reading a pipe may block
        raise InputError(f"{source}: a pipe, a socket or a device; {expected}.")
    return installed.install(name, source, str(source))


def _addresses(name: str, folder: Path, watch: Watch, answers: list[str]) -> Iterator[str]:
    """Yields the addresses to try; from pages, their links. Appends errors of pages to `answers`."""
    log = PUBLISHED[name]
    if not log.link:
        yield from log.urls
        return
    for page in log.urls:
        try:
            text = downloaded(page, folder, watch, log.largest).read_text(encoding="utf-8", errors="replace")
        except NotFound as error:
            answers.append(str(error))
            continue
        links = dict.fromkeys(urljoin(page, html.unescape(link)) for link in HREF.findall(text))
        matching = [link for link in links if re.search(log.link, link, re.IGNORECASE)]
        if not matching:
            answers.append(f"{page}: found no link to the archive.")
        yield from matching

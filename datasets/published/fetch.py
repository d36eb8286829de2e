"""A published log brought onto this machine: from its publisher, from an address the user gives, or from a file.

Every address is tried in order. What arrives is checked before anything is put in place, and what was there stays until
then. Where nothing helps, the sentence says what was found where, and how to do it by hand.
"""

import html
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urljoin

from ...frontend.errors import InputError
from . import installed
from .catalogue import PUBLISHED
from .download import Watcher, downloaded
from .unpack import NotFound

HREF = re.compile(r"""href\s*=\s*["']?([^"'\s>]+)""", re.IGNORECASE)


class Arrival(NamedTuple):
    """What came: the sha256 of the archive (None: it was a folder) and that of each file."""

    archive: str | None
    files: dict[str, str]


def fetch(name: str, watcher: Watcher, *, url: str | None = None, again: bool = False) -> Arrival | None:
    """Bring the published log `name` from its publisher, or from `url`; None where it is here already.

    `again`: even then. Raises InputError with what every address answered, and with the way by hand.
    """
    answers: list[str] = []
    with installed.alone(name, watcher.says) as scratch:
        if installed.here(name) and not again:
            return None
        for address in [url] if url else _addresses(name, scratch, watcher, answers):
            try:
                return _arrived(name, downloaded(address, scratch, watcher), address, scratch)
            except NotFound as error:
                answers.append(str(error))
    log, listed = PUBLISHED[name], "".join(f"\n  {answer}" for answer in answers)
    known = "" if url else f"About these addresses: {log.addresses}.\n"
    by_hand = f"By hand: open {log.page} , {log.by_hand}, then: bench fetch {name} --from FILE."
    raise InputError(f"{name} could not be fetched:{listed}\n{known}{by_hand}")


def take(name: str, source: Path, watcher: Watcher) -> Arrival:
    """Put the published log `name` in its place out of the file or folder `source`. Raises InputError."""
    source = Path(os.path.abspath(source))  # what `.` is called may tell what it holds
    expected = f"expected a file or folder with {PUBLISHED[name].title}"
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder; {expected}.")
    if not (source.is_file() or source.is_dir()):  # a pipe may never end, nor even begin
        raise InputError(f"{source}: a pipe, a socket or a device; {expected}.")
    with installed.alone(name, watcher.says) as scratch:
        return _arrived(name, source, str(source), scratch)


def _arrived(name: str, source: Path, called: str, scratch: Path) -> Arrival:
    """Install what `source` holds."""
    from pooch import file_hash

    files = installed.install(name, source, called, scratch)
    return Arrival(None if source.is_dir() else file_hash(source), files)


def _addresses(name: str, scratch: Path, watcher: Watcher, answers: list[str]) -> Iterator[str]:
    """The addresses to be tried; where pages are known, those that they link to. Joins to `answers` what pages say."""
    log = PUBLISHED[name]
    if not log.link:
        yield from log.urls
        return
    for page in log.urls:
        try:
            text = downloaded(page, scratch, watcher).read_text(encoding="utf-8", errors="replace")
        except NotFound as error:
            answers.append(str(error))
            continue
        links = dict.fromkeys(urljoin(page, html.unescape(link)) for link in HREF.findall(text))
        matching = [link for link in links if re.search(log.link, link, re.IGNORECASE)]
        if not matching:
            answers.append(f"{page}: no link to the archive was recognised on it.")
        yield from matching

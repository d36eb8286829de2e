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
from .download import Watcher, discard, downloaded
from .transfer import Failed, Refused
from .unpack import NotPublished, sha256_of

HREF = re.compile(r"""href\s*=\s*["']?([^"'\s>]+)""", re.IGNORECASE)

WAITING = "another process is fetching it; waiting for that one."


class Arrival(NamedTuple):
    """What came: the sha256 of the archive (None: it was a folder) and that of each file."""

    archive: str | None
    files: dict[str, str]


def fetch(name: str, watcher: Watcher, *, url: str | None = None, again: bool = False) -> Arrival | None:
    """Bring the published log `name` from its publisher, or from `url`; None where it is here already.

    `again`: even then. Raises InputError with what every address answered, and with the way by hand.
    """
    answers: list[str] = []
    with installed.alone(name, lambda: watcher.says(f"{name}: {WAITING}")) as part:
        if installed.here(name) and not again:
            return None
        for address in [url] if url else _addresses(name, part, watcher, answers):
            try:
                downloaded(address, part, watcher)
                arrival = Arrival(sha256_of(part), installed.install(name, part, address))
            except (Refused, Failed) as error:
                answers.append(_answer(address, error))
            except NotPublished as error:
                discard(part)
                answers.append(str(error))
            else:
                discard(part)
                return arrival
    listed = "".join(f"\n  {answer}" for answer in answers)
    raise InputError(f"{name} could not be fetched:{listed}\n{_by_hand(name, url)}")


def take(name: str, source: Path, watcher: Watcher) -> Arrival:
    """Put the published log `name` in its place out of the file or folder `source`. Raises InputError."""
    source = Path(os.path.abspath(source))  # what `.` is called may tell what it holds
    expected = f"expected a file or folder with {PUBLISHED[name].title}"
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder; {expected}.")
    if not (source.is_file() or source.is_dir()):  # a pipe may never end, nor even begin
        raise InputError(f"{source}: a pipe, a socket or a device; {expected}.")
    with installed.alone(name, lambda: watcher.says(f"{name}: {WAITING}")):
        files = installed.install(name, source, str(source))
    return Arrival(None if source.is_dir() else sha256_of(source), files)


def _by_hand(name: str, url: str | None = None) -> str:
    """How a person gets it, and how far the publisher's addresses are to be trusted, where those were tried."""
    log = PUBLISHED[name]
    known = "" if url else f"About these addresses: {log.addresses}.\n"
    return f"{known}By hand: open {log.page} , {log.by_hand}, then: bench fetch {name} --from FILE."


def _answer(address: str, error: Exception) -> str:
    return f"{address}: {' '.join(str(error).split()).rstrip('.')}."


def _addresses(name: str, part: Path, watcher: Watcher, answers: list[str]) -> Iterator[str]:
    """The addresses to be tried; where pages are known, those that they link to. Joins to `answers` what pages say."""
    log = PUBLISHED[name]
    if not log.link:
        yield from log.urls
        return
    for page in log.urls:
        try:
            text = downloaded(page, part, watcher).read_text(encoding="utf-8", errors="replace")
        except (Refused, Failed) as error:
            answers.append(_answer(page, error))
            continue
        finally:
            discard(part)
        links = dict.fromkeys(urljoin(page, html.unescape(link)) for link in HREF.findall(text))
        matching = [link for link in links if re.search(log.link, link, re.IGNORECASE)]
        if not matching:
            answers.append(f"{page}: no link to the archive was recognised on it.")
        yield from matching

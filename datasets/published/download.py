"""A download that survives its connection: it goes on where it stopped, in this process or in a later one.

What has arrived stands in a file of its own, with a note beside it of the address and of the state the server's file
was in. It is gone on with only while both still hold.
"""

import json
import os
import time
from contextlib import suppress
from pathlib import Path

from ...frontend.errors import InputError
from ...frontend.files import write_whole
from . import transfer
from .transfer import Answer, Failed, Refused

TRIES = 5
"""How often a server is asked before it is given up."""

PAUSE = 1.0
"""Seconds before the second try; doubled before each further one."""

TIMEOUT = 30.0
"""Seconds without a word from the server, or in which less than `SLOWEST` arrived, after which a try is over."""

SLOWEST = 256.0
"""Bytes a second."""

LARGEST = 2**30
"""Bytes: more than any of the published logs; what goes on beyond is something else."""

BLOCK = 2**16


class Watcher:
    """What goes on, for whoever wants to see it; here nobody does."""

    def receiving(self, url: str, at: int, total: int | None) -> None:
        """Bytes will arrive from `url`, from position `at` on, of `total` (None: the server does not tell)."""

    def received(self, at: int) -> None:
        """They have arrived up to position `at`."""

    def says(self, sentence: str) -> None:
        """Something that a patient person would like to know."""


def downloaded(url: str, part: Path, watcher: Watcher) -> Path:
    """The file at `url`, whole, in the file `part`, which may hold a part of it already.

    Raises Refused where the server has no such file, Failed where `TRIES` tries came to nothing, and InputError where
    the part cannot be written. What had arrived by then stays for the next time.
    """
    for attempt in range(TRIES):
        try:
            _one_try(url, part, watcher)
        except Failed as error:
            if attempt == TRIES - 1:
                raise Failed(f"{error}, at the last of {TRIES} tries") from None
            watcher.says(f"{url}: {error}; trying again.")
            time.sleep(PAUSE * 2**attempt)
        else:
            break
    return part


def discard(part: Path) -> None:
    """Throw away what has arrived: it is not what it should be."""
    for file in (part, _note(part)):
        with suppress(FileNotFoundError):
            file.unlink()


def _one_try(url: str, part: Path, watcher: Watcher) -> None:
    start, stamp = _so_far(url, part)
    with transfer.opened(url, start, stamp, TIMEOUT) as answer:
        try:
            at = _store(answer, url, part, watcher)
        except OSError as error:  # of our own disk: those of the connection are Failed
            raise InputError(f"{part}: what arrives cannot be written ({error.strerror or error}).") from None
        if answer.total is not None and at != answer.total:
            raise Failed(f"{at:,} of {answer.total:,} bytes arrived before the connection ended")


def _so_far(url: str, part: Path) -> tuple[int, str]:
    """How many bytes of the file at `url` are there, and its stamp at the time."""
    with suppress(OSError, ValueError, TypeError, KeyError):
        note = json.loads(_note(part).read_text(encoding="utf-8"))
        if note["url"] == url:
            return part.stat().st_size, str(note["stamp"])
    return 0, ""


def _store(answer: Answer, url: str, part: Path, watcher: Watcher) -> int:
    """Write what arrives; the position reached."""
    at = answer.start
    watcher.receiving(url, at, answer.total)
    if at == 0:  # the note never speaks of other bytes than those that are there
        discard(part)
        part.touch()
        write_whole(_note(part), json.dumps({"url": url, "stamp": answer.stamp}))
    with part.open("r+b") as file:
        file.truncate(at)
        file.seek(at)
        window, before = time.monotonic(), at
        while block := _next(answer):
            file.write(block)
            file.flush()
            at += len(block)
            watcher.received(at)
            if at > LARGEST:
                discard(part)
                raise Refused(f"more than {LARGEST:,} bytes arrive, and they do not end")
            if (waited := time.monotonic() - window) > TIMEOUT:
                if at - before < SLOWEST * waited:
                    raise Failed(f"only {at - before:,} bytes arrived in {waited:.0f} s")
                window, before = time.monotonic(), at
        os.fsync(file.fileno())
    return at


def _next(answer: Answer) -> bytes:
    """Some more bytes, however few; none at the end."""
    try:
        return answer.stream.read1(BLOCK)
    except TimeoutError:
        raise Failed("nothing arrived for too long") from None
    except Exception as error:  # http.client's own, those of the socket, those of TLS
        raise Failed(f"the connection broke ({error})") from None


def _note(part: Path) -> Path:
    return part.with_name(f"{part.name}.note")

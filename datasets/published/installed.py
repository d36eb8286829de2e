"""Published logs on this machine: installed atomically, with the sha256 of their files.

A log is a folder with its files and with `SHA256SUMS`, in the format that `sha256sum --check` reads.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from .catalogue import PUBLISHED, place
from .unpack import NotFound, sha256, unpacked

SUMS = "SHA256SUMS"


def here(name: str) -> bool:
    """Tells if the published log `name` is on this machine, with all of its files that are not spare."""
    log = PUBLISHED[name]
    return all((place(name) / file).is_file() for file in log.files if file not in log.spare)


def lacking(name: str) -> list[str]:
    """The spare files that the installed log is without."""
    return [file for file in PUBLISHED[name].spare if not (place(name) / file).is_file()]


def size(name: str) -> int:
    """Total size, in bytes, of an installed log's files."""
    without = lacking(name)
    return sum((place(name) / file).stat().st_size for file in PUBLISHED[name].files if file not in without)


class Arrival(NamedTuple):
    """The sha256 of an installed archive (None: it was a folder) and of each file."""

    archive: str | None
    files: dict[str, str]


def install(name: str, source: Path, called: str) -> Arrival:
    """Installs the published log `name` from the archive, folder or file `source`.

    An earlier copy is replaced, but kept if the new one is invalid. Raises InputError, in which `source` is named
    `called`, and OSError if it cannot be read.
    """
    import pooch

    contents = unpacked(name, source, called)
    digests = {file: sha256(content) for file, content in contents.items()}
    if twin := _twin(name, digests):
        raise NotFound(f"{called}: {twin}, and not those of {name}.")
    sums = [f"# {PUBLISHED[name].title}", f"# from {called}"]
    sums += [f"{digest}  {file}" for file, digest in sorted(digests.items())]
    contents[SUMS] = "".join(f"{line}\n" for line in sums).encode()
    folder = place(name).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{name}.", dir=folder) as beside:
            (new := Path(beside, "new")).mkdir()
            for file, content in contents.items():
                if isinstance(content, bytes):
                    (new / file).write_bytes(content)
                else:
                    shutil.copyfile(content, new / file)
            with contextlib.suppress(FileNotFoundError):
                os.replace(place(name), Path(beside, "old"))
            os.replace(new, place(name))
    except OSError as error:
        raise InputError(
            f"{error.filename or folder}: {error.strerror or error}; {name} goes into the cache folder, "
            "which the environment variable SLAMDUEL_CACHE moves."
        ) from None
    return Arrival(None if source.is_dir() else pooch.file_hash(source), digests)


def faults(name: str) -> list[str]:
    """One sentence per file of the log `name` that is missing or changed; one more if most are another log's."""
    recorded = _recorded(name)
    digests: dict[str, str] = {}
    found: list[str] = []
    for file, published in PUBLISHED[name].files.items():
        path = place(name) / file
        expected = published or recorded.get(file)
        if expected is None and file in lacking(name):
            continue
        try:
            digest = digests[file] = sha256(path)
        except OSError as error:
            found.append(f"{path}: {error.strerror}.")
            continue
        if expected is None:
            found.append(f"{path}: no sha256 was recorded for it; found {digest}.")
        elif digest != expected:
            whose = "published" if published else "recorded when it first arrived"
            found.append(f"{path}: its sha256 is {digest}; {whose}: {expected}.")
    if twin := _twin(name, digests):
        found.append(f"{place(name)}: {twin}.")
    return found


def _twin(name: str, digests: Mapping[str, str]) -> str:
    """Returns a message if more than half of the files have the sha256 of another published log; else "".

    More than half, because logs of one room may share files on the room. A log whose sha256 are all known needs no such
    check.
    """
    if all(PUBLISHED[name].files.values()):
        return ""
    for other in (other for other in PUBLISHED if other != name):
        known = _recorded(other) | {file: digest for file, digest in PUBLISHED[other].files.items() if digest}
        same = sum(known.get(file) == digest for file, digest in digests.items())
        if 2 * same > len(digests):
            published = all(PUBLISHED[other].files.values())
            source = "" if published else f" (compared with {place(other)}; remove that if it is the wrong one)"
            return f"{same} of its {len(digests)} files are those of {other}{source}"
    return ""


def _recorded(name: str) -> dict[str, str]:
    """The sha256 of each file as it was installed, by the file's name; empty where none can be read."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        lines = (place(name) / SUMS).read_text(encoding="utf-8").splitlines()
        return {
            file: digest for digest, _, file in (line.partition("  ") for line in lines) if not digest.startswith("#")
        }
    return {}

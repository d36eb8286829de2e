"""The files of a published log taken out of what was downloaded: a zip, a tar, a folder, or one of the files itself.

Nothing is unpacked but the files that were asked for, under their own bare names, so an archive has no say in where
anything is written; one that tries is turned down all the same. No more is read than such a log can hold.
"""

import gzip
import hashlib
import os
import tarfile
import zipfile
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, cast

from ...frontend.errors import InputError, SlamduelError
from .catalogue import PUBLISHED, named_in

LARGEST_FILE = 2**28
"""Bytes: more than any file of the published logs."""

LARGEST_ARCHIVE = 2**29
"""Bytes that a compressed tar may grow to."""

BLOCK = 2**16

GZIP = b"\x1f\x8b"

ENCRYPTED = 1
"""Of the flags of a file in a zip (APPNOTE.TXT, 4.4.4)."""

PAGE = (b"<!doctype", b"<html", b"<head", b"<?xml")
"""How a web page begins, in lower case."""

Candidates = Iterator[tuple[str, Callable[[], IO[bytes]]]]
"""Path inside the archive, and how the file there is opened before the next one is asked for."""


class NotPublished(InputError):
    """What was looked at is not the published log, or not all of it."""


def unpacked(log: str, source: Path, into: Path, called: str) -> dict[str, str]:
    """Write the files of the published `log` that `source` holds into the folder `into`; each one's sha256.

    Of several files of one name the one with the right sha256 is taken; where none is known, one that stands under the
    name of another log is not. Raises NotPublished, in which `source` is `called` so, where a file is missing or is not
    what it should be, or where `source` is damaged or something else, and InputError where the disk refuses.
    """
    wanted = PUBLISHED[log].files
    digests: dict[str, str] = {}
    others: dict[str, str] = {}
    passed_over: dict[str, str] = {}
    try:
        for path, opened in _candidates(source, wanted, called):
            if (name := PurePosixPath(path).name) not in wanted:
                continue
            other = named_in(f"{PurePosixPath(called).name}/{path}")
            if wanted[name] is None and other not in (None, log):
                passed_over[path] = other
                continue
            beside = into / f".{name}"
            with opened() as stream:
                digest = _copied(stream, beside, f"{called}: {path}")
            if wanted[name] not in (None, digest):
                others[name] = digest
                beside.unlink()
            elif digests.setdefault(name, digest) != digest:
                raise NotPublished(f"{called}: it holds two different files {name}, and which is meant is not known.")
            else:
                os.replace(beside, into / name)
    except SlamduelError:
        raise
    except Exception as error:  # a damaged archive raises nearly anything, from struct.error to NotImplementedError
        if isinstance(error, OSError) and error.errno is not None:  # not the archive: the disk
            raise InputError(f"{error.filename or into}: {error.strerror}.") from None
        raise NotPublished(f"{called}: a damaged archive ({error or type(error).__name__}).") from None
    for name, digest in others.items():
        if name not in digests:
            raise NotPublished(
                f"{called}: its {name} is not the published one: sha256 {digest}, expected {wanted[name]}."
            )
    if passed_over and not digests:
        path, other = next(iter(passed_over.items()))
        raise NotPublished(f"{called}: {path} in it is of {other}, as its path says, not of {log}.")
    if missing := [name for name in wanted if name not in digests]:
        verb = "is" if len(missing) == 1 else "are"
        raise NotPublished(f"{called}: {_listed(missing)} should be in it, and {verb} not.")
    return digests


def sha256_of(file: Path) -> str:
    """The file's sha256, in hexadecimal. Raises OSError."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _listed(names: list[str]) -> str:
    """`a`, `a and b`, `a, b and c`, `a, b, c and 4 more`."""
    few = names[:3] + ([f"{len(names) - 3} more"] if len(names) > 3 else [])
    return " and ".join([", ".join(few[:-1]), few[-1]] if len(few) > 1 else few)


def _candidates(source: Path, wanted: Collection[str], called: str) -> Candidates:
    """The files in `source`, or in a folder those with a name that is wanted."""
    if source.is_dir():
        for file in sorted(source.rglob("*")):
            if file.name in wanted and not file.is_dir():
                yield file.relative_to(source).as_posix(), partial(_regular, file)
        return
    with source.open("rb") as file:
        start = file.read(512)
    if zipfile.is_zipfile(source):
        yield from _zipped(source, called)
    elif start.startswith(GZIP) or tarfile.is_tarfile(source):
        yield from _tarred(source, called, compressed=start.startswith(GZIP))
    elif start.lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(PAGE):  # a lost file is often answered with one
        raise NotPublished(f"{called}: a web page, not the published file.")
    elif start.startswith(b"PK"):
        raise NotPublished(f"{called}: a zip archive that is cut off or damaged.")
    elif source.name in wanted or len(wanted) == 1:
        yield source.name if source.name in wanted else next(iter(wanted)), partial(source.open, "rb")
    else:
        raise NotPublished(f"{called}: expected a zip or tar archive, or a folder; found something else.")


def _regular(file: Path) -> IO[bytes]:
    if not file.is_file():  # to open a pipe would be to wait for who writes into it
        raise NotPublished(f"{file}: expected a regular file; found a pipe, a device or a link to nothing.")
    return file.open("rb")


def _zipped(source: Path, called: str) -> Candidates:
    with zipfile.ZipFile(source) as archive:
        for member in archive.infolist():
            _refuse_way_out(member.filename, called)
            if not member.is_dir():
                yield member.filename, partial(_entry, archive, member, called)


def _entry(archive: zipfile.ZipFile, member: zipfile.ZipInfo, called: str) -> IO[bytes]:
    if member.flag_bits & ENCRYPTED:
        raise NotPublished(f"{called}: {member.filename} in it is encrypted; unpack it yourself and give the folder.")
    return archive.open(member)


def _tarred(source: Path, called: str, *, compressed: bool) -> Candidates:
    with gzip.open(source) if compressed else source.open("rb") as plain:
        capped = cast("IO[bytes]", _Capped(plain, called))
        with tarfile.open(fileobj=capped, mode="r|") as archive:  # a stream: what is passed over counts as well
            for member in archive:
                _refuse_way_out(member.name, called)
                if member.isreg():
                    yield member.name, partial(_content, archive, member)


def _content(archive: tarfile.TarFile, member: tarfile.TarInfo) -> IO[bytes]:
    stream = archive.extractfile(member)
    assert stream is not None  # it is a regular file
    return stream


def _refuse_way_out(path: str, called: str) -> None:
    plain = PurePosixPath(path.replace("\\", "/"))
    if plain.is_absolute() or ".." in plain.parts or (plain.parts and plain.parts[0].endswith(":")):
        raise NotPublished(f"{called}: it holds the path {path!r}, which leads out of it: not what was published.")


def _copied(stream: IO[bytes], target: Path, called: str) -> str:
    """Write what `stream` holds to `target`; its sha256."""
    digest, size = hashlib.sha256(), 0
    with target.open("wb") as file:
        while block := stream.read(BLOCK):
            if (size := size + len(block)) > LARGEST_FILE:
                raise NotPublished(f"{called}: grows beyond {LARGEST_FILE:,} bytes: not what was published.")
            digest.update(block)
            file.write(block)
    return digest.hexdigest()


class _Capped:
    """A stream of which no more than `LARGEST_ARCHIVE` bytes are read."""

    def __init__(self, stream: gzip.GzipFile | IO[bytes], called: str) -> None:
        self._stream, self._called, self._left = stream, called, LARGEST_ARCHIVE

    def read(self, size: int) -> bytes:
        """The next `size` bytes, or what is left."""
        block = self._stream.read(size)
        self._left -= len(block)
        if self._left < 0:
            raise NotPublished(f"{self._called}: grows beyond {LARGEST_ARCHIVE:,} bytes: not what was published.")
        return block

"""The files of a published log taken out of what was downloaded: a zip, a tar, a folder, or one of the files itself.

Nothing is unpacked but the files that were asked for, under their own bare names, so an archive has no say in where
anything is written; one that tries is turned down all the same. No more is read than such a log can hold.
"""

import gzip
import hashlib
import os
import tarfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, cast

from ..frontend.errors import InputError, SlamduelError

LARGEST_FILE = 2**28
"""Bytes: more than any file of the published logs."""

LARGEST_ARCHIVE = 2**29
"""Bytes that a compressed tar may grow to."""

BLOCK = 2**16

GZIP = b"\x1f\x8b"

PAGE = (b"<!doctype", b"<html", b"<head", b"<?xml")
"""How a web page begins, in lower case."""

Candidates = Iterator[tuple[str, Callable[[], IO[bytes]]]]
"""Path inside the archive, and how the file there is opened before the next one is asked for."""


class NotPublished(InputError):
    """What was looked at is not the published log, or not all of it."""


def unpacked(source: Path, wanted: Mapping[str, str | None], into: Path, called: str) -> dict[str, str]:
    """Write the `wanted` files (name -> sha256, None: any) of `source` into the folder `into`; each one's sha256.

    Of several files of one name the one with the right sha256 is taken. Raises NotPublished, in which `source`
    is `called` so, where a file is missing or is not what it should be, or where `source` is damaged or something else,
    and InputError where the disk refuses.
    """
    digests: dict[str, str] = {}
    others: dict[str, str] = {}
    try:
        for path, opened in _candidates(source, wanted, called):
            if (name := PurePosixPath(path).name) not in wanted:
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
    if missing := [name for name in wanted if name not in digests]:
        listed = ", ".join(missing[:3]) + (f" and {len(missing) - 3} more" if len(missing) > 3 else "")
        raise NotPublished(f"{called}: {listed} should be in it, and is not.")
    return digests


def sha256_of(file: Path) -> str:
    """The file's sha256, in hexadecimal. Raises OSError."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _candidates(source: Path, wanted: Mapping[str, str | None], called: str) -> Candidates:
    """The regular files in `source`."""
    if source.is_dir():
        for file in sorted(source.rglob("*")):
            if file.name in wanted and file.is_file():
                yield file.relative_to(source).as_posix(), partial(file.open, "rb")
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


def _zipped(source: Path, called: str) -> Candidates:
    with zipfile.ZipFile(source) as archive:
        for member in archive.infolist():
            _refuse_way_out(member.filename, called)
            if not member.is_dir():
                yield member.filename, partial(archive.open, member)


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

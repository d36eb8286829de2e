"""Extracts the files of a published log from a download: a zip, a tar, a folder, or one of the files itself.

Only requested files are read, and their paths are used only to identify the log.
"""

import gzip
import hashlib
import tarfile
import zipfile
from collections.abc import Collection, Iterator
from pathlib import Path, PurePosixPath

from ...core.errors import InputError, SlamduelError
from .catalogue import PUBLISHED, named_in

LARGEST = 2**28  # bytes: larger than any file in an archive of the published logs


class NotFound(InputError):
    """The published log is not available at an address or path; the message names it and the reason."""


Content = bytes | Path  # of a file: read, or where it lies


def unpacked(log: str, source: Path, called: str) -> dict[str, Content]:
    """Finds the files of the published `log` in `source`, name -> content; messages call the source `called`.

    Of several files of one name the one with the right sha256 is taken; if none is known, files under the name of
    another log are excluded. Raises NotFound if a file is missing or is not the right one, or if `source` is damaged or
    something else; and OSError.
    """
    wanted, also = PUBLISHED[log].files, PUBLISHED[log].also
    copies: dict[str, dict[str, Content]] = {}  # name -> sha256 -> content
    passed_over = ""
    try:
        for path, content in _contents(source, [*wanted, *also], called):
            found_as = PurePosixPath(path).name
            name = also.get(found_as, found_as)
            if name != found_as and found_as.endswith(".gz"):
                content = gzip.decompress(content if isinstance(content, bytes) else content.read_bytes())  # noqa: PLW2901
            other = named_in(f"{PurePosixPath(called).name}/{path}")
            if wanted[name] is None and other not in (None, log):
                passed_over = passed_over or f"{path} in it is of {other} by its path, not of {log}"
            else:
                copies.setdefault(name, {})[sha256(content)] = content
    except SlamduelError:
        raise
    except Exception as error:  # a damaged archive raises almost any exception
        if isinstance(error, OSError) and error.errno is not None:  # not the archive: the disk
            raise
        raise NotFound(f"{called}: it cannot be unpacked ({error or type(error).__name__}).") from None
    for name, digest in wanted.items():
        found = copies.get(name, {})
        if digest is not None and found and digest not in found:
            raise NotFound(f"{called}: its {name} is not the published one: sha256 {min(found)}, expected {digest}.")
        if digest is None and len(found) > 1:
            raise NotFound(f"{called}: it contains two different files {name}, and the right one is unknown.")
    if passed_over and not copies:
        raise NotFound(f"{called}: {passed_over}.")
    spare = PUBLISHED[log].spare
    if missing := [name for name in wanted if name not in copies and name not in spare]:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise NotFound(f"{called}: missing {', '.join(missing[:3])}{more}.")
    return {name: copies[name][digest or min(copies[name])] for name, digest in wanted.items() if name in copies}


def check_page(source: Path, called: str) -> bytes:
    """The first bytes of a file; NotFound if it is a web page, which many servers send for a missing file."""
    with source.open("rb") as file:
        start = file.read(40)
    if start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise NotFound(f"{called}: a web page, not the published file.")
    return start


def sha256(content: Content) -> str:
    """The sha256 of some bytes, or of a file, in hexadecimal."""
    if isinstance(content, bytes):
        return hashlib.sha256(content).hexdigest()
    with content.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _contents(source: Path, wanted: Collection[str], called: str) -> Iterator[tuple[str, Content]]:
    """Yields path and content of each requested file in `source`."""
    if source.is_dir():
        for file in sorted(file for name in wanted for file in source.rglob(name) if not file.is_dir()):
            if not file.is_file():  # opening a pipe would block
                raise NotFound(f"{file}: expected a regular file; found a pipe, a device or a dangling link.")
            yield file.relative_to(source).as_posix(), file
    elif zipfile.is_zipfile(source):
        with zipfile.ZipFile(source) as archive:
            for member in archive.infolist():
                if _wanted(member.filename, member.file_size, wanted, called) and not member.is_dir():
                    yield member.filename, archive.read(member)
    elif tarfile.is_tarfile(source):
        with tarfile.open(source) as archive:
            for member in archive:
                stream = archive.extractfile(member) if member.isreg() else None
                if _wanted(member.name, member.size, wanted, called) and stream is not None:
                    yield member.name, stream.read()
    else:
        start = check_page(source, called)
        if start.startswith(b"PK"):
            raise NotFound(f"{called}: a truncated or damaged zip archive.")
        if source.name not in wanted and len(wanted) > 1:
            raise NotFound(f"{called}: expected a zip or tar archive, or a folder; found something else.")
        yield source.name if source.name in wanted else next(iter(wanted)), source


def _wanted(path: str, size: int, wanted: Collection[str], called: str) -> bool:
    """Tells if a file of an archive is to be read; NotFound if it is too large or its path leads outside."""
    plain = PurePosixPath(path.replace("\\", "/"))
    if plain.is_absolute() or ".." in plain.parts or (plain.parts and plain.parts[0].endswith(":")):
        raise NotFound(f"{called}: it contains the path {path!r}, which leads outside of it: not the published file.")
    if plain.name in wanted and size > LARGEST:
        raise NotFound(f"{called}: {path} is larger than {LARGEST:,} bytes: not the published file.")
    return plain.name in wanted

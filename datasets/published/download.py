"""Downloads a file with pooch, or says why it could not be downloaded.

A server that is busy or breaks off is asked again for the whole file; one that does not have it is not asked again.
"""

import ftplib
import socket
import ssl
from collections.abc import Callable
from functools import partial
from io import FileIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ...frontend.errors import InputError, SlamduelError
from .unpack import NotFound

RETRIES = 4
"""How often a server is asked again; pooch waits 1 s, 2 s, 3 s and so on."""

TIMEOUT = 30.0
"""Seconds to wait for a connection, or for the next bytes."""

LARGEST = 2**30
"""Bytes: more than any of the published logs."""

BLOCK = 2**13

HEADERS = {"User-Agent": "slamduel", "Accept-Encoding": "identity"}

TRANSIENT = (408, 425, 429, 500, 502, 503, 504)
"""HTTP statuses after which trying again makes sense (RFC 9110, RFC 6585)."""

LASTING = (socket.gaierror, ssl.SSLCertVerificationError, ftplib.error_perm)
"""An unknown host, a wrong certificate, a missing file: errors that trying again does not change."""


Watch = Callable[[str, int, int | None], object]
"""Called with an address, the number of bytes that have arrived from it, and the total (None: not known)."""


def downloaded(url: str, folder: Path, watch: Watch) -> Path:
    """Downloads the file at `url` into the folder, in place of the one downloaded before.

    Raises NotFound where it cannot be had from there, and InputError where it cannot be written.
    """
    import pooch

    (folder / "download").unlink(missing_ok=True)  # or pooch would return it
    pooch.get_logger().setLevel("ERROR")
    registry, urls = {"download": None}, {"download": url}
    files: Any = pooch.create(folder, "", registry=registry, urls=urls, retry_if_failed=RETRIES)
    return Path(files.fetch("download", downloader=partial(_transfer, watch=watch)))


class _Failed(NotFound, ValueError):
    """A failure after which pooch tries again, as it does after a ValueError."""


def _transfer(url: str, target: str, _: object, *, watch: Watch) -> None:
    """Writes the file at `url` to `target`; pooch calls this for each try."""
    from pooch import FTPDownloader, HTTPDownloader

    with FileIO(target, "w") as file:
        sink: Any = _Sink(file, url, watch)  # pooch says that a progress bar is a bool
        try:
            parts = urlsplit(url)
            if parts.scheme == "ftp":
                ftp = FTPDownloader(port=parts.port or ftplib.FTP_PORT, timeout=TIMEOUT, chunk_size=BLOCK)
                ftp(f"ftp://{parts.hostname}{parts.path}", sink, None)
            elif parts.scheme in ("http", "https"):
                http = HTTPDownloader(progressbar=sink, chunk_size=BLOCK, timeout=TIMEOUT, headers=HEADERS)
                http(url, sink, None)
            else:
                raise ValueError("not an http, https or ftp address")
        except Exception as error:
            raise _refusal(error, url, sink.at) from None


def _refusal(error: Exception, url: str, at: int) -> SlamduelError:
    """Makes a sentence of the first error, after `at` bytes: libraries wrap it, and FTP's QUIT may fail as well."""
    first: BaseException = error
    while first.__context__ is not None and not isinstance(first, SlamduelError):
        first = first.__context__
    if isinstance(first, SlamduelError):
        return first
    lasting = isinstance(error, ValueError) or isinstance(first, LASTING)
    reason = getattr(first, "strerror", None) or str(error) or type(error).__name__
    if (response := getattr(error, "response", None)) is not None:
        lasting, reason = response.status_code not in TRANSIENT, f"{response.status_code} {response.reason}"
    elif at:
        reason = f"the connection broke after {at:,} bytes"
    return (NotFound if lasting else _Failed)(f"{url}: {' '.join(reason.split()).rstrip('.')}.")


class _Sink:
    """A file that reports what is written to it, and the progress bar that pooch tells the total."""

    def __init__(self, file: FileIO, url: str, watch: Watch) -> None:
        self._file, self._url, self._watch = file, url, watch
        self.at, self.total = 0, 0

    def write(self, block: bytes) -> None:
        """Writes some more bytes; InputError where the disk is full."""
        self.at += len(block)
        if self.at > LARGEST:
            raise NotFound(f"{self._url}: more than {LARGEST:,} bytes arrive: not what was published.")
        try:
            while block:  # a disk that is nearly full takes a part
                block = block[self._file.write(block) :]
        except OSError as error:
            raise InputError(f"{self._file.name}: what arrives cannot be written ({error.strerror}).") from None
        self._watch(self._url, self.at, self.total or None)

    def flush(self, *_: Any) -> None:
        """Does nothing: `write` holds nothing back, and reports progress itself."""

    update = reset = close = flush

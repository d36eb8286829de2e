"""Downloads a file with pooch: whole, or a sentence that names the address and the reason.

A server that is busy or breaks off is asked again from the start; one that does not have the file is not.
"""

import ftplib
import socket
import ssl
from functools import partial
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

from ...frontend.errors import InputError, SlamduelError
from .unpack import NotFound

RETRIES = 4
"""After 1, 2, 3 and 4 s."""

TIMEOUT = 30.0
"""Seconds to wait for a connection, or for the next bytes."""

LARGEST = 2**30
"""Bytes: more than any of the published logs."""

BLOCK = 2**13

HEADERS = {"User-Agent": "slamduel", "Accept-Encoding": "identity"}

TRANSIENT_CODES = (408, 425, 429, 500, 502, 503, 504)
"""HTTP statuses after which trying again makes sense (RFC 9110, RFC 6585)."""

LASTING = (socket.gaierror, ssl.SSLCertVerificationError, ftplib.error_perm)
"""An unknown host, a wrong certificate, a file that is not there: the next answer would be the same."""


class Watcher:
    """Sees what goes on; this one does nothing with it."""

    def received(self, url: str, at: int, total: int | None) -> None:
        """`at` of `total` bytes (None: the server does not tell) have arrived from `url`."""

    def says(self, sentence: str) -> None:
        """Something that a waiting person would like to know."""


def downloaded(url: str, folder: Path, watcher: Watcher) -> Path:
    """The file at `url`, in the folder, under the same name each time.

    Raises NotFound where the server does not give it, and InputError where the disk does not take it.
    """
    import pooch

    (folder / "download").unlink(missing_ok=True)  # pooch would take it for this file
    pooch.get_logger().setLevel("ERROR")
    files = pooch.create(folder, "", registry={"download": None}, urls={"download": url}, retry_if_failed=RETRIES)
    return Path(files.fetch("download", downloader=partial(_transfer, watcher=watcher)))


class _Failed(NotFound, ValueError):
    """Another try may bring the file: pooch tries again after a ValueError."""


def _transfer(url: str, target: str, _: object, *, watcher: Watcher) -> None:
    """Write the file at `url` to `target`."""
    from pooch import FTPDownloader, HTTPDownloader

    with open(target, "wb") as file:
        sink = _Sink(file, url, watcher)
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
            raise _told(error, url, sink.at) from None


def _told(error: Exception, url: str, at: int) -> SlamduelError:
    """The sentence for what went wrong first, `at` bytes in: libraries wrap it, and FTP's goodbye may fail after it."""
    first: BaseException = error
    while first.__context__ is not None and not isinstance(first, SlamduelError):
        first = first.__context__
    if isinstance(first, SlamduelError):
        return first
    lasting = isinstance(error, ValueError) or isinstance(first, LASTING)
    reason = getattr(first, "strerror", None) or str(error) or type(error).__name__
    if (response := getattr(error, "response", None)) is not None:
        lasting, reason = response.status_code not in TRANSIENT_CODES, f"{response.status_code} {response.reason}"
    elif at:
        reason = f"the connection broke after {at:,} bytes"
    return (NotFound if lasting else _Failed)(f"{url}: {' '.join(reason.split()).rstrip('.')}.")


class _Sink:
    """A file that tells what it is given; to pooch, also the bar that it knows the total of."""

    def __init__(self, file: IO[bytes], url: str, watcher: Watcher) -> None:
        self._file, self._url, self._watcher = file, url, watcher
        self.at, self.total = 0, 0

    def write(self, block: bytes) -> None:
        """Take some more bytes; InputError where the disk is full."""
        self.at += len(block)
        if self.at > LARGEST:
            raise NotFound(f"{self._url}: more than {LARGEST:,} bytes arrive: not what was published.")
        try:
            self._file.write(block)
            self._file.flush()
        except OSError as error:
            raise InputError(f"{self._file.name}: what arrives cannot be written ({error.strerror}).") from None
        self._watcher.received(self._url, self.at, self.total or None)

    def flush(self, *_: Any) -> None:
        """Do nothing: nothing is held back."""

    update = reset = close = flush

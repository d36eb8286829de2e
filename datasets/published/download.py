"""Downloads a file with pooch; failures become one sentence.

A busy server or a broken connection is retried, for the whole file; a missing file is not.
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

from ...core.errors import InputError, SlamduelError
from .unpack import NotFound

RETRIES = 4  # most tries; pooch waits 1 s, 2 s, 3 s and so on
TIMEOUT = 30.0  # timeout, in seconds, of a connection and of each read

BLOCK = 2**13

HEADERS = {"User-Agent": "slamduel", "Accept-Encoding": "identity"}

TRANSIENT = (408, 425, 429, 500, 502, 503, 504)
"""HTTP statuses that are worth a retry (RFC 9110, RFC 6585)."""

LASTING = (socket.gaierror, ssl.SSLCertVerificationError, ftplib.error_perm)
"""An unknown host, an invalid certificate, a missing file: errors not worth a retry."""


Watch = Callable[[str, int, int | None], object]
"""Called with an address, the number of bytes received, and the total (None: unknown)."""


def downloaded(url: str, folder: Path, watch: Watch, largest: int) -> Path:
    """Downloads the file at `url`, of at most `largest` bytes, into the folder, replacing the previous download.

    Raises NotFound if it is not available there, and InputError if it cannot be written.
    """
    import pooch

    (folder / "download").unlink(missing_ok=True)  # otherwise pooch would return it
    pooch.get_logger().setLevel("ERROR")
    registry, urls = {"download": None}, {"download": url}
    files: Any = pooch.create(folder, "", registry=registry, urls=urls, retry_if_failed=RETRIES)
    return Path(files.fetch("download", downloader=partial(_transfer, watch=watch, largest=largest)))


class _Failed(NotFound, ValueError):
    """A failure to be retried: pooch does so after a ValueError."""


def _transfer(url: str, target: str, _: object, *, watch: Watch, largest: int) -> None:
    """Writes the file at `url` to `target`; pooch calls this for each try."""
    from pooch import FTPDownloader, HTTPDownloader

    with FileIO(target, "w") as file:
        sink: Any = _Sink(file, url, watch, largest)  # pooch says that a progress bar is a bool
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
    """Words the first error, after `at` bytes: libraries wrap it, and FTP's QUIT may fail as well."""
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
    """A file that reports the bytes written, and the progress bar that pooch reports the total to."""

    def __init__(self, file: FileIO, url: str, watch: Watch, largest: int) -> None:
        self._file, self._url, self._watch, self._largest = file, url, watch, largest
        self.at, self.total = 0, 0

    def write(self, block: bytes) -> None:
        """Writes some bytes; InputError if the disk is full."""
        self.at += len(block)
        if self.at > self._largest:
            raise NotFound(f"{self._url}: more than {self._largest:,} bytes received: not the published file.")
        try:
            while block:  # a nearly full disk may accept a part
                block = block[self._file.write(block) :]
        except OSError as error:
            raise InputError(f"{self._file.name}: the download cannot be written ({error.strerror}).") from None
        self._watch(self._url, self.at, self.total or None)

    def flush(self, *_: Any) -> None:
        """Does nothing: `write` does not buffer, and reports progress itself."""

    update = reset = close = flush

"""A file on an HTTP or FTP server, opened at a position: what a download that goes on where it stopped is made of.

A server may send less than was asked for (nothing new, or the file from its start), never something else unnoticed: the
`stamp` of a file changes with its content, and what was received under another stamp is not gone on with.
"""

import contextlib
import ftplib
import http.client
import re
import socket
import ssl
import urllib.error
import urllib.request
from collections.abc import Generator
from contextlib import contextmanager
from typing import NamedTuple, Protocol
from urllib.parse import unquote, urlsplit

TRANSIENT_CODES = (408, 425, 429, 500, 502, 503, 504)
"""HTTP statuses after which trying again makes sense (RFC 9110, RFC 6585)."""


class Refused(Exception):
    """The server will not give the file, however often it is asked; the text says what it answered."""


class Failed(Exception):
    """This try came to nothing; another may not."""


class Stream(Protocol):
    """Bytes as they arrive."""

    def read1(self, n: int = -1, /) -> bytes:
        """At most `n` bytes, as soon as there are any; none at the end."""
        ...


class Answer(NamedTuple):
    """What a server sends: `stream` from byte `start` on of a file of `total` bytes (None: not told), and its `stamp`.

    An empty stamp: the server tells nothing that would change with the file, so a part of it cannot be gone on with.
    """

    stream: Stream
    start: int
    total: int | None
    stamp: str


@contextmanager
def opened(url: str, start: int, stamp: str, timeout: float) -> Generator[Answer]:
    """The file at `url` from byte `start` on, if it still has that `stamp`, else from its start.

    `timeout`, s, is that of a connection and of the wait for the next bytes. Raises Refused and Failed.
    """
    if not stamp:
        start = 0
    with contextlib.ExitStack() as stack:
        try:
            open_one = {"ftp": _ftp, "http": _http, "https": _http}.get(urlsplit(url).scheme)
            if open_one is None:
                raise Refused("not an http, https or ftp address")
            answer = open_one(url, start, stamp, timeout, stack)
        except urllib.error.HTTPError as error:
            with error:
                wording = f"{error.code} {error.reason}"
            raise (Failed if error.code in TRANSIENT_CODES else Refused)(wording) from None
        except urllib.error.URLError as error:
            final = isinstance(error.reason, socket.gaierror | ssl.SSLCertVerificationError)
            raise (Refused if final else Failed)(_wording(error.reason)) from None
        except ftplib.error_perm as error:
            raise Refused(str(error)) from None
        except (ValueError, socket.gaierror) as error:  # an address that is none, a server that nobody knows
            raise Refused(_wording(error)) from None
        except (OSError, EOFError, http.client.HTTPException, ftplib.Error) as error:
            raise Failed(_wording(error)) from None
        yield answer


def _wording(reason: object) -> str:
    """The reason without its number; never nothing."""
    return (isinstance(reason, OSError) and reason.strerror) or str(reason) or type(reason).__name__


def _http(url: str, start: int, stamp: str, timeout: float, stack: contextlib.ExitStack) -> Answer:
    headers = {"User-Agent": "slamduel", "Accept-Encoding": "identity"}
    if start:
        headers |= {"Range": f"bytes={start}-", "If-Range": stamp}
    try:
        response = urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=timeout)
    except urllib.error.HTTPError as error:
        if error.code != 416 or not start:
            raise
        with error:  # the file, if it is still the same, ends where our part does: nothing is left to send
            complete = error.headers.get("Content-Range", "").replace(" ", "") == f"bytes*/{start}"
        return Answer(_Nothing(), start, start, stamp) if complete else _http(url, 0, "", timeout, stack)
    stack.enter_context(response)
    length = response.headers.get("Content-Length", "")
    found = _stamp(response.headers.get("ETag", ""), response.headers.get("Last-Modified", ""))
    if response.status == 206 and start:
        span = re.fullmatch(r"bytes (\d+)-(\d+)/(\d+|\*)", response.headers.get("Content-Range", "").strip())
        if span is None or int(span[1]) != start or found not in ("", stamp):
            return _http(url, 0, "", timeout, stack)
        return Answer(response, start, None if span[3] == "*" else int(span[3]), stamp)
    if response.status != 200:
        raise Refused(f"{response.status} {response.reason}")
    return Answer(response, 0, int(length) if length.isdecimal() else None, found)


def _stamp(etag: str, modified: str) -> str:
    """What If-Range may be given: a strong ETag, else the date (RFC 9110, 13.1.5)."""
    return etag if etag.startswith('"') else modified


def _ftp(url: str, start: int, stamp: str, timeout: float, stack: contextlib.ExitStack) -> Answer:
    parts = urlsplit(url)
    ftp = stack.enter_context(contextlib.closing(ftplib.FTP(timeout=timeout)))
    ftp.connect(parts.hostname or "", parts.port or ftplib.FTP_PORT)
    ftp.login(unquote(parts.username or "anonymous"), unquote(parts.password or "anonymous@"))
    path = unquote(parts.path).removeprefix("/")
    ftp.voidcmd("TYPE I")
    total, found = None, ""
    with contextlib.suppress(ftplib.error_perm):  # SIZE and MDTM came later than FTP itself (RFC 3659)
        total = ftp.size(path)
        found = f"{ftp.voidcmd(f'MDTM {path}')} {total}"
    if found != stamp or start > (total or 0):
        start = 0
    if start and start == total:
        return Answer(_Nothing(), start, total, found)
    connection = stack.enter_context(ftp.transfercmd(f"RETR {path}", start or None))
    return Answer(stack.enter_context(connection.makefile("rb")), start, total, found)


class _Nothing:
    def read1(self, n: int = -1, /) -> bytes:
        del n
        return b""

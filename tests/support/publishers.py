"""Servers of published files on this machine, which do what servers do on bad days."""

import contextlib
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

Behaviour = Callable[["Request"], None]


class Http(ThreadingHTTPServer):
    """Serves `content` under every path; `bad_days` are used up first, one a request."""

    daemon_threads = True

    def __init__(self, content: bytes, *bad_days: Behaviour) -> None:
        super().__init__(("127.0.0.1", 0), Request)
        self.content, self.etag = content, '"first"'
        self.bad_days = list(bad_days)
        self.requests: list[tuple[str, str | None]] = []  # path, Range
        self.closing = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/log.zip"


class Request(BaseHTTPRequestHandler):
    """One request; `Http` tells what becomes of it."""

    server: Http  # pyright: ignore[reportIncompatibleVariableOverride]

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        pass

    def do_GET(self) -> None:
        self.server.requests.append((self.path, self.headers.get("Range")))
        with contextlib.suppress(ConnectionError):
            (self.server.bad_days.pop(0) if self.server.bad_days else honest)(self)

    def start(self, status: int, **headers: object) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), str(value))
        self.end_headers()


def honest(request: Request, most: int | None = None, heed_if_range: bool = True) -> None:
    """What RFC 9110 asks for; `most`: the connection ends after that many bytes."""
    content, etag = request.server.content, request.server.etag
    span = request.headers.get("Range")
    start = int(span.removeprefix("bytes=").removesuffix("-")) if span else 0
    if heed_if_range and request.headers.get("If-Range", etag) != etag:
        start = 0
    if start >= len(content):
        request.start(416, Content_Range=f"bytes */{len(content)}", Content_Length=0)
        return
    headers: dict[str, object] = {"ETag": etag, "Content-Length": len(content) - start}
    if start:
        headers["Content-Range"] = f"bytes {start}-{len(content) - 1}/{len(content)}"
    request.start(206 if start else 200, **headers)
    request.wfile.write(content[start:][:most])


def drops(after: int) -> Behaviour:
    return lambda request: honest(request, after)


def drops_and_then_the_file_changes(after: int, content: bytes) -> Behaviour:
    def behave(request: Request) -> None:
        honest(request, after)
        request.server.content, request.server.etag = content, '"second"'

    return behave


def ignores_range(request: Request) -> None:
    request.start(200, ETag=request.server.etag, Content_Length=len(request.server.content))
    request.wfile.write(request.server.content)


def sends(content: bytes) -> Behaviour:
    """Something else, as if it were the file."""

    def behave(request: Request) -> None:
        request.start(200, ETag='"another"', Content_Length=len(content))
        request.wfile.write(content)

    return behave


def starts_elsewhere(request: Request) -> None:
    """A 206 with other bytes than those that were asked for."""
    content = request.server.content
    headers = {"Content-Range": f"bytes 7-{len(content) - 1}/{len(content)}", "Content-Length": len(content) - 7}
    request.start(206, ETag=request.server.etag, **headers)
    request.wfile.write(content[7:])


def drops_with_a_weak_tag(after: int) -> Behaviour:
    def behave(request: Request) -> None:
        request.start(200, ETag='W/"weak"', Content_Length=len(request.server.content))
        request.wfile.write(request.server.content[:after])

    return behave


def chunked(after: int | None = None) -> Behaviour:
    """No length told; `after`: the connection ends between two chunks, without the closing one."""

    def behave(request: Request) -> None:
        request.protocol_version = "HTTP/1.1"
        request.start(200, Transfer_Encoding="chunked", Connection="close")
        content = request.server.content[:after]
        for at in range(0, len(content), 50_000):
            block = content[at : at + 50_000]
            request.wfile.write(f"{len(block):x}\r\n".encode() + block + b"\r\n")
        if after is None:
            request.wfile.write(b"0\r\n\r\n")

    return behave


def answers(status: int, **headers: object) -> Behaviour:
    return lambda request: request.start(status, Content_Length=0, **headers)


def stalls(request: Request) -> None:
    """A few bytes, and then nothing more."""
    request.start(200, ETag=request.server.etag, Content_Length=len(request.server.content))
    request.wfile.write(request.server.content[:500])
    request.server.closing.wait(20)


def trickles(request: Request) -> None:
    """Never silent for long, and never done."""
    request.start(200, ETag=request.server.etag, Content_Length=len(request.server.content))
    for at in range(1000):
        if request.server.closing.is_set():
            return
        request.wfile.write(request.server.content[at : at + 1])
        time.sleep(0.02)


@contextmanager
def running(server: socketserver.BaseServer) -> Generator[None]:
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        if isinstance(server, Http):
            server.closing.set()
        server.shutdown()
        server.server_close()
        thread.join()


class Ftp(socketserver.ThreadingTCPServer):
    """As much of RFC 959 and RFC 3659 as an anonymous download needs; `bad_days`: bytes after which one is cut."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, content: bytes, *bad_days: int) -> None:
        super().__init__(("127.0.0.1", 0), Session)
        self.content, self.modified = content, "20110101000000"
        self.bad_days = list(bad_days)
        self.starts: list[int] = []

    @property
    def url(self) -> str:
        return f"ftp://127.0.0.1:{self.server_address[1]}/logs/log.zip"


class Session(socketserver.StreamRequestHandler):
    """One connection."""

    server: Ftp  # pyright: ignore[reportIncompatibleVariableOverride]

    def handle(self) -> None:
        with contextlib.suppress(ConnectionError), contextlib.ExitStack() as stack:
            self._serve(stack)

    def _say(self, line: str) -> None:
        self.wfile.write(f"{line}\r\n".encode())

    def _serve(self, stack: contextlib.ExitStack) -> None:
        self._say("220 ready")
        start, listening = 0, stack.enter_context(socket.socket())
        while line := self.rfile.readline().decode().strip():
            verb, _, word = line.partition(" ")
            if word not in ("", "logs/log.zip") and verb in ("SIZE", "MDTM", "RETR"):
                self._say("550 no such file")
            elif verb == "SIZE":
                self._say(f"213 {len(self.server.content)}")
            elif verb == "MDTM":
                self._say(f"213 {self.server.modified}")
            elif verb == "PASV":
                listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
                high, low = divmod(listening.getsockname()[1], 256)
                self._say(f"227 (127,0,0,1,{high},{low})")
            elif verb == "REST":
                start = int(word)
                self._say("350 go on")
            elif verb == "RETR":
                self.server.starts.append(start)
                self._say("150 here it comes")
                connection, _ = listening.accept()
                most = self.server.bad_days.pop(0) if self.server.bad_days else None
                with connection:
                    connection.sendall(self.server.content[start:][:most])
                self._say("226 done" if most is None else "426 cut")
            elif verb == "QUIT":
                return
            else:
                self._say({"USER": "331 name", "PASS": "230 in", "TYPE": "200 binary"}.get(verb, "502 unknown"))

"""Local servers of published files that fail on demand."""

import contextlib
import socket
import socketserver
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

Behaviour = Callable[["Request"], None]


class Http(ThreadingHTTPServer):
    """Serves `content` under every path; `bad_days` are used up first, one per request."""

    daemon_threads = True

    def __init__(self, content: bytes, *bad_days: Behaviour) -> None:
        super().__init__(("127.0.0.1", 0), Request)
        self.content, self.bad_days = content, list(bad_days)
        self.paths: list[str] = []
        self.closing = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/log.zip"


class Request(BaseHTTPRequestHandler):
    """One request, handled by `Http`."""

    server: Http  # pyright: ignore[reportIncompatibleVariableOverride]

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        pass

    def do_GET(self) -> None:
        self.server.paths.append(self.path)
        with contextlib.suppress(ConnectionError):
            (self.server.bad_days.pop(0) if self.server.bad_days else sends(self.server.content))(self)

    def start(self, status: int, **headers: object) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), str(value))
        self.end_headers()


def sends(content: bytes, most: int | None = None) -> Behaviour:
    """Announces all of the content; `most`: the connection ends after that many bytes."""

    def behave(request: Request) -> None:
        request.start(200, Content_Length=len(content))
        request.wfile.write(content[:most])

    return behave


def drops(request: Request) -> None:
    sends(request.server.content, 100_000)(request)


def drops_a_chunk(request: Request) -> None:
    """No length is announced, and the last chunk never arrives."""
    request.protocol_version = "HTTP/1.1"
    request.start(200, Transfer_Encoding="chunked", Connection="close")
    request.wfile.write(b"186a0\r\n" + request.server.content[:100_000] + b"\r\n")


def stalls(request: Request) -> None:
    """Sends some bytes, and then stalls."""
    drops(request)
    request.wfile.flush()
    request.server.closing.wait(20)


def answers(status: int, **headers: object) -> Behaviour:
    return lambda request: request.start(status, Content_Length=0, **headers)


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
    """As much of RFC 959 as an anonymous download needs; `bad_days`: bytes after which a transfer is cut."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, content: bytes, *bad_days: int) -> None:
        super().__init__(("127.0.0.1", 0), Session)
        self.content, self.bad_days = content, list(bad_days)
        self.sent = 0

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
        listening = stack.enter_context(socket.socket())
        while line := self.rfile.readline().decode().strip():
            verb, _, word = line.partition(" ")
            if verb == "PASV":
                listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
                high, low = divmod(listening.getsockname()[1], 256)
                self._say(f"227 (127,0,0,1,{high},{low})")
            elif verb == "RETR" and word != "/logs/log.zip":
                self._say("550 no such file")
            elif verb == "RETR":
                self.server.sent += 1
                self._say("150 here it comes")
                connection, _ = listening.accept()
                most = self.server.bad_days.pop(0) if self.server.bad_days else None
                with connection:
                    connection.sendall(self.server.content[:most])
                self._say("226 done" if most is None else "426 cut")
            else:
                known = {"USER": "331 name", "PASS": "230 in", "TYPE": "200 binary", "QUIT": "221 bye"}
                self._say(known.get(verb, "502 unknown"))

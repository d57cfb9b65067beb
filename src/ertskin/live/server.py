"""The live page, on this machine alone: the force map as it comes, zeroing, recording, and the plain stream."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

HOST = "127.0.0.1"
PAGE = Path(__file__).with_name("page.html")
GUARD = "X-Ertskin"
"""A header no page of another origin can send without being asked first: orders without it are not taken."""
WAIT_S = 5.0


class Channel:
    """The newest line for whoever waits; the slow miss some rather than fall behind."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._line = ""
        self._number = 0
        self.closed = False

    def send(self, line: str) -> None:
        """Put a line out."""
        with self._condition:
            self._line = line
            self._number += 1
            self._condition.notify_all()

    def close(self) -> None:
        """Let everybody go."""
        with self._condition:
            self.closed = True
            self._condition.notify_all()

    def after(self, number: int, timeout_s: float = WAIT_S) -> tuple[int, str]:
        """The newest line's number and text, once it is newer than ``number`` or the time is over."""
        with self._condition:
            self._condition.wait_for(lambda: self._number > number or self.closed, timeout_s)
            return self._number, self._line


class LiveServer:
    """Serves the page, ``/events`` for it, ``/stream`` for programs, and takes orders."""

    def __init__(self, channel: Channel, port: int, orders: Mapping[str, Callable[[], str]]) -> None:
        """``orders``: what may be posted, ``/zero`` to the call that does it; its text is the answer. ``port`` 0 is any
        free one. Raises ``OSError`` where the port is taken."""
        self.channel = channel
        self._server = ThreadingHTTPServer((HOST, port), _handler(channel, orders))
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        self.url = f"http://{HOST}:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.2,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self.channel.close()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)


def _handler(channel: Channel, orders: Mapping[str, Callable[[], str]]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if not self._local():
                return
            if self.path == "/":
                self._reply(HTTPStatus.OK, PAGE.read_bytes(), "text/html; charset=utf-8")
            elif self.path == "/events":
                self._stream("text/event-stream", "data: ", "\n\n")
            elif self.path == "/stream":
                self._stream("application/x-ndjson", "", "\n")
            else:
                self._reply(HTTPStatus.NOT_FOUND, b"no such page", "text/plain")

        def do_POST(self) -> None:
            if not self._local():
                return
            order = orders.get(self.path)
            if order is None:
                self._reply(HTTPStatus.NOT_FOUND, b"no such order", "text/plain")
            elif self.headers.get(GUARD) is None:
                self._reply(HTTPStatus.FORBIDDEN, f"orders need the header {GUARD}".encode(), "text/plain")
            else:
                self._reply(HTTPStatus.OK, order().encode(), "text/plain; charset=utf-8")

        def _local(self) -> bool:
            """Whether this machine was asked by its own name: another name may be a page's trick."""
            name = (self.headers.get("Host") or "").rsplit(":", 1)[0]
            if name in (HOST, "localhost"):
                return True
            self._reply(HTTPStatus.FORBIDDEN, b"only for this machine", "text/plain")
            return False

        def _reply(self, status: HTTPStatus, content: bytes, kind: str) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(content)

        def _stream(self, kind: str, before: str, behind: str) -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            number = 0
            try:
                while not channel.closed:
                    newest, line = channel.after(number)
                    if newest > number:
                        number = newest
                        self.wfile.write(f"{before}{line}{behind}".encode())
                        self.wfile.flush()
            except OSError:
                # Whoever was listening has gone.
                return

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing on the terminal."""

    return Handler

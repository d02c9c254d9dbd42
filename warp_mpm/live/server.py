"""The page's server: on 127.0.0.1 alone, under an address that nobody can guess.

A page of another site in the same browser, and another user of the machine, do not know the address: they can neither
read nor stop anything. Requests that change something are POSTs, and refused where the browser says that they come from
elsewhere.
"""

from __future__ import annotations

import os
import secrets
import socketserver
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

HOST = "127.0.0.1"

SILENT = 30.0
"""Time after which a connection that says nothing is dropped [s]."""

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Served(Protocol):
    """What is served."""

    def page(self) -> str:
        """The page."""

    def state(self, samples: int, frame: int) -> str:
        """What is new, as JSON."""

    def ask(self, what: str) -> bool:
        """Take a request; false where there is no such."""


class Server:
    """Serves in a thread of its own until `end`."""

    def __init__(self, served: Served, port: int):
        """Args: served; port, 0 for a free one.

        Raises:
            ValueError: the port cannot be had.
        """
        try:
            self._server = _Sockets((HOST, port), _Handler)
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else error
            raise ValueError(f"--port {port} of {HOST} cannot be had: {reason}.") from None
        self._server.served, self._server.secret = served, secrets.token_urlsafe(16)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)

    @property
    def address(self) -> str:
        """Of the page."""
        return f"{self._server.origin}/{self._server.secret}/"

    def begin(self) -> None:
        """Answer from now on."""
        self._thread.start()

    def end(self) -> None:
        """Answer no more."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
        self._server.server_close()


class _Sockets(socketserver.ThreadingTCPServer):
    """Not `HTTPServer`, which asks the network for the machine's name."""

    allow_reuse_address = os.name != "nt"  # there it would let two programs have one port
    daemon_threads = True
    block_on_close = False
    served: Served
    secret: str

    @property
    def origin(self) -> str:
        return f"http://{HOST}:{self.server_address[1]}"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that hangs up in the middle is no fault."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = SILENT
    server: _Sockets

    def do_GET(self) -> None:
        place = urlsplit(self.path)
        if place.path == f"/{self.server.secret}/":
            self._answer(self.server.served.page(), "text/html; charset=utf-8")
        elif place.path == f"/{self.server.secret}/state":
            asked = parse_qs(place.query)
            try:
                samples, frame = (int(asked.get(name, ["0"])[0]) for name in ("samples", "frame"))
            except ValueError:
                self._refuse(HTTPStatus.BAD_REQUEST)
                return
            self._answer(self.server.served.state(samples, frame), "application/json")
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        self.close_connection = True  # what a body may hold is not read
        origin = self.headers.get("Origin")
        base, _, what = self.path.rpartition("/")
        if not secrets.compare_digest(base.encode(), f"/{self.server.secret}".encode()):
            self._refuse(HTTPStatus.NOT_FOUND)
        elif origin is not None and origin != self.server.origin:
            self._refuse(HTTPStatus.FORBIDDEN)
        elif self.server.served.ask(what):
            self._answer("", "text/plain")
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def _answer(self, text: str, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        content = text.encode()
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def _refuse(self, status: HTTPStatus) -> None:
        self._answer(f"{status.phrase}\n", "text/plain", status)

    def version_string(self) -> str:
        return "warp-mpm"

    def log_message(self, format: str, *arguments: Any) -> None:
        """The terminal belongs to the run."""

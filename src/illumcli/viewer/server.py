"""The server of the page: files below a secret path, and a socket for each window.

It listens on this machine alone unless asked otherwise. Each path begins with a random token, so that other
users and programs of the machine cannot guess it; the headers Host and Origin must be its own, so that pages
of other sites cannot use it.
"""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from illumcli.errors import IllumError, InputError
from illumcli.viewer.session import Send, Session

if TYPE_CHECKING:
    from websockets.http11 import Request, Response
    from websockets.sync.server import Server, ServerConnection

PAGE = Path(__file__).with_name("page")
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
EVERYWHERE = ("", "0.0.0.0", "::")
LARGEST = 1 << 20
"""Bytes of a message of the page, at most."""


class Viewer:
    """A server that listens, on a free port if `port` is 0.

    Raises
    ------
    InputError
        The package websockets is missing.
    IllumError
        The address cannot be listened at.
    """

    def __init__(self, session: Callable[[Send], Session], host: str = "127.0.0.1", port: int = 0) -> None:
        try:
            from websockets.sync.server import serve
        except ImportError:
            raise InputError(
                "illum view needs websockets; install it: pip install 'illumcli[view]'"
            ) from None
        if host in EVERYWHERE:
            raise InputError(f"--host {host}: give one address of this machine; the page's own has it in it")
        self._session = session
        self._token = secrets.token_urlsafe(18)
        quiet = logging.Logger("illum view")  # connections that break off are no news
        quiet.addHandler(logging.NullHandler())
        try:
            self._server: Server = serve(
                self._connected,
                host,
                port,
                process_request=self._requested,
                compression=None,
                max_size=LARGEST,
                server_header=None,
                logger=quiet,
            )
        except OSError as error:
            fact = f"{host}:{port} cannot be listened at: {error.strerror or error}"
            raise IllumError(f"{fact}; choose another --port") from None
        number = self._server.socket.getsockname()[1]
        name = f"[{host}]" if ":" in host else host
        self._hosts = {f"{name}:{number}", *([f"localhost:{number}"] if host == "127.0.0.1" else [])}
        self.url = f"http://{name}:{number}/{self._token}/"
        """The address of the page."""

    def run(self) -> None:
        """Serve until `stop` or an exception."""
        self._server.serve_forever()

    def stop(self) -> None:
        """End `run`, and all sessions."""
        self._server.shutdown()

    def _requested(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None opens the socket of a window."""
        if request.headers.get_all("Host") not in [[host] for host in self._hosts]:
            return _answer(HTTPStatus.FORBIDDEN, b"The header Host names another server.\n")
        origins = request.headers.get_all("Origin")
        if origins not in [[], *([f"http://{host}"] for host in self._hosts)]:
            return _answer(HTTPStatus.FORBIDDEN, b"Pages of other sites are refused.\n")
        _, token, *rest = request.path.partition("?")[0].split("/", 2)
        if not secrets.compare_digest(token.encode(), self._token.encode()) or not rest:
            return _answer(
                HTTPStatus.NOT_FOUND, b"There is nothing here; open the address that illum view prints.\n"
            )
        if rest == ["live"]:
            if not origins:
                return _answer(HTTPStatus.FORBIDDEN, b"A socket needs the header Origin.\n")
            return None
        name = rest[0] or "index.html"
        path = PAGE / name
        if "/" in name or "\\" in name or path.suffix not in TYPES or not path.is_file():
            return _answer(HTTPStatus.NOT_FOUND, b"There is no such file.\n")
        return _answer(HTTPStatus.OK, path.read_bytes(), TYPES[path.suffix])

    def _connected(self, connection: ServerConnection) -> None:
        """Serve a window until it is closed."""
        from websockets.exceptions import ConnectionClosed

        def send(message: str | bytes) -> None:
            try:
                connection.send(message)
            except ConnectionClosed:
                session.close()

        def render() -> None:
            try:
                session.run()
            finally:  # after a fault the page connects again
                connection.close()

        session = self._session(send)
        rendering = Thread(target=render, name="session", daemon=True)
        rendering.start()
        try:
            for message in connection:
                session.receive(message)
        finally:
            session.close()
            rendering.join()


def _answer(status: HTTPStatus, body: bytes, kind: str = "text/plain") -> Response:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    fixed = {
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Connection": "close",
    }
    return Response(status.value, status.phrase, Headers({**fixed, **HEADERS}), body)

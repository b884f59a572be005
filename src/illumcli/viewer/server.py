"""The server of the page: files below a secret path, and a socket for each window.

It listens on this machine alone unless asked otherwise. Each path begins with a random token, so that other
users and programs of the machine cannot guess it; the headers Host and Origin must be its own, so that pages
of other sites cannot use it.
"""

from __future__ import annotations

import logging
import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from ipaddress import ip_address
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
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
HTTP_PORT = 80
"""The port that browsers leave out of the header Host."""
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
        self._session = session
        self._token = secrets.token_urlsafe(18)
        quiet = logging.Logger("illum view")  # connections that break off are no news
        quiet.addHandler(logging.NullHandler())
        try:
            listener = _listener(host, port)
        except OSError as error:
            fact = f"{host}:{port} cannot be listened at: {error.strerror or error}"
            raise IllumError(f"{fact}; choose another --host or --port") from None
        bound = listener.getsockname()
        self._server: Server = serve(
            self._connected,
            sock=listener,
            process_request=self._requested,
            compression=None,
            max_size=LARGEST,
            server_header=None,
            logger=quiet,
        )
        self.is_local = ip_address(bound[0]).is_loopback
        """True if this machine alone can reach the page."""
        names = [host, "localhost"] if host == "127.0.0.1" else [host]
        self._hosts = [host_header(name, bound[1]) for name in names]
        self._origins = [f"http://{each}" for each in self._hosts]
        self.url = f"{self._origins[0]}/{self._token}/"
        """The address of the page."""
        self._files = {path.name: path for path in PAGE.iterdir() if path.suffix in TYPES}

    def run(self) -> None:
        """Serve until `stop` or an exception."""
        self._server.serve_forever()

    def stop(self) -> None:
        """End `run`, and all sessions."""
        self._server.shutdown()

    def _requested(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None opens the socket of a window."""
        if request.headers.get_all("Host") not in [[each] for each in self._hosts]:
            return _answer(HTTPStatus.FORBIDDEN, b"The header Host names another server.\n")
        origins = request.headers.get_all("Origin")
        if origins not in [[], *([each] for each in self._origins)]:
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
        path = self._files.get(rest[0] or "index.html")
        if path is None:
            return _answer(HTTPStatus.NOT_FOUND, b"There is no such file.\n")
        return _answer(HTTPStatus.OK, path.read_bytes(), TYPES[path.suffix])

    def _connected(self, connection: ServerConnection) -> None:
        """Serve a window until it is closed."""
        from websockets.exceptions import ConnectionClosed

        def send(message: str | bytes) -> None:
            with suppress(ConnectionClosed):  # then the session is closed below
                connection.send(message)

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


def _listener(host: str, port: int) -> socket.socket:
    """A socket that listens at an address of this machine.

    Raises
    ------
    InputError
        It is no single address.
    OSError
        It cannot be listened at.
    """
    family, _, _, _, address = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)[0]
    if not host or ip_address(address[0]).is_unspecified:
        raise InputError(f"--host {host}: give one address of this machine; the page's own has it in it")
    return socket.create_server(address, family=family)


def host_header(host: str, port: int) -> str:
    """The header Host that a browser sends to an address."""
    name = f"[{host}]" if ":" in host else host.lower()
    return name if port == HTTP_PORT else f"{name}:{port}"


def _answer(status: HTTPStatus, body: bytes, kind: str = "text/plain") -> Response:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    fixed = {
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Connection": "close",
    }
    return Response(status.value, status.phrase, Headers({**fixed, **HEADERS}), body)

"""The server of the page: what it serves, what it refuses, and how it ends."""

from __future__ import annotations

import gc
import http.client
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import weakref
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

pytest.importorskip("websockets", reason="needs websockets")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from illumcli.cli.view import view
from illumcli.errors import IllumError, InputError
from illumcli.viewer import server
from illumcli.viewer.pictures import Renderer
from illumcli.viewer.server import Viewer
from illumcli.viewer.session import Session
from viewing import running


def get(url, path="", **headers):
    """Status, headers and body of a page."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=30)
    connection.putrequest("GET", f"{parts.path}{path}", skip_host=True)
    for name, value in {"Host": parts.netloc, **headers}.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def origin(url):
    return url.rpartition("/")[0].rpartition("/")[0]


def window(url, **options):
    """A socket as the page opens it."""
    given = {"origin": origin(url), "compression": None, "max_size": None, "proxy": None, **options}
    return connect(f"{url.replace('http:', 'ws:')}live", **given)


def until_full(socket):
    """Messages up to the full picture."""
    answers = []
    while not answers or answers[-1].get("stage") != "full":
        message = socket.recv(timeout=60)
        if isinstance(message, bytes):
            (length,) = struct.unpack("<I", message[:4])
            message = message[4 : 4 + length]
        answers.append(json.loads(message))
    return answers


def test_the_page_and_its_files_are_served_safely(viewer):
    status, headers, body = get(viewer.url)
    assert status == 200
    assert body == (server.PAGE / "index.html").read_bytes()
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    policy = headers["Content-Security-Policy"].split("; ")
    assert {"default-src 'self'", "frame-ancestors 'none'", "base-uri 'none'", "form-action 'none'"} <= {
        *policy
    }
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"
    for path in server.PAGE.iterdir():
        status, headers, body = get(viewer.url, path.name)
        assert (status, body) == (200, path.read_bytes()), path
        assert headers["X-Content-Type-Options"] == "nosniff"


def test_the_address_is_local_and_secret(viewer, another_viewer):
    parts = urlsplit(viewer.url)
    assert parts.hostname == "127.0.0.1"
    assert len(parts.path) > 20
    assert urlsplit(another_viewer.url).path != parts.path
    assert urlsplit(another_viewer.url).port != parts.port


@pytest.mark.parametrize(
    "path", ["nothing.js", "../session.py", "%2e%2e/session.py", "..%2fsession.py", "page/", "/etc/passwd",
             "__init__.py", "live/", "\\session.py", "index.html/", "."],
)  # fmt: skip
def test_other_paths_are_not_found(viewer, path):
    assert get(viewer.url, path)[0] == 404


def test_without_its_token_nothing_is_found(viewer):
    root = f"{origin(viewer.url)}/"
    token = urlsplit(viewer.url).path.strip("/")
    for path in ("", "index.html", "live", f"{token[:-1]}/", f"{token}x/", token, "%C3%A9/"):
        assert get(root, path)[0] == 404, path
        assert b"illum view" in get(root, path)[2]
    with pytest.raises(InvalidStatus, match="404"), window(f"{root}wrong/", origin=origin(viewer.url)):
        pass


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", ""])
def test_another_host_is_refused(viewer, host):
    """A name of another site that leads here is no way in."""
    assert get(viewer.url, Host=host.format(port=urlsplit(viewer.url).port))[0] == 403


def test_localhost_is_the_same_host(viewer):
    assert get(viewer.url, Host=f"localhost:{urlsplit(viewer.url).port}")[0] == 200


@pytest.mark.parametrize(
    "site", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1"]
)
def test_pages_of_other_sites_are_refused(viewer, site):
    site = site.format(port=urlsplit(viewer.url).port)
    assert get(viewer.url, Origin=site)[0] == 403
    with pytest.raises(InvalidStatus, match="403"), window(viewer.url, origin=site):
        pass


def test_a_socket_without_an_origin_is_refused(viewer):
    with pytest.raises(InvalidStatus, match="403"), window(viewer.url, origin=None):
        pass


def test_a_window_shows_and_ends_with_its_socket(viewer):
    def sessions():
        return [each for each in threading.enumerate() if each.name == "session"]

    with window(viewer.url) as first, window(viewer.url) as second:
        assert until_full(first)[0]["type"] == "scene"
        until_full(second)
        assert len(sessions()) == 2
        first.send(json.dumps({"type": "set", "path": "materials.clay.exponent", "value": 5, "stamp": 1}))
        assert until_full(first)[0]["edits"] == {"materials.clay.exponent": 5}
        first.send(b"\x00\x01")
        assert json.loads(first.recv(timeout=60))["type"] == "problem"
        remaining = sessions()
    for each in remaining:
        each.join(timeout=60)
    assert not sessions()


def test_the_memory_of_a_closed_window_is_free(scene):
    renderers = []

    def session(send):
        renderer = Renderer(scene, threads=1)
        renderers.append(weakref.ref(renderer))
        return Session(renderer, send)

    gc.disable()
    try:
        with running(Viewer(session)) as viewer, window(viewer.url) as socket:
            until_full(socket)
            assert renderers[0]() is not None
        deadline = time.monotonic() + 30  # websockets 15 does not wait for the threads of windows
        while renderers[0]() is not None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert renderers[0]() is None
    finally:
        gc.enable()


def test_a_message_that_is_too_large_ends_the_window_alone(viewer):
    with window(viewer.url) as socket:
        until_full(socket)
        socket.send("x" * (server.LARGEST + 1))
        with pytest.raises(ConnectionClosed, match="1009"):
            socket.recv(timeout=60)
    with window(viewer.url) as socket:
        until_full(socket)


def test_a_port_in_use_and_addresses_of_everyone_are_refused(viewer):
    port = urlsplit(viewer.url).port
    with pytest.raises(
        IllumError, match=f"127.0.0.1:{port} cannot be listened at: .*; choose another --host or --port"
    ):
        Viewer(None, port=port)
    for host in ("0.0.0.0", "0", "::", "0::0", ""):
        with pytest.raises(InputError, match="give one address of this machine"):
            Viewer(None, host=host)


@pytest.mark.parametrize(
    ("host", "port", "header"),
    [("Studio", 8000, "studio:8000"), ("127.0.0.1", 80, "127.0.0.1"), ("::1", 8000, "[::1]:8000")],
)
def test_the_page_is_served_under_the_name_that_browsers_send(host, port, header):
    assert server.host_header(host, port) == header


def test_an_address_of_ipv6(scene):
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("needs IPv6")
    with running(Viewer(None, host="::1")) as viewer:
        assert viewer.is_local
        assert get(viewer.url)[0] == 200


@contextmanager
def illum(*words, **options):
    """A command that runs; it is killed if the test fails meanwhile."""
    command = [sys.executable, "-m", "illumcli", "view", *map(str, words), "--no-browser"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    ) as run:
        try:
            yield run
        finally:
            run.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_command_in_the_middle_of_a_picture(scene, tmp_path, number):
    scene.write_text(scene.read_text().replace("samples: 1,", "samples: 4000,"))
    folder = tmp_path / "temporary"
    folder.mkdir()
    environment = {**os.environ, "TMPDIR": str(folder), "ILLUM_CACHE": str(tmp_path / "cache")}
    with illum(scene, "-D", "materials.clay.exponent=7", env=environment) as run:
        url = run.stdout.readline().strip()
        with window(url) as socket:
            while isinstance(answer := socket.recv(timeout=60), str):
                controls = json.loads(answer)["controls"]
            assert next(each for each in controls if each["path"] == "materials.clay.exponent")["value"] == 7
            run.send_signal(number)
            assert run.wait(timeout=60) == -number
        assert run.stderr.read() == "Ctrl-C ends the view\n"
        assert run.stdout.read() == ""
    assert list(folder.iterdir()) == []


def test_a_page_for_other_machines_saves_beside_the_scene_alone(scene, tmp_path, monkeypatch):
    windows = []

    class Far:
        is_local = False
        url = "http://illum.example/token/"

        def __init__(self, session, host, port):
            self.session = session

        def run(self):
            windows.append(self.session(print))

    monkeypatch.setattr(server, "Viewer", Far)
    view.main([str(scene), "--no-browser", "-q"], standalone_mode=False)
    with pytest.raises(InputError, match=f"saves in {tmp_path} or below alone"):
        windows[0]._renderer.save(tmp_path.parent / "new.yaml", ())


def test_a_faulty_scene_and_a_missing_package_are_told_in_a_line(scene, tmp_path):
    (tmp_path / "websockets.py").write_text("raise ImportError\n")
    with illum(scene, "-q", env={**os.environ, "PYTHONPATH": str(tmp_path)}) as run:
        said = run.communicate(timeout=60)
    assert (run.returncode, said) == (
        2, ("", "illum view needs websockets; install it: pip install 'illumcli[view]'\n"),
    )  # fmt: skip
    with illum(scene, "-D", "film.widht=3") as run:
        _, said = run.communicate(timeout=60)
    assert run.returncode == 2
    assert said == "-D film.widht=3: unknown key 'widht'; did you mean 'width'?\n"

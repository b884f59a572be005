"""Schedulers with TLS, and what is told of peers that cannot be spoken to."""

from __future__ import annotations

import shutil
import socket
import subprocess

import pytest

from cluster.machines import Client, Machines, is_clean
from illumcli.cluster.handshake import shake_hands
from illumcli.errors import IllumError, InputError

TLS = "DASK_DISTRIBUTED__COMM__TLS__"


@pytest.fixture
def certificates(tmp_path):
    """The variables of docs/clusters.md, for certificates of an authority of this test."""
    if shutil.which("openssl") is None:
        pytest.skip("certificates are made by the command openssl")
    folder = tmp_path / "certificates"
    folder.mkdir()
    words = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=illum -keyout key.pem -out cert.pem"
    subprocess.run(words.split(), cwd=folder, check=True, capture_output=True)
    cert, key = str(folder / "cert.pem"), str(folder / "key.pem")
    pairs = {f"{TLS}{role}__{name}": path for role in ("SCHEDULER", "WORKER", "CLIENT")
             for name, path in (("CERT", cert), ("KEY", key))}  # fmt: skip
    return {f"{TLS}CA_FILE": cert, **pairs}


@pytest.fixture
def secured(tmp_path, certificates):
    made = Machines(tmp_path, protocol="tls", **certificates)
    yield made
    made.stop()


def test_a_sweep_over_tls_without_a_warning(scene, expected, secured, certificates):
    secured.start_worker()
    assert Client(scene.parent, "--cluster", secured.address, **certificates).finish() == ""
    assert is_clean(scene.parent, expected)


def test_clients_that_a_scheduler_with_tls_refuses(scene, secured):
    plain = secured.address.replace("tls:", "tcp:")
    errors = Client(scene.parent, "--cluster", plain).finish(2, seconds=60)
    assert "write tls://" in errors
    errors = Client(scene.parent, "--cluster", secured.address).finish(2, seconds=60)
    assert "needs certificates" in errors


def test_a_scheduler_without_tls_is_told_to_a_client_with_tls(scene, machines, certificates):
    secret = machines.address.replace("tcp:", "tls:")
    errors = Client(scene.parent, "--cluster", secret, **certificates).finish(2, seconds=60)
    assert "write tcp://" in errors


def test_no_scheduler_and_one_that_never_answers_are_told():
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(IllumError, match=r"no scheduler: Connection refused; check the address"):
            shake_hands(address, 1)
        silent.listen()
        with pytest.raises(IllumError, match="no answer within 1 s"):
            shake_hands(address, 1)


def test_another_server_at_the_address_is_told():
    import threading

    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()

        def answer():
            peer, _ = server.accept()
            with peer:
                peer.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 8)

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(InputError, match="what answers is no scheduler without TLS"):
            shake_hands(f"tcp://127.0.0.1:{server.getsockname()[1]}", 5)
        thread.join()

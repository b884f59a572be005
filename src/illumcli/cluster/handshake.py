"""Whether a scheduler answers, and why it does not."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
from pathlib import Path

from illumcli.errors import IllumError, InputError

CERTIFICATES = (
    "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT and"
    " DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY"
)


def address_in(path: Path) -> str:
    """The address that a scheduler's file names.

    Raises
    ------
    InputError
        The file does not name one.
    """
    try:
        return str(json.loads(path.read_text())["address"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        fact = "is not the file of a scheduler"
        raise InputError(f"--cluster {path}: {fact}; start it with --scheduler-file {path}") from error


def shake_hands(address: str, seconds: float) -> None:
    """Connect to a scheduler and leave it again.

    Dask's client does the same, but what it says of a wrong port, or of a scheduler with TLS where none was
    expected, is an empty line or any error at all.

    Raises
    ------
    InputError
        What answers is no scheduler, or one with other certificates.
    IllumError
        Nothing answers within this time.
    """
    from distributed import Security
    from distributed.comm import connect
    from distributed.comm.core import CommClosedError

    async def greet() -> None:
        identity = Security().get_connection_args("client")
        comm = await connect(address, timeout=seconds, **identity)
        await comm.close()

    name, has_tls = f"--cluster {address}", address.startswith("tls://")
    try:
        asyncio.run(asyncio.wait_for(greet(), seconds + 1))
    except CommClosedError as error:
        if isinstance(error.__cause__, ssl.SSLCertVerificationError):
            fact = f"the scheduler's certificate is refused: {error.__cause__.verify_message}"
            raise InputError(f"{name}: {fact}; give all the same authority (CA_FILE)") from error
        raise InputError(f"{name}: {_wrong_peer(has_tls)}") from error
    except OSError as error:
        fact = _refusal(address) or f"no answer within {seconds:.0f} s"
        way = "check the address, the firewall, and that a scheduler runs"
        raise IllumError(f"{name}: {fact}; {way}") from error
    except TypeError as error:  # of Dask, which finds no certificates
        raise InputError(f"{name}: needs certificates; set {CERTIFICATES}") from error
    except Exception as error:  # bytes of another protocol, taken for lengths and pickles
        raise InputError(f"{name}: {_wrong_peer(has_tls)}") from error


def _wrong_peer(has_tls: bool) -> str:
    if has_tls:
        return (
            "what answers does not speak TLS, or refuses this certificate; write tcp:// for one without TLS"
        )
    return "what answers is no scheduler without TLS; write tls:// for one with TLS, and check the port"


def _refusal(address: str) -> str:
    """Why nothing listens there; empty if something does, or if no answer comes.

    Dask tries again and again, and the last attempt may end by its own time limit instead of the cause.
    """
    from distributed.comm.addressing import parse_address, parse_host_port

    host, port = parse_host_port(parse_address(address)[1])
    try:
        socket.create_connection((host, port), timeout=1).close()
    except TimeoutError:
        return ""
    except OSError as error:
        return f"no scheduler: {error.strerror or error}"
    return ""

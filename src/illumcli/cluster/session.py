"""A command on a cluster: its connection, its workers, and the files that they need."""

from __future__ import annotations

import os
import platform
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from illumcli.cache.fingerprint import file_digest
from illumcli.cluster.address import Address
from illumcli.cluster.connection import Connection, threads_of
from illumcli.cluster.facts import facts, refuse_differences
from illumcli.cluster.inputs import Inputs
from illumcli.commands.unit import Unit
from illumcli.files.atomic import write_bytes

if TYPE_CHECKING:
    from distributed import Future


class Session:
    """The workers of a cluster, ready for the units of one command.

    Raises
    ------
    InputError
        A worker differs from this process, and `is_mixed` is False.
    IllumError
        No scheduler answers, or it has no workers.
    """

    def __init__(self, address: Address, is_mixed: bool, tell: Callable[[str], None]) -> None:
        self._address, self._is_mixed = address, is_mixed
        self._name = f"illum-{uuid.uuid4().hex}"
        self._inputs = Inputs()
        self._ships = False  # True once a worker lacks the client's files
        self._token = None if address.local else Path(f".{self._name}.token").absolute()
        self._connection = Connection(address, tell)
        try:
            if self._token is not None:
                write_bytes(self._token, platform.node().encode() + os.urandom(16))
            self._enroll()
        except BaseException:
            self.close()
            raise

    def _enroll(self) -> None:
        """Tell all workers, also those that come later, what the command is; refuse those that differ."""
        from illumcli.cluster.task import Command, CommandPlugin

        self._connection.workers()
        client = self._connection.client
        if not self._is_mixed and not self._address.local:
            refuse_differences(facts(), client.run(facts))
        token = {} if self._token is None else {self._token: file_digest(self._token)}
        allowed = os.environ.get("ILLUM_ALLOW", "")
        self._command = Command(self._name, str(Path.cwd()), token, facts(), self._is_mixed, allowed)
        client.register_plugin(CommandPlugin(self._command))

    @property
    def is_lost(self) -> bool:
        """True if the scheduler is gone."""
        return self._connection.is_lost

    def reconnect(self) -> None:
        """Wait for the scheduler, or for one in its place."""
        self._connection.reconnect()
        self._enroll()

    def workers(self) -> list[str]:
        """The addresses of the workers; waits for one if there is none."""
        return self._connection.workers()

    def submit(
        self,
        units: Sequence[Unit],
        key: str,
        contents: Mapping[Path, bytes] | None,
        among: frozenset[str],
    ) -> Future:
        """Give a block of units to the scheduler.

        Parameters
        ----------
        contents
            Files that the worker lacks.
        among
            Workers of which one shall do it; empty for any.
        """
        from illumcli.cluster.task import do

        digests = self._inputs.of_all(units) if self._ships else None
        threaded = [self._with_threads(unit) for unit in units]
        return self._connection.client.submit(
            do,
            self._command,
            threaded,
            digests,
            contents,
            key=f"{self._name}-{key}",
            workers=sorted(among) or None,
            retries=2,
            pure=False,
        )

    def contents(self, paths: Sequence[Path]) -> dict[Path, bytes]:
        """The contents of files that a worker lacks; units come with hashes of their files from now on."""
        self._ships = True
        return {path: path.read_bytes() for path in paths}

    def _with_threads(self, unit: Unit) -> Unit:
        """The unit with as many threads as a worker may use."""
        threads = threads_of(self._address, unit.options.threads)
        options: Any = replace(unit.options, threads=threads)
        return replace(unit, options=options)

    def close(self) -> None:
        """End the connection, and everything that was started for it."""
        if self._token is not None:
            self._token.unlink(missing_ok=True)
        self._connection.close(self._name)

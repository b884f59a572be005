"""A command on a cluster: its connection, its workers, and the files that they need."""

from __future__ import annotations

import os
import platform
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from illumcli.cache.fingerprint import digest, file_digest
from illumcli.cluster import local
from illumcli.cluster.address import Address
from illumcli.cluster.block import Block
from illumcli.cluster.connection import Connection, SchedulerLost
from illumcli.cluster.facts import ADVICE, facts
from illumcli.cluster.inputs import Inputs
from illumcli.commands.unit import Unit
from illumcli.errors import InputError
from illumcli.files.atomic import write_bytes
from illumcli.schema.sources import folders

if TYPE_CHECKING:
    from distributed import Future

    from illumcli.cluster.task import BlockResult


class Session:
    """The workers of a cluster, ready for the units of one command.

    Its methods raise `SchedulerLost` if the scheduler is gone.

    Raises
    ------
    IllumError
        No scheduler answers.
    """

    def __init__(self, address: Address, is_mixed: bool, tell: Callable[[str], None]) -> None:
        from illumcli.cluster.task import Command

        self._address, self._tell = address, tell
        self._inputs = Inputs()
        self._ships = False  # True once a worker lacks the client's files
        self._set_aside: dict[str, str] = {}
        self._connection = Connection(address, tell)
        name = f"illum-{uuid.uuid4().hex}"
        self._token = None if address.local else Path(f".{name}.token").absolute()
        try:
            if self._token is not None:
                write_bytes(self._token, platform.node().encode() + os.urandom(16))
            token = {} if self._token is None else {self._token: file_digest(self._token)}
            allowed = os.environ.get("ILLUM_ALLOW", "")
            wanted = {} if is_mixed else facts()
            models = tuple(folders("ILLUM_MODELS"))
            self._command = Command(name, str(Path.cwd()), token, wanted, allowed, models)
            self._register()
        except BaseException:
            self.close()
            raise

    def _register(self) -> None:
        """Tell all workers, also those that come later, what the command is."""
        from illumcli.cluster.task import CommandPlugin

        self._connection.register(CommandPlugin(self._command))

    def reconnect(self) -> None:
        """Wait for the scheduler, or for one in its place.

        Raises
        ------
        IllumError
            There is none.
        """
        self._connection.reconnect()
        with suppress(SchedulerLost):  # the next request tells
            self._register()

    def workers(self) -> frozenset[str]:
        """The addresses of the workers that may do units; waits for one if there is none.

        Raises
        ------
        InputError
            All of them differ from this process.
        IllumError
            No worker came.
        """
        present = self._connection.workers()
        usable = present - self._set_aside.keys()
        if not usable:
            raise InputError([*(self._set_aside[worker] for worker in sorted(present)), ADVICE])
        return usable

    @property
    def has_set_aside(self) -> bool:
        """True if some worker must not do any unit."""
        return bool(self._set_aside)

    def set_aside(self, worker: str, differences: Sequence[str]) -> None:
        """Give nothing more to a worker that differs from this process.

        Raises
        ------
        InputError
            There is no other.
        """
        if worker not in self._set_aside:
            self._set_aside[worker] = f"worker {worker}: {', '.join(differences)}"
            self.workers()
            self._tell(f"{self._set_aside[worker]}; it gets no work; {ADVICE}")

    def submit(
        self,
        block: Block,
        units: Sequence[Unit],
        following: Unit | None,
        among: frozenset[str],
        is_alone: bool,
    ) -> Future:
        """Give a block to the scheduler.

        Parameters
        ----------
        following
            What is likely to come after it.
        among
            Workers of which one shall do it; empty for any.
        is_alone
            True if nothing else is done meanwhile.
        """
        from illumcli.cluster.task import do

        threaded = [self._with_threads(unit, is_alone) for unit in units]
        return self._connection.submit(
            do,
            self._command,
            threaded,
            following,
            self._inputs.of_all([*units, *([following] if following else [])]) if self._ships else None,
            block.contents,
            key=f"{self._command.name}-{digest((block.numbers, block.attempt))}",
            workers=sorted(among) or None,
            retries=2,
            pure=False,
        )

    def outcomes(self) -> Iterator[tuple[Future, BlockResult | Exception]]:
        """Blocks that are done with their results, or their errors; waits a little for the first."""
        return self._connection.outcomes()

    def cancel(self, future: Future) -> None:
        """Take a block back."""
        self._connection.cancel(future)

    def contents(self, paths: Sequence[Path]) -> dict[Path, bytes]:
        """The contents of files that a worker lacks; units come with hashes of their files from now on."""
        self._ships = True
        return {path: path.read_bytes() for path in paths}

    def _with_threads(self, unit: Unit, is_alone: bool) -> Unit:
        """The unit with as many threads as a local worker may use, unless the user said how many."""
        if unit.options.threads is not None or not self._address.local:
            return unit
        threads = local.threads_of_each(self._address.local, is_alone)
        options: Any = replace(unit.options, threads=threads)
        return replace(unit, options=options)

    def close(self) -> None:
        """End the connection, and everything that was started for it."""
        if self._token is not None:
            self._token.unlink(missing_ok=True)
        self._connection.close(self._command.name)

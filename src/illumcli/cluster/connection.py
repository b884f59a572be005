"""The connection to the scheduler of a cluster."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from illumcli.cluster.address import Address
from illumcli.cluster.handshake import address_in, shake_hands
from illumcli.errors import IllumError, InputError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

PATIENCE = 300.0
"""Seconds that a lost scheduler, or the first worker, is waited for."""
TIMEOUT = 15.0
"""Seconds that one attempt to connect takes at most."""
IGNORE_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""What local workers run first: an interrupt reaches all processes of a terminal; the client handles it."""
LONGEST_TASK = "24 hours"
"""Silence after which a local worker counts as dead. Whether its process lives is seen at once."""


class Connection:
    """A client of a cluster, which is started here if its address is local."""

    def __init__(self, address: Address, tell: Callable[[str], None]) -> None:
        try:
            import dask
            import distributed
        except ImportError:
            raise InputError(
                "--cluster needs Dask's distributed; install it: pip install 'illumcli[cluster]'"
            ) from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        logging.getLogger("tornado").setLevel(logging.CRITICAL)
        dask.config.set(
            {
                "distributed.comm.timeouts.connect": TIMEOUT,
                "distributed.admin.large-graph-warning-threshold": "1GB",
            }
        )
        self._address, self._distributed, self._tell = address, distributed, tell
        self._cluster: LocalCluster | None = self._started() if address.local else None
        self.client: Client = self._connected(until=time.monotonic())
        scheduler = str(self.client.scheduler_info()["address"])
        if not address.local and not scheduler.startswith("tls://"):
            tell(f"{scheduler}: without TLS; who reaches this scheduler can run code on it and its workers")

    def _started(self) -> LocalCluster:
        """Worker processes on this machine, which nobody reaches from others."""
        import dask

        dask.config.set({"distributed.scheduler.worker-ttl": LONGEST_TASK})
        return self._distributed.LocalCluster(
            n_workers=self._address.local,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # no fixed port, which others may have
            silence_logs=logging.CRITICAL,
            preload=[IGNORE_INTERRUPTS],
        )

    def _connected(self, until: float) -> Client:
        """A client; attempts are repeated until this time.

        Raises
        ------
        IllumError
            No scheduler answers.
        """
        while True:
            try:
                return self._distributed.Client(self._place(), timeout=TIMEOUT, set_as_default=False)
            except (IllumError, OSError) as error:
                if time.monotonic() > until:
                    raise (
                        error if isinstance(error, IllumError) else IllumError(f"--cluster: {error}")
                    ) from error
                time.sleep(1)

    def _place(self) -> LocalCluster | str:
        """The cluster that was started here, or the address of a scheduler that answers.

        Raises
        ------
        IllumError
        """
        if self._cluster is not None:
            return self._cluster
        file = self._address.file
        scheduler = self._address.scheduler if file is None else address_in(file)
        shake_hands(scheduler, TIMEOUT)
        return scheduler

    @property
    def is_lost(self) -> bool:
        """True if the scheduler is gone."""
        return self.client.status != "running"

    def reconnect(self) -> None:
        """Connect to the scheduler that took the place of the lost one."""
        self._tell(f"the scheduler is lost; waiting up to {PATIENCE:.0f} s for it or another in its place")
        self.client.close(timeout=1)
        self.client = self._connected(time.monotonic() + PATIENCE)

    def workers(self) -> list[str]:
        """The addresses of all workers, of which there is at least one.

        Raises
        ------
        IllumError
            No worker came.
        """
        began, is_told = time.monotonic(), False
        while not (workers := list(self.client.scheduler_info(n_workers=-1)["workers"])):
            waited = time.monotonic() - began
            if waited > PATIENCE:
                raise IllumError("--cluster: the scheduler has no workers; start some")
            if waited > TIMEOUT and not is_told:
                self._tell(f"the scheduler has no workers; waiting up to {PATIENCE:.0f} s for one")
                is_told = True
            time.sleep(0.2)
        return workers

    def close(self, plugin: str) -> None:
        """End the connection, and the workers that were started here; others give up this plugin."""
        if self._cluster is None and not self.is_lost:
            with suppress(OSError, TimeoutError, ValueError):  # never registered, or the scheduler is gone
                self.client.unregister_worker_plugin(plugin)
        self.client.close(timeout=2)
        if self._cluster is not None:
            self._cluster.close(timeout=5)


def threads_of(address: Address, threads: int | None) -> int | None:
    """Threads of each worker: as asked for; the cores of this machine are shared among local ones."""
    if threads is None and address.local:
        return max(1, len(os.sched_getaffinity(0)) // address.local)
    return threads

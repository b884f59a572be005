"""The connection to the scheduler of a cluster."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from illumcli.cluster import local
from illumcli.cluster.address import Address
from illumcli.cluster.handshake import address_in, shake_hands
from illumcli.errors import IllumError, InputError

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster, WorkerPlugin

PATIENCE = 300.0
"""Seconds that a lost scheduler, or the first worker, is waited for."""
TIMEOUT = 15.0
"""Seconds that one attempt to connect takes at most."""
LOOK = 0.25
"""Seconds between two looks at which workers are there."""


LOST = "--cluster: the scheduler is lost"


class SchedulerLost(IllumError):
    """The scheduler is gone, and with it all tasks that it had."""


class Connection:
    """A client of a cluster, which is started here if its address is local.

    Its methods raise `SchedulerLost` if the scheduler is gone; `reconnect` waits for it, or for another.
    """

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
        self._outcomes: SimpleQueue[tuple[Future, Any]] = SimpleQueue()
        self._cluster: LocalCluster | None = local.started(address.local) if address.local else None
        self._client: Client = self._connected(until=time.monotonic())
        scheduler = str(self._client.scheduler_info()["address"])
        if not address.local and not scheduler.startswith("tls://"):
            tell(f"{scheduler}: without TLS; who reaches this scheduler can run code on it and its workers")

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

    def reconnect(self) -> None:
        """Connect to the scheduler that took the place of the lost one.

        Raises
        ------
        IllumError
            There is none.
        """
        self._tell(f"the scheduler is lost; waiting up to {PATIENCE:.0f} s for it or another in its place")
        self._client.close(timeout=1)
        self._client = self._connected(time.monotonic() + PATIENCE)

    @property
    def _is_lost(self) -> bool:
        return bool(self._client.status != "running")

    def workers(self) -> frozenset[str]:
        """The addresses of all workers; waits for one if there is none.

        Raises
        ------
        IllumError
            No worker came.
        """
        began, is_told = time.monotonic(), False
        while True:
            about = self._client.scheduler_info(n_workers=-1)
            if self._is_lost:
                raise SchedulerLost(LOST)
            if workers := frozenset(about["workers"]):
                return workers
            waited = time.monotonic() - began
            if waited > PATIENCE:
                raise IllumError("--cluster: the scheduler has no workers; start some")
            if waited > TIMEOUT and not is_told:
                self._tell(f"the scheduler has no workers; waiting up to {PATIENCE:.0f} s for one")
                is_told = True
            time.sleep(LOOK)

    def register(self, plugin: WorkerPlugin) -> None:
        """Give all workers a plugin, also those that come later."""
        with self._request():
            self._client.register_plugin(plugin)

    def submit(self, function: Callable[..., Any], *arguments: object, **options: Any) -> Future:
        """Give a task to the scheduler; `outcomes` brings its result."""
        with self._request():
            future = self._client.submit(function, *arguments, **options)
        assert self._client.loop is not None
        self._client.loop.add_callback(self._fetch, self._client, future)
        return future

    async def _fetch(self, client: Client, future: Future) -> None:
        """Wait for the result of a task; results on a worker that stands still delay no others."""
        try:
            outcome = await client.gather(future, asynchronous=True)
        except Exception as error:
            outcome = error
        self._outcomes.put((future, outcome))

    def outcomes(self) -> Iterator[tuple[Future, Any]]:
        """Tasks that are done with their results, or their errors; waits a little for the first."""
        seconds = LOOK
        with suppress(Empty):
            while True:
                future, outcome = self._outcomes.get(timeout=seconds)
                # Dask may have connected again by itself: what it had before is cancelled
                if isinstance(outcome, (OSError, self._distributed.CancelledError)):
                    outcome = SchedulerLost(f"{LOST}: {outcome}")
                yield future, outcome
                seconds = 0

    def cancel(self, future: Future) -> None:
        """Take a task back."""
        with self._request():
            future.cancel()

    @contextmanager
    def _request(self) -> Iterator[None]:
        """Raise SchedulerLost instead of the errors of requests to a scheduler that is gone."""
        try:
            yield
        except (OSError, self._distributed.CancelledError) as error:
            raise SchedulerLost(f"{LOST}: {error}") from error

    def close(self, plugin: str) -> None:
        """End the connection, and the workers that were started here; others give up this plugin."""
        scheduler = self._client.scheduler
        if self._cluster is None and scheduler is not None and not self._is_lost:
            # a worker may stand still; the scheduler be gone; the plugin not be registered yet
            with suppress(OSError, ValueError):
                self._client.sync(scheduler.unregister_worker_plugin, name=plugin, callback_timeout=TIMEOUT)
        self._client.close(timeout=2)
        if self._cluster is not None:
            self._cluster.close(timeout=5)

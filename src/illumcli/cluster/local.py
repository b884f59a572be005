"""Workers of a cluster that is started for one command on this machine; nobody reaches it from others."""

from __future__ import annotations

import logging
import os
from multiprocessing import forkserver
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distributed import LocalCluster

IGNORE_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""What workers run first: an interrupt reaches all processes of a terminal; the client handles it."""
LONGEST_TASK = "24 hours"
"""Silence after which a worker counts as dead. Whether its process lives is seen at once."""


def preload() -> None:
    """Start the process that workers are forked from: it imports what they need while this one plans."""
    forkserver.set_forkserver_preload(["illumcli.cluster.task", "illumcli.commands.render"])
    forkserver.ensure_running()


def started(count: int) -> LocalCluster:
    """So many workers and their scheduler."""
    import dask
    from distributed import LocalCluster

    dask.config.set(
        {
            "distributed.scheduler.worker-ttl": LONGEST_TASK,
            "distributed.worker.multiprocessing-method": "forkserver",
        }
    )
    return LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # no fixed port, which others may have
        silence_logs=logging.CRITICAL,
        preload=[IGNORE_INTERRUPTS],
    )


def threads_of_each(count: int, is_alone: bool) -> int:
    """Threads of each of so many workers, which share the cores; one that works alone has them all."""
    cores = len(os.sched_getaffinity(0))
    return cores if is_alone else max(1, cores // count)

"""Schedulers, workers and clients in processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

COUNT = 12
SWEEP = ["sweep", "s.yaml", "-D", f"materials.clay.exponent=1:100:{COUNT}", "--no-cache",
         "-D", "film={width: 320, height: 240, samples: 4}"]  # fmt: skip
HIDDEN = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none "$0" && exec "$@"']
"""Starts a process that does not see the folder that follows."""


class Machines:
    """Processes of a scheduler and its workers; all end with the test.

    Parameters
    ----------
    folder : Path
        For logs and for what workers keep.
    network : Network, optional
        Each worker runs on a host of its own, the scheduler and clients on the hub; otherwise all on one.
    environment : mapping
        Variables of all processes.
    """

    def __init__(self, folder: Path, network=None, protocol="tcp", **environment: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.host = network.hub_address if network else "127.0.0.1"
        self.address = f"{protocol}://{self.host}:{self.port}"
        self.at_hub = network.inside(network.hub) if network else []
        self.folder, self.network, self.environment = folder, network, environment
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self.start_scheduler()

    def start_scheduler(self):
        file = self.folder / "scheduler.json"
        file.unlink(missing_ok=True)
        protocol = self.address.split("://")[0]
        words = ["--protocol", protocol, "--host", self.host, "--port", str(self.port), "--no-dashboard",
                 "--scheduler-file", str(file)]  # fmt: skip
        self.scheduler = self._started("dask_scheduler", words, "scheduler", self.at_hub)
        until = time.monotonic() + 60
        while time.monotonic() < until:
            if file.exists():
                return self.scheduler
            time.sleep(0.1)
        raise RuntimeError("no scheduler")

    def start_worker(self, before=(), **environment: str):
        """A worker in a folder of its own; `before` are the words of a command that starts it."""
        number = len(self.workers)
        place = self.folder / f"worker{number}"
        place.mkdir(exist_ok=True)
        host = "127.0.0.1"
        if self.network:
            name, host = self.network.hosts[number], self.network.addresses[number]
            before = [*self.network.inside(name), *before]
        preload = ["--preload", str(Path(__file__).with_name("instrumented.py"))]
        words = [self.address, "--nthreads", "1", "--no-dashboard", "--host", host,
                 "--local-directory", str(place), *preload]  # fmt: skip
        log = {"ILLUM_TEST_LOG": str(self.folder / "renders.log"), **environment}
        self.workers.append(self._started("dask_worker", words, place.name, before, **log))
        return self.workers[-1]

    def start_hidden_worker(self, **environment: str):
        """A worker that does not see the client's folder."""
        return self.start_worker([*HIDDEN, str(self.folder / "client")], **environment)

    def renders(self) -> Counter[str]:
        """How many renders workers began, wrote, and found written already."""
        log = self.folder / "renders.log"
        return Counter(line.split()[1] for line in log.read_text().splitlines())

    def _started(self, module, words, name, before=(), **more):
        cache = {"ILLUM_CACHE": str(self.folder / f"cache-{name}")}
        with (self.folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(
                [*before, sys.executable, "-m", f"distributed.cli.{module}", *words],
                stdout=log, stderr=log, cwd=self.folder, start_new_session=True,
                env={**os.environ, **cache, **self.environment, **more},
            )  # fmt: skip

    def stop(self):
        for process in (*self.workers, self.scheduler):
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            process.wait()


class Client:
    """A sweep in a process of its own."""

    def __init__(self, folder: Path, *words: str, before=(), **environment: str) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [*before, sys.executable, "-m", "illumcli", *SWEEP, *words], env={**os.environ, **environment},
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip

    def wait_for(self, count: int, seconds: float = 120) -> None:
        """Until so many pictures are there."""
        until = time.monotonic() + seconds
        while len(pictures(self.folder)) < count:
            assert time.monotonic() < until, self.process.poll()
            assert self.process.poll() is None, self.process.communicate()
            time.sleep(0.02)

    def read_until(self, text: str) -> str:
        """The line of its errors that has this text; waits for it."""
        for line in self.process.stderr:
            if text in line:
                return line
        raise AssertionError(f"ended without a word of '{text}'")

    def finish(self, code: int = 0, seconds: float = 100) -> str:
        """The errors that it printed."""
        errors = self.process.communicate(timeout=seconds)[1]
        assert self.process.returncode == code, errors
        return errors


def pictures(folder: Path) -> dict[str, bytes]:
    """Pictures of the sweep by their names."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("s-*.png"))}


def is_clean(folder: Path, expected: dict[str, bytes]) -> bool:
    """True if the folder holds all pictures and nothing that was left."""
    names = sorted([*expected, "meshes", "s.yaml", "t.png"])
    return pictures(folder) == expected and sorted(os.listdir(folder)) == names

"""Hosts on one machine: network namespaces whose only links lead to a bridge, in a namespace of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import uuid
from contextlib import suppress


class Network:
    """One namespace with a scheduler's address, and some for workers; nothing outside of them is touched.

    Raises
    ------
    OSError, subprocess.CalledProcessError
        There are no namespaces here.
    """

    hub_address = "10.77.0.1"

    def __init__(self, count: int) -> None:
        prefix = f"illum-{uuid.uuid4().hex[:8]}"
        self.hub, self.hosts = f"{prefix}-hub", [f"{prefix}-{number}" for number in range(count)]
        self.addresses = [f"10.77.0.{number + 10}" for number in range(count)]
        try:
            self._make()
        except BaseException:
            self.remove()
            raise

    def _make(self):
        for name in (self.hub, *self.hosts):
            _ip("netns", "add", name)
            _ip("-n", name, "link", "set", "lo", "up")
        _ip("-n", self.hub, "link", "add", "bridge", "type", "bridge")
        _ip("-n", self.hub, "addr", "add", f"{self.hub_address}/24", "dev", "bridge")
        _ip("-n", self.hub, "link", "set", "bridge", "up")
        for number, (name, address) in enumerate(zip(self.hosts, self.addresses, strict=True)):
            port = f"port{number}"
            peer = ["peer", "name", "eth0", "netns", name]
            _ip("-n", self.hub, "link", "add", port, "type", "veth", *peer)
            _ip("-n", self.hub, "link", "set", port, "master", "bridge", "up")
            _ip("-n", name, "addr", "add", f"{address}/24", "dev", "eth0")
            _ip("-n", name, "link", "set", "eth0", "up")

    def inside(self, name):
        """The words before a command that run it in a namespace."""
        return ["ip", "netns", "exec", name]

    def set_link(self, number, state):
        """Cut a host off (`down`), or join it again (`up`)."""
        _ip("-n", self.hub, "link", "set", f"port{number}", state)

    def remove(self):
        """End all processes inside, and remove all namespaces with their links."""
        for name in (*self.hosts, self.hub):
            found = subprocess.run(["ip", "netns", "pids", name], capture_output=True, text=True, check=False)
            for process in found.stdout.split():
                with suppress(ProcessLookupError):
                    os.kill(int(process), signal.SIGKILL)
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)

"""How long does it take from a change to a picture, in the live view?

One window of 640 x 360 on `illum view`, over its socket. Each change of a drag is sent when the picture of
the one before has come, a switch of the model after the full picture. A change is timed until the first
picture that has it, coarse or full: wall seconds of the client, and processor seconds of all threads of the
server, including pictures that were begun and given up. Reference: the limits that the view is built for, 60
ms for a material and 200 ms for a camera on two free cores. Then single changes follow at the film's own
size: wall seconds to the first picture of each stage, and the stated error. With `--minutes`, random use
follows for so long: what the server keeps in memory, and the problems that it reports.

    PYTHONPATH=src python benchmarks/view.py [SCENE] [--mesh MESH] [--minutes M] [--small]
"""

from __future__ import annotations

import argparse
import json
import os
import random
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from websockets.sync.client import ClientConnection, connect

from _bench import ROOT, SMALL, header

CHANGES = 4 if SMALL else 200
RELEASED = 1 if SMALL else 5
MODELS = ("lambert", "phong", "ward", "oren_nayar", "cook_torrance", "blinn_phong")
SIZE = {"width": 64, "height": 36} if SMALL else {"width": 640, "height": 360}


class Window:
    """A window as the page has it."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.stamp = 0
        self.scene: dict[str, Any] = {}
        self.problems: list[str] = []

    def tell(self, **message: Any) -> None:
        """Send a message."""
        self.stamp += 1
        self.socket.send(json.dumps({**message, "stamp": self.stamp}))

    def picture(self, stage: str | None = None) -> dict[str, Any]:
        """The header of the first picture with all messages so far, or of one of a stage."""
        while True:
            answer = self.socket.recv(timeout=600)
            if isinstance(answer, str):
                said = json.loads(answer)
                if said["type"] == "scene":
                    self.scene = said
                if said["type"] == "problem":
                    self.problems += said["lines"]
                if said["type"] == "same" and (said["stamp"] or 0) >= self.stamp:
                    return said
                continue
            (length,) = struct.unpack("<I", answer[:4])
            about = json.loads(answer[4 : 4 + length])
            if (about["stamp"] or 0) >= self.stamp and stage in (None, about["stage"]):
                return about


@contextmanager
def opened(scene: Path) -> Iterator[tuple[Window, int]]:
    """A window on a scene, and the number of the server's process."""
    command = [sys.executable, "-m", "illumcli", "view", str(scene), "--no-browser", "-q"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        url = server.stdout.readline().strip()
        address, site = f"{url.replace('http', 'ws', 1)}live", "/".join(url.split("/")[:3])
        with connect(address, origin=site, compression=None, max_size=None, proxy=None) as socket:
            yield Window(socket), server.pid
        server.terminate()


def processor(pid: int) -> float:
    """Seconds of a processor that a process has taken."""
    parts = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(parts[11]) + int(parts[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid: int) -> float:
    """Memory of a process [MiB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS"))


def changes(window: Window) -> dict[str, Callable[[int], dict[str, Any]]]:
    """Messages by what they change: the first material that an object has, the first light, the camera."""
    material = next(each["name"] for each in window.scene["materials"] if each["objects"])
    values = {control["path"]: control["value"] for control in window.scene["controls"]}
    color = next(
        path for path in values if path.startswith(f"materials.{material}.") and path.endswith("diffuse")
    )
    place = next(path for path in values if path.startswith("lights.") and path.endswith("position"))
    x, y, z = values[place]

    def of(path: str, value: Any, is_dragged: bool = True) -> dict[str, Any]:
        return {"type": "set", "path": path, "value": value, "dragging": is_dragged}

    return {
        "colour": lambda k: of(color, [0.2 + 0.003 * k, 0.3, 0.4]),
        "model": lambda k: of(f"materials.{material}.model", MODELS[k % len(MODELS)], False),
        "light": lambda k: of(place, [x + 0.01 * (k + 1), y, z]),
        "camera": lambda k: {"type": "move", "orbit": [0.005, 0.002 * (-1) ** (k // 20)], "dragging": True},
    }


def measured(window: Window, pid: int, make: Callable[[int], dict[str, Any]]) -> str:
    """Change after change: milliseconds to the first picture, processor milliseconds, pixels and rays."""
    walls, widths, rays, start = [], [], [], processor(pid)
    for number in range(CHANGES):
        began = time.perf_counter()
        message = make(number)
        window.tell(**message)
        about = window.picture()
        walls.append(1e3 * (time.perf_counter() - began))
        widths.append(about["width"])
        rays.append(about["rays"])
        if not message["dragging"] and about.get("stage") == "coarse":
            window.picture("full")
    cpu = 1e3 * (processor(pid) - start) / CHANGES
    window.tell(type="view", layer="beauty")
    window.picture("full")
    return f"{median(walls):10.0f} {max(walls):10.0f} {cpu:10.0f} {median(widths):10.0f} {median(rays):12.0f}"


def released(window: Window, make: Callable[[int], dict[str, Any]]) -> str:
    """Change after change, each until its full picture: median seconds to each stage, and the error."""
    seconds: dict[str, list[float]] = {}
    error = None
    for number in range(RELEASED):
        window.tell(**make(number) | {"dragging": False})
        began, stage = time.perf_counter(), None
        while stage != "full":
            about = window.picture()
            if about.get("stage") not in (None, stage):
                stage = about["stage"]
                seconds.setdefault(stage, []).append(time.perf_counter() - began)
            error = about.get("error") or error
    stages = ", ".join(f"{stage} {median(times):.2f} s" for stage, times in seconds.items())
    return f"{stages}; error {'not stated' if error is None else f'{error:.2g}'}"


def used(window: Window, pid: int, minutes: float, seed: int = 0) -> None:
    """Random use: values of all controls, moves, models, layers, resets; memory at ten times."""
    draw, begun = random.Random(seed), time.monotonic()
    layers = [layer["name"] for layer in window.scene["layers"] if layer["name"] != "error"]
    sizes, sent, told = [], 0, len(window.problems)
    while (passed := (time.monotonic() - begun) / 60) < minutes:
        control = draw.choice(
            [each for each in window.scene["controls"] if None not in (each["minimum"], each["value"])]
        )
        low, high = control["minimum"], control["maximum"]
        kind = draw.random()
        if kind < 0.5 and control["kind"] in ("number", "color", "vector") and "film" not in control["path"]:
            count = len(control["value"]) if isinstance(control["value"], list) else 1
            for _ in range(draw.randrange(1, 12)):
                values = [draw.uniform(low, high) for _ in range(count)]
                value = values[0] if control["kind"] == "number" else values
                window.tell(type="set", path=control["path"], value=value, dragging=True)
                sent += 1
        elif kind < 0.8:
            for _ in range(draw.randrange(1, 12)):
                window.tell(
                    type="move", orbit=[draw.uniform(-0.1, 0.1), draw.uniform(-0.1, 0.1)], dragging=True
                )
                sent += 1
        elif kind < 0.9:
            window.tell(type="view", layer=draw.choice(layers))
        elif kind < 0.95:
            name = draw.choice(window.scene["materials"])["name"]
            window.tell(type="set", path=f"materials.{name}.model", value=draw.choice(MODELS))
        else:
            window.tell(type="reset")
        window.picture("full" if draw.random() < 0.1 else None)
        if passed >= minutes * len(sizes) / 10:
            sizes.append(resident(pid))
    print(
        f"{minutes:g} minutes of random use, {sent} changes of drags, {len(window.problems) - told} problems"
    )
    print("resident [MiB]: " + " ".join(f"{size:.0f}" for size in sizes))


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("scene", nargs="?", type=Path, default=ROOT / "scenes" / "teapot.yaml")
    options.add_argument("--mesh", type=Path, help="a mesh in the studio, too, such as the bunny")
    options.add_argument("--minutes", type=float, default=0.02 if SMALL else 0.0)
    options.add_argument("--small", action="store_true")
    said = options.parse_args()
    header("How long does it take from a change to a picture?", changes=CHANGES, **SIZE)
    subjects = [said.scene, *([said.mesh] if said.mesh else [])]
    for subject in subjects:
        with opened(subject) as (window, pid):
            window.picture()
            window.tell(type="view", **SIZE)
            window.picture("full")
            columns = f"{'median [ms]':>12s} {'worst':>8s} {'cpu [ms]':>10s} {'width':>10s} {'rays':>12s}"
            print(f"{subject.name:12s} {columns}")
            for name, make in changes(window).items():
                print(f"{name:12s} {measured(window, pid, make)}", flush=True)
            width, height = (SIZE["width"], SIZE["height"]) if SMALL else window.scene["film"]
            window.tell(type="view", width=width, height=height)
            window.picture("full")
            print(f"released at {width} x {height}")
            for name, make in changes(window).items():
                print(f"{name:12s} {released(window, make)}", flush=True)
            window.tell(type="view", **SIZE)
            window.picture("full")
            if said.minutes:
                used(window, pid, said.minutes)
            for line in dict.fromkeys(window.problems):
                print(f"problem: {line}")


if __name__ == "__main__":
    main()

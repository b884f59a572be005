"""How does the cost of a job grow with what a scene has most of, and is anything worse than linear?

Each series is one command on scenes that differ in a count alone: frames of a camera's path, variants of a
material, triangles of a mesh file, mesh files, copies of one mesh, lights on one thread and on two, texels,
materials scattered over triangles; `check` of as many objects, lights, materials and cameras as a scene file
may hold. Processor seconds and peak memory of whole processes, nothing kept between runs; seconds are the
least of the repeats. A row states what each unit costs beyond the first row's job; below a series stands the
exponent p of cost = fixed + c * count^p, fitted to all rows, and the one between the last two. Seed 0.

    PYTHONPATH=src python benchmarks/growth.py [--small] [--repeats N] [--most N] [SERIES ...]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from _bench import ROOT, SMALL, bunny, header, lit_scene

HEAD = """\
version: 1
camera: {position: [2.2, 1.6, 3.4], target: [0, 0.2, 0], fov: 30}
film: {width: WIDTH, height: HEIGHT, background: 0}
outputs: {files: ["out.png"]}
"""
LAMP = "lights: [{light: point, position: [3, 4, 5], intensity: 30}]\n"


@dataclass(frozen=True, slots=True)
class Cost:
    """What one process took."""

    seconds: float  # of all its processors
    peak: int  # [bytes]


def cost(words: Sequence[object], folder: Path) -> Cost:
    """Run `illum` with these words; it must end well."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "ILLUM_CACHE": str(folder / "cache")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "illumcli", *map(str, words)]
    with (folder / "errors").open("w+") as errors:
        running = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=errors
        )
        peak = 0  # asked for while it runs: what the system keeps of it counts this process, too
        while os.waitid(os.P_PID, running.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            peak = max(peak, _resident(running.pid))
            time.sleep(0.005)
        _, status, usage = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
        if running.returncode:
            raise SystemExit(f"{' '.join(command)}: {(folder / 'errors').read_text()}")
    return Cost(usage.ru_utime + usage.ru_stime, peak)


def _resident(process: int) -> int:
    """The largest resident size of a process so far [bytes]."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:")), 0)


# --- scenes ----------------------------------------------------------------------------------------------


def render(scene: str, *more: object) -> list[object]:
    """The words that render a scene anew."""
    return ["render", scene, "--force", "-q", "--no-cache", *more]


def written(folder: Path, text: str, width: int = 320, height: int = 180) -> str:
    """The name of a scene of this text, below a common head."""
    size = (16, 9) if SMALL else (width, height)
    head = HEAD.replace("WIDTH", str(size[0])).replace("HEIGHT", str(size[1]))
    (folder / "scene.yaml").write_text(head + text)
    return "scene.yaml"


def frames(folder: Path, count: int) -> list[object]:
    """An eye on a circle around the bunny, two lights, a thumbnail a frame."""
    scene = lit_scene(folder, *((16, 9) if SMALL else (96, 54))).name
    path = "camera.position=[3*cos(frame/100), 1.6, 3*sin(frame/100)]"
    words = ["--frames", f"0:{count - 1}", "-D", path, "-o", "out/{frame}.png"]
    return ["sweep", scene, *words, "--force", "-q", "--no-cache"]


def variants(folder: Path, count: int) -> list[object]:
    """An exponent of the bunny's highlight, a thumbnail a variant."""
    scene = lit_scene(folder, *((16, 9) if SMALL else (96, 54))).name
    words = [
        "-D",
        f"materials.gloss.exponent=4:400:{max(count, 2)}",
        "-o",
        "out/{materials.gloss.exponent}.png",
    ]
    return ["sweep", scene, *words, "--force", "-q", "--no-cache"]


def triangles(folder: Path, count: int) -> list[object]:
    """A sphere in a binary PLY."""
    sphere(folder / "sphere.ply", count)
    return render(written(folder, LAMP + "objects: [{mesh: sphere.ply}]\n"))


def sphere(path: Path, count: int, radius: float = 1.0) -> None:
    """A sphere of about so many triangles."""
    around = max(round(count**0.5), 3)
    rows = max(count // (2 * around), 1)
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(-1.5, 1.5, rows + 1))
    points = radius * np.stack([np.cos(u) * np.cos(v), np.sin(v), -np.sin(u) * np.cos(v)], -1).reshape(-1, 3)
    a = np.arange(rows * around, dtype=np.int32).reshape(rows, around)
    b = np.roll(a, -1, axis=1)
    faces = np.empty((rows, around, 2), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"] = 3
    faces["v"][..., 0, :] = np.stack([a, b, b + around], -1)
    faces["v"][..., 1, :] = np.stack([a, b + around, a + around], -1)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {faces.size}", "property list uchar int vertex_indices", "end_header"]
    path.write_bytes("\n".join([*lines, ""]).encode() + points.astype("<f4").tobytes() + faces.tobytes())


def placed(number: int, mesh: str, more: str = "") -> str:
    """A line of an object on a lattice within the view."""
    x, y, z = number % 25 - 12, number // 25 % 25 - 12, number // 625
    place = f"[{0.08 * x:.3g}, {0.08 * y:.3g}, {-0.08 * z:.3g}]"
    return f"  - {{mesh: {mesh}, transform: {{scale: 0.03, translate: {place}}}{more}}}\n"


def meshes(folder: Path, count: int) -> list[object]:
    """So many small mesh files, each another sphere."""
    for number in range(count):
        if not (folder / f"m{number}.ply").exists():
            sphere(folder / f"m{number}.ply", 64, 1 + number / 1e5)
    return render(
        written(folder, LAMP + "objects:\n" + "".join(placed(n, f"m{n}.ply") for n in range(count)))
    )


def copies(folder: Path, count: int) -> list[object]:
    """So many objects of one small mesh file."""
    sphere(folder / "m.ply", 64)
    return render(written(folder, LAMP + "objects:\n" + "".join(placed(n, "m.ply") for n in range(count))))


def lights_on(threads: int) -> Callable[[Path, int], list[object]]:
    """The bunny under so many lights."""

    def lights(folder: Path, count: int) -> list[object]:
        size = (16, 9) if SMALL else (320, 180)
        return render(lit_scene(folder, *size, lights=count).name, "-t", threads)

    return lights


def texels(folder: Path, count: int) -> list[object]:
    """A floor with a texture of 8 bits in three channels."""
    import OpenImageIO as oiio

    side = round(count**0.5)
    name = f"texture{side}.png"
    if not (folder / name).exists():
        rows = np.arange(side, dtype=np.uint8)
        image = np.stack([rows[:, None] + rows, rows[:, None] ^ rows, np.add.outer(rows, 2 * rows)], -1)
        out = oiio.ImageOutput.create(str(folder / name))
        out.open(str(folder / name), oiio.ImageSpec(side, side, 3, "uint8"))
        out.write_image(image)
        out.close()
    text = f"materials: {{m: {{model: lambert, diffuse: {{texture: {name}}}}}}}\n"
    return render(written(folder, LAMP + text + "objects: [{mesh: {shape: plane}, material: m}]\n"))


def scattered(folder: Path, count: int) -> list[object]:
    """Materials that a mesh file gives to its triangles at random, at 320x180 under eight lights."""
    around, rows = (8, 4) if SMALL else (100, 50)
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(-1.5, 1.5, rows + 1))
    points = np.stack([np.cos(u) * np.cos(v), np.sin(v), -np.sin(u) * np.cos(v)], -1).reshape(-1, 3)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    which = np.random.default_rng(0).integers(0, count, (rows, around))
    for i in range(rows):
        for j in range(around):
            a, b = i * around + j + 1, i * around + (j + 1) % around + 1
            lines += [f"usemtl m{which[i, j]}", f"f {a} {b} {b + around} {a + around}"]
    (folder / "scattered.obj").write_text("\n".join([*lines, ""]))
    models = [
        f"  m{n}: {{model: phong, diffuse: [{0.1 + n % 9 / 10:.1f}, 0.5, 0.4], exponent: {1 + n % 90}}}\n"
        for n in range(count)
    ]
    lamps = [f"  - {{light: point, position: [{3 - n}, 4, 5], intensity: 4}}\n" for n in range(8)]
    text = "".join(["materials:\n", *models, "lights:\n", *lamps])
    return render(written(folder, text + "objects: [{mesh: scattered.obj}]\n"))


def checked(kind: str) -> Callable[[Path, int], list[object]]:
    """A scene with so many of one kind, validated and planned alone."""

    def check(folder: Path, count: int) -> list[object]:
        (folder / "m.ply").touch()
        rows = {"objects": [], "lights": [], "materials": [], "cameras": []}  # type: dict[str, list[str]]
        for n in range(count):
            match kind:
                case "objects":
                    rows[kind].append(placed(n, "m.ply"))
                case "lights":
                    rows[kind].append(f"  - {{light: point, position: [{n}, 4, 5], intensity: 1}}\n")
                case "materials":
                    rows[kind].append(f"  m{n}: {{model: lambert, diffuse: 0.5}}\n")
                case "cameras":
                    rows[kind].append(f"  c{n}: {{position: [{n}, 1, 3], target: [0, 0, 0]}}\n")
        rows["objects"] = rows["objects"] or [
            placed(0, "m.ply", ", material: m0" if kind == "materials" else "")
        ]
        text = "".join(f"{name}:\n{''.join(lines)}" for name, lines in rows.items() if lines)
        head = HEAD.replace("WIDTH", "16").replace("HEIGHT", "9").replace("out.png", "{camera}.png")
        if kind == "cameras":
            head = "\n".join(line for line in head.splitlines() if not line.startswith("camera:")) + "\n"
        (folder / "scene.yaml").write_text(head + text)
        return ["check", "scene.yaml"]

    return check


Series = tuple[Callable[[Path, int], list[object]], list[int], list[int]]
SERIES: dict[str, Series] = {  # the command for a count; counts; counts of the small form
    "frames": (frames, [1, 20, 200, 1000], [1, 2]),
    "variants": (variants, [2, 20, 200, 1000], [2, 3]),
    "triangles": (triangles, [10**4, 10**5, 10**6, 10**7], [100, 200]),
    "meshes": (meshes, [1, 100, 1000, 10**4], [1, 2]),
    "copies": (copies, [1, 100, 1000, 10**4], [1, 2]),
    "lights, 1 thread": (lights_on(1), [1, 8, 64, 512], [1, 2]),
    "lights, 2 threads": (lights_on(2), [1, 8, 64, 512], [1, 2]),
    "texels": (texels, [2**16, 2**20, 2**24, 2**26], [2**8, 2**10]),
    "scattered": (scattered, [1, 10, 100, 1000], [1, 2]),
    "check objects": (checked("objects"), [1, 80, 800, 8000], [1, 2]),
    "check lights": (checked("lights"), [1, 80, 800, 8000], [1, 2]),
    "check materials": (checked("materials"), [1, 80, 800, 8000], [1, 2]),
    "check cameras": (checked("cameras"), [1, 80, 800, 8000], [1, 2]),
}


# --- tables ----------------------------------------------------------------------------------------------


def exponents(counts: Sequence[int], costs: Sequence[float]) -> tuple[float, float]:
    """p of cost = first + c * (count - first)^p: over all rows, and between the last two."""
    n, more = np.subtract(counts[1:], counts[0]), np.subtract(costs[1:], costs[0])
    rises = more > 0
    if np.count_nonzero(rises) < 2:
        return float("nan"), float("nan")
    x, y = np.log(n[rises]), np.log(more[rises])
    return float(np.polyfit(x, y, 1)[0]), float((y[-1] - y[-2]) / (x[-1] - x[-2]))


def series(name: str, counts: Sequence[int], repeats: int) -> None:
    """The rows of a series, and its exponents."""
    print(f"\n{name:>18s} {'cpu [s]':>9s} {'each [us]':>11s} {'peak [MiB]':>11s} {'each [bytes]':>13s}")
    found: list[Cost] = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        bunny(folder)
        for count in counts:
            words = SERIES[name][0](folder, count)
            runs = [cost(words, folder) for _ in range(repeats)]
            found.append(Cost(min(run.seconds for run in runs), min(run.peak for run in runs)))
            more, first, last = count - counts[0], found[0], found[-1]
            each = f"{(last.seconds - first.seconds) / more * 1e6:11.4g}" if more else ""
            room = f"{(last.peak - first.peak) / more:13.4g}" if more else ""
            print(
                f"{count:18d} {last.seconds:9.2f} {each:>11s} {last.peak / 2**20:11.0f} {room:>13s}",
                flush=True,
            )
    times = exponents(counts, [each.seconds for each in found])
    rooms = exponents(counts, [each.peak for each in found])
    print(
        f"{'exponent':>18s} time {times[0]:.2f}, at the end {times[1]:.2f}; "
        f"memory {rooms[0]:.2f}, {rooms[1]:.2f}"
    )


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument(
        "series", nargs="*", help=f"of {', '.join(SERIES)}; by their first words, by default all"
    )
    options.add_argument("--small", action="store_true")
    options.add_argument("--repeats", type=int, default=1 if SMALL else 2)
    options.add_argument("--most", type=int, default=10**9, help="no count beyond this")
    said = options.parse_args()
    header("How does the cost of a job grow with what a scene has most of?", least_of=said.repeats)
    for name, (_, counts, small) in SERIES.items():
        if not said.series or any(name.startswith(word) for word in said.series):
            series(
                name, [count for count in (small if SMALL else counts) if count <= said.most], said.repeats
            )


if __name__ == "__main__":
    main()

"""Functions that the scripts share: scenes, clocks, interleaved repeats, rows with medians and spread."""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median

from illumcli.render_graph.build import build
from illumcli.render_graph.schedule import Plan, outputs_of, schedule
from illumcli.scene.scene_file import SceneFile

ROOT = Path(__file__).parents[1]
MESHES = ROOT.parent / "shared" / "meshes"
SMALL = "--small" in sys.argv
"""A tiny version of every script, to see that it runs; its figures mean nothing."""
REPEATS = 1 if SMALL else 5


@dataclass(frozen=True, slots=True)
class Took:
    """Seconds of one run."""

    wall: float
    cpu: float  # of all threads, and of children that ended


def header(question: str, **facts: object) -> None:
    """Print the question and what the rows depend on."""
    print(f"# {question}")
    names = ("numpy", "embreex", "OpenImageIO", "pydantic")
    print(f"# python {platform.python_version()}, " + ", ".join(f"{n} {version(n)}" for n in names))
    print(
        f"# {processor()}, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f} at the start"
    )
    said = {"repeats": REPEATS, **facts}
    print("# " + ", ".join(f"{name} {value}" for name, value in said.items()) + (", SMALL" if SMALL else ""))


def processor() -> str:
    """The processor's name as the system tells it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def took(run: Callable[[], object]) -> Took:
    """How long one run takes, in this process or in processes it waits for."""
    before, start = _cpu(), time.perf_counter()
    run()
    return Took(time.perf_counter() - start, _cpu() - before)


def _cpu() -> float:
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def interleaved(runs: Mapping[str, Callable[[], object]], repeats: int = REPEATS) -> dict[str, list[Took]]:
    """Every run once per round, so that whatever else the machine does meets all alike."""
    times: dict[str, list[Took]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            times[name].append(took(run))
    return times


def planned(loaded: SceneFile, layers: Sequence[str]) -> Plan:
    """The plan of a scene's first view."""
    graph = build(loaded.scene, loaded)
    return schedule(graph, outputs_of(loaded.scene, layers), graph.views[0])


def table(times: Mapping[str, Sequence[Took]], over: str | None = None) -> None:
    """Print a row per run: seconds, and its ratio to `over` round by round; median, least and most."""
    print(f"{'':34s} {'wall [s]':>26s} {'cpu [s]':>26s}" + (f" {'wall / ' + over:>26s}" if over else ""))
    for name, own in times.items():
        cells = [spread([t.wall for t in own]), spread([t.cpu for t in own])]
        if over:
            cells.append(spread([t.wall / o.wall for t, o in zip(own, times[over], strict=True)]))
        print(f"{name:34s} " + " ".join(f"{cell:>26s}" for cell in cells))


def ratio(what: str, times: Mapping[str, Sequence[Took]], a: str, b: str) -> None:
    """Print a / b, round by round, by the wall's clock and by processor time."""
    pairs = list(zip(times[a], times[b], strict=True))
    wall, cpu = [x.wall / y.wall for x, y in pairs], [x.cpu / y.cpu for x, y in pairs]
    print(f"ratio {what}: wall {spread(wall)}, cpu {spread(cpu)}")


def spread(values: Sequence[float]) -> str:
    """`median (least .. most)`."""
    return f"{median(values):.4g} ({min(values):.4g} .. {max(values):.4g})"


def illum(*words: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The whole command in a process of its own, with an empty cache folder unless one is given."""
    return process([sys.executable, "-m", "illumcli", *map(str, words)], cwd, **environment)


def process(
    command: Sequence[str], cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """A process that must end well."""
    own = {
        "PYTHONPATH": str(ROOT / "src"),
        "PYTHONDONTWRITEBYTECODE": "",  # else every run would compile every module
        "ILLUM_CACHE": str((cwd or ROOT) / "cache"),
        **environment,
    }
    return subprocess.run(
        command, cwd=cwd, env={**os.environ, **own}, text=True, capture_output=True, check=True
    )


def bunny(folder: Path) -> str:
    """How a scene in `folder` names the bunny; the teapot where the real mesh is not at hand."""
    source = MESHES / "stanford-bunny.obj"
    if SMALL or not source.exists():
        return "{shape: teapot}"
    (folder / "bunny.obj").write_bytes(source.read_bytes())
    return "bunny.obj"


def ambient_scene(folder: Path, width: int, height: int, rays: int, samples: int = 1) -> Path:
    """Obscurance alone: the bunny of unit radius over a floor, white under a constant sky."""
    path = folder / f"ambient-{width}x{height}-{samples}-{rays}.yaml"
    path.write_text(f"""\
version: 1
camera: {{position: [2.2, 1.6, 3.4], target: [0, 0.55, 0], fov: 30}}
film: {{width: {width}, height: {height}, samples: {samples}, background: 0}}
ambient: 1
obscurance: {{samples: {rays}}}
materials: {{white: {{model: lambert, diffuse: 1}}}}
objects:
  - {{mesh: {bunny(folder)}, material: white, transform: {{fit: 1}}}}
  - {{mesh: {{shape: disc, radius: 20}}, material: white}}
outputs: {{files: ["{path.stem}.exr"]}}
""")
    return path


def lit_scene(folder: Path, width: int, height: int, samples: int = 1, lights: int = 2) -> Path:
    """Phong with shadows: the bunny over a floor under point lights on a ring."""
    path = folder / f"lit-{width}x{height}-{samples}-{lights}.yaml"
    from math import cos, pi, sin

    lamps = "\n".join(
        f"  - {{light: point, position: [{4 * cos(0.7 + 2 * pi * k / lights):.6f}, 4, "
        f"{4 * sin(0.7 + 2 * pi * k / lights):.6f}], intensity: {40 / lights:.6f}}}"
        for k in range(lights)
    )
    path.write_text(f"""\
version: 1
camera: {{position: [2.2, 1.6, 3.4], target: [0, 0.55, 0], fov: 30}}
film: {{width: {width}, height: {height}, samples: {samples}, background: 0}}
materials: {{gloss: {{model: phong, diffuse: 0.6, specular: 0.3, exponent: 40}}}}
objects:
  - {{mesh: {bunny(folder)}, material: gloss, transform: {{fit: 1}}}}
  - {{mesh: {{shape: disc, radius: 20}}, material: gloss}}
lights:
{lamps}
outputs: {{files: ["{path.stem}.png"]}}
""")
    return path

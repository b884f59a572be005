"""Is a render linear in pixels, samples and lights, and how does it grow with triangles?

Each row is a job in this process; time per unit should stay where it is. Pixels from 160x90 to 2560x1440,
samples 1 to 64, lights 1 to 1024; triangles 1e4 to 1e7 as a sphere given by a formula, in a process of its
own, with its costliest stages and peak of memory. Nothing is kept between runs. Seed 0.

    PYTHONPATH=src python benchmarks/scaling.py [--small] [pixels samples lights triangles]
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from _bench import REPEATS, SMALL, Took, header, illum, interleaved, lit_scene, spread
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene

AXES = ("pixels", "samples", "lights", "triangles")


def rows(title: str, scenes: dict[int, Path]) -> None:
    """A row per scene, from small to large, and its time per unit beside the largest's."""
    runs = {
        str(count): lambda scene=scene: render_scene(RenderJob(scene, RenderOptions(force=True, cache=False)))
        for count, scene in scenes.items()
    }
    times = interleaved(runs, 1 if SMALL else REPEATS)
    print(f"\n{title:>12s} {'wall [s]':>26s} {'cpu [s]':>26s} {'cpu per unit / at the most':>34s}")
    largest = list(scenes)[-1]
    for count in scenes:
        own, last = times[str(count)], times[str(largest)]
        each = [x.cpu / count / (y.cpu / largest) for x, y in zip(own, last, strict=True)]
        print(f"{count:12d} {_wall(own):>26s} {spread([t.cpu for t in own]):>26s} {spread(each):>34s}")


def _wall(times: Sequence[Took]) -> str:
    return spread([t.wall for t in times])


def sphere_scene(folder: Path, triangles: int) -> Path:
    """A sphere of about so many triangles under one light, small on the film: the mesh is what costs."""
    path = folder / f"sphere-{triangles}.yaml"
    around = min(round(triangles**0.5), 3000)  # quads, of two triangles each
    path.write_text(f"""\
version: 1
film: {{width: 320, height: 180, samples: 1, background: 0}}
objects:
  - mesh:
      shape: parametric
      x: cos(u) * cos(v)
      y: sin(v)
      z: sin(u) * cos(v)
      u: [0, 6.283185307179586]
      v: [-1.5, 1.5]
      resolution: [{around}, {triangles // (2 * around)}]
lights: [{{light: point, position: [3, 4, 5], intensity: 30}}]
outputs: {{files: ["{path.stem}.png"]}}
""")
    return path


def triangle_rows(folder: Path, counts: Sequence[int]) -> None:
    """A row per mesh: seconds of each stage and the peak memory of its process."""
    print(f"\n{'triangles':>12s} {'job [s]':>9s} {'peak [MiB]':>11s}  seconds by stage")
    for count in counts:
        scene = sphere_scene(folder, count)
        illum("render", scene, "--force", "-q", "--no-cache", "--report", "r.json", cwd=folder)
        report = json.loads((folder / "r.json").read_text())
        stages = sorted(report["seconds"].items(), key=lambda item: -item[1])[:6]
        parts = ", ".join(f"{name.partition('(')[0]} {seconds:.3f}" for name, seconds in stages)
        peak = report["peak_memory_bytes"] / 2**20
        print(f"{count:12d} {report['total_seconds']:9.2f} {peak:11.0f}  {parts}")


def main(axes: Sequence[str]) -> None:
    header("Is a render linear in pixels, samples and lights, and how does it grow with triangles?")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        if "pixels" in axes:
            sides = [10, 20] if SMALL else [10, 20, 40, 80, 160]
            rows("pixels", {s * 16 * s * 9: lit_scene(folder, 16 * s, 9 * s) for s in sides})
        if "samples" in axes:
            size = (32, 18) if SMALL else (320, 180)
            rows("samples", {n: lit_scene(folder, *size, n) for n in ([1, 2] if SMALL else [1, 4, 16, 64])})
        if "lights" in axes:
            counts = [1, 4] if SMALL else [1, 8, 64, 256, 1024]
            size = (32, 18) if SMALL else (160, 90)
            rows("lights", {n: lit_scene(folder, *size, lights=n) for n in counts})
        if "triangles" in axes:
            triangle_rows(folder, [1000] if SMALL else [10**4, 10**5, 10**6, 10**7])


if __name__ == "__main__":
    main([word for word in sys.argv[1:] if word in AXES] or AXES)

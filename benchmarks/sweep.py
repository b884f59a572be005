"""What does a variant cost if only a material changes, and does its picture equal that of a cold render?

`python benchmarks/sweep.py [MESH.obj] [--variants N] [--width W] [--runs N] [--cold N]`: ratios within one
run; cold renders and shell runs alternate with what they are compared to. The cache is this run's own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from illumcli.commands.options import RenderOptions

MESH = Path(__file__).parents[2] / "shared" / "meshes" / "stanford-bunny.obj"
SCENE = """
version: 1
camera: {position: [1.5, 1.5, 3.4], target: [0.0, 0.62, 0.0], fov: 32}
film: {width: WIDTH, height: HEIGHT, samples: 1, background: [0.6, 0.62, 0.66]}
ambient: [0.46, 0.48, 0.52]
obscurance: {samples: 64, falloff: {falloff: smooth, max_distance: 2.5}}
meshes:
  subject: {file: mesh.obj}
  floor: {shape: disc, radius: 50}
materials:
  subject: {model: blinn_phong, diffuse: [0.72, 0.68, 0.62], specular: 0.12, exponent: 40}
  floor: {model: lambert, diffuse: [0.72, 0.72, 0.74]}
objects:
  - {name: subject, mesh: subject, material: subject, transform: {fit: 1}}
  - {name: floor, mesh: floor, material: floor}
lights:
  - {name: key, light: point, position: [-3.2, 5.2, 3.6], intensity: [30, 29, 27]}
  - {name: fill, light: point, position: [4.6, 2.6, 2.4], intensity: [5, 6, 7]}
outputs: {files: ["{scene}.png"]}
"""
IMPORTS = "import click, embreex.rtcore_scene, numpy, OpenImageIO, pydantic, yaml"


def seconds(command: list[str], **more: object) -> float:
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, **more)  # type: ignore[call-overload]
    return time.perf_counter() - start


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("mesh", nargs="?", type=Path, default=MESH)
    options.add_argument("--variants", type=int, default=24)
    options.add_argument("--width", type=int, default=1280)
    options.add_argument("--runs", type=int, default=7)
    options.add_argument("--cold", type=int, default=3, help="variants that are rendered cold, too")
    said = options.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["ILLUM_CACHE"] = f"{folder}/kept"
        os.chdir(folder)
        Path("mesh.obj").write_bytes(said.mesh.read_bytes())
        height = said.width * 9 // 16
        Path("scene.yaml").write_text(SCENE.replace("WIDTH", str(said.width)).replace("HEIGHT", str(height)))
        swept(said.variants, said.cold)
        shell(said.runs)
        moved()
        stored()


def swept(count: int, cold: int) -> None:
    """A sweep of one material parameter: variants against the first render, bytes against cold ones."""
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene
    from illumcli.commands.sweep import sweep_scene
    from illumcli.scene.variants import variants_of

    axis = f"materials.subject.exponent=4:256:{count}log"
    done = sweep_scene(Path("scene.yaml"), variants_of([axis]))
    took = [outcome.report.total_seconds for outcome in done.outcomes if outcome.report]
    rays = [sum(outcome.report.rays.values()) for outcome in done.outcomes if outcome.report]
    rest = took[1:]
    print(f"sweep of {count}: first {took[0]:.2f} s, {rays[0]:,} rays; others {sum(rays[1:])} rays")
    print(f"  variant / first: mean {np.mean(rest) / took[0]:.4f}, worst {max(rest) / took[0]:.4f}")
    same = 0
    some = done.outcomes[:: max(1, count // cold)]
    for outcome in some:
        (path,), _ = render_scene(
            RenderJob(
                Path("scene.yaml"),
                RenderOptions(outcome.variant.overrides, "cold.png", force=True, cache=False),
            )
        )
        same += path.read_bytes() == outcome.paths[0].read_bytes()
    print(f"  same bytes as a cold render of its own: {same} of {len(some)} tried")


def shell(runs: int) -> None:
    """A shell loop over the parameter against importing the six libraries."""
    python = [sys.executable]
    floors, takes = [], []
    for k in range(runs):
        floors.append(seconds([*python, "-c", IMPORTS]))
        value = f"materials.subject.specular={0.1 + k / 100}"
        command = [*python, "-m", "illumcli", "render", "scene.yaml", "-D", value, "-o", f"loop{k}.png"]
        takes.append(seconds(command))
    best, floor = min(takes), min(floors)
    print(f"shell loop: best {best:.3f} s, six imports {floor:.3f} s, ratio {best / floor:.2f}")
    print(f"  median ratio {np.median(np.array(takes) / floors):.2f}")


def moved() -> None:
    """What is traced again after one thing moves."""
    from illumcli.commands.options import RenderJob
    from illumcli.commands.render import render_scene

    changes = {
        "colours": [
            "materials.subject.diffuse=0.3",
            "lights.key.intensity=9",
            "ambient=0.2",
            "film.exposure=1",
        ],
        "key light moved": ["lights.key.position=[-3,5,4]"],
        "eye moved": ["camera.position=[1.4,1.5,3.5]"],
    }
    for name, overrides in changes.items():
        _, report = render_scene(
            RenderJob(Path("scene.yaml"), RenderOptions(overrides, "moved.png", force=True))
        )
        meshes = [each for each in report.seconds if each.startswith("mesh:")]
        print(f"{name}: rays {report.rays}, meshes parsed {meshes}")


def stored() -> None:
    """Every artifact: bytes, seconds it took, seconds to load it, checksum included."""
    from illumcli.cache.entry import described
    from illumcli.cache.location import open_store
    from illumcli.commands.options import RenderJob
    from illumcli.commands.render import render_scene

    store = open_store()
    store.prune(0)
    size = ["film.width=1920", "film.height=1080", "obscurance.samples=4"]
    _, cold = render_scene(RenderJob(Path("scene.yaml"), RenderOptions(size, "hd.png", force=True)))
    total = 0
    for entry in store.entries():
        start = time.perf_counter()
        store.read(entry.key)
        load = time.perf_counter() - start
        name = described(entry.path)["about"]["buffer"]
        total += entry.bytes
        made = cold.seconds.get(name, 0)
        print(f"  {name:24}{entry.bytes:>12,} bytes, own step {made:8.4f} s, load {load:.4f} s")
    print(f"1920 x 1080, 1 sample: {total:,} bytes")


if __name__ == "__main__":
    main()

"""How large is the error of obscurance in pictures, raw and reconstructed, at each number of rays?

Meshes of unit radius on a floor, white under a constant sky, and 1,500 thin blades; one sample per pixel. The
error is that of the layer `obscurance` over the pixels that see a surface. It is measured against two
references of another sampler, whose own errors cancel in the mean of (w - first)(w - second). Nothing was
chosen on igea, spot and the teapot.

    PYTHONPATH=src python benchmarks/reconstruction.py [--small] [FOLDER]

With FOLDER it keeps there, for each scene at 4 rays, the picture and |difference| to the reference times 10.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from _bench import MESHES, SMALL, header
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.render_graph.schedule import outputs_of, schedule
from illumcli.scene.load import load

SIZE = (64, 36) if SMALL else (1280, 720)
RAYS = (1, 4) if SMALL else (1, 2, 4, 8, 16, 64)
REFERENCE = 64 if SMALL else 1024
BLADES = 50 if SMALL else 1500


def blades(path: Path, count: int = BLADES, seed: int = 1) -> None:
    """Thin leaning blades of grass, as one mesh."""
    random = np.random.default_rng(seed)
    vertices, faces = [], []
    for _ in range(count):
        x, z = random.uniform(-1, 1, 2)
        turn, height = random.uniform(0, 2 * np.pi), random.uniform(0.3, 0.8)
        width, lean = random.uniform(0.008, 0.02), random.uniform(0, 0.3)
        across = np.array([np.cos(turn), 0, np.sin(turn)]) * width
        up = np.array([-np.sin(turn) * lean, 1, np.cos(turn) * lean]) * height
        foot, k = np.array([x, 0, z]), len(vertices) + 1
        vertices += [foot - across, foot + across, foot + 0.6 * (up + across), foot + 0.6 * (up - across)]
        vertices.append(foot + up)
        faces += [(k, k + 1, k + 2, k + 3), (k + 3, k + 2, k + 4)]
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    path.write_text("\n".join(lines) + "\n")


def scenes(folder: Path) -> dict[str, Path]:
    """A scene of each mesh that is at hand."""
    blades(folder / "blades.obj")
    meshes = {"blades": "blades.obj", "teapot": "{shape: teapot}"}
    for name in () if SMALL else ("stanford-bunny.obj", "suzanne.obj", "igea.ply", "spot.obj"):
        if (MESHES / name).exists():
            (folder / name).write_bytes((MESHES / name).read_bytes())
            meshes[name.partition(".")[0]] = name
    paths = {}
    for name, mesh in meshes.items():
        height, fit = (0.3, "") if name == "blades" else (0.55, ", transform: {fit: 1}")
        paths[name] = folder / f"{name}.yaml"
        paths[name].write_text(f"""\
version: 1
camera: {{position: [2.2, 1.6, 3.4], target: [0, {height}, 0], fov: 30}}
film: {{width: {SIZE[0]}, height: {SIZE[1]}, samples: 1}}
ambient: 1
obscurance: {{}}
objects:
  - {{mesh: {mesh}{fit}}}
  - {{mesh: {{shape: disc, radius: 20}}}}
""")
    return paths


def obscurance(path: Path, *overrides: str) -> tuple[NDArray[np.float32], NDArray[np.bool_], float, float]:
    """w, where a surface is seen, seconds of the wall's clock, and those of the reconstruction itself."""
    loaded = load(path, overrides)
    graph = build(loaded.scene, loaded)
    plan = schedule(graph, outputs_of(loaded.scene, ["obscurance", "alpha"]), graph.views[0])
    run = Run(threads=2)
    shared, start = run_once(plan, run), time.perf_counter()
    made = list(bands(plan, shared, run))
    seconds = time.perf_counter() - start
    w, alpha = (
        np.concatenate([band.layers[name] for band in made])[..., 0] for name in ("obscurance", "alpha")
    )
    return w, alpha > 0, seconds, run.stats.seconds["fitted_obscurance"]


def rmse(w: NDArray[np.float32], first: NDArray[np.float32], second: NDArray[np.float32]) -> float:
    """Root mean square error of w, by two references that err independently."""
    exact = w.astype(np.float64)
    return math.sqrt(max(float(np.mean((exact - first) * (exact - second))), 0))


def heat(folder: Path, name: str, w: NDArray[np.float32], truth: NDArray[np.float32]) -> None:
    """Keep a picture of w and of its error."""
    from illumcli.images.writer import ImageWriter

    for what, values in (("w", w), ("error", 10 * np.abs(w - truth))):
        height, width = values.shape
        with ImageWriter(folder / f"{name}-{what}.png", width, height, {"Y": "uint8"}, {}) as writer:
            writer.write_band(0, np.round(255 * np.clip(values, 0, 1)).astype(np.uint8)[..., None])
            writer.close()


def main() -> None:
    header(
        "How large is the error of obscurance, raw and reconstructed, at each number of rays?",
        size=SIZE,
        reference=REFERENCE,
    )
    pictures = [Path(word) for word in sys.argv[1:] if not word.startswith("-")]
    titles = f"{'raw':>9s} {'after':>9s} {'99.9 %':>8s} {'bias':>9s} {'wall':>12s} {'fit':>6s}"
    print(f"{'scene':>16s} {'rays':>5s} {titles}")
    with tempfile.TemporaryDirectory() as place:
        for name, path in scenes(Path(place)).items():
            sampling = f"obscurance={{samples: {REFERENCE}, sampler: owen}}"
            (first, seen, *_), (second, *_) = (obscurance(path, sampling, f"seed={seed}") for seed in (7, 8))
            truth = (first + second) / 2
            for rays in RAYS:
                raw, _, before, _ = obscurance(path, f"obscurance.samples={rays}")
                w, _, seconds, fit = obscurance(path, f"obscurance={{samples: {rays}, reconstruct: true}}")
                errors = [rmse(each[seen], first[seen], second[seen]) for each in (raw, w)]
                worst = float(np.quantile(np.abs(w - truth)[seen], 0.999))
                bias = float(np.mean((w - truth)[seen]))
                print(
                    f"{name:>16s} {rays:5d} {errors[0]:9.5f} {errors[1]:9.5f} {worst:8.4f} {bias:9.6f} "
                    f"{before:5.2f} {seconds:6.2f} {fit:6.2f}",
                    flush=True,
                )
                if pictures and rays == 4:
                    heat(pictures[0], name, w, truth)


if __name__ == "__main__":
    main()

"""What does adaptive antialiasing save, and how far is it from full sampling?

`python benchmarks/adaptive.py [--small] [FOLDER]`: a mesh over a floor, lit by two shadowed lights, the same
with obscurance, and thin blades; by one thread. RMSE of the linear beauty against 256 samples of another
seed, and the difference to full sampling of the same count. With a folder the pictures of 16 samples,
adaptive ones, their difference and the pixels that are the same are left there as PNG.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import _bench
from _bench import planned
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.scene.load import load

SIZE = ("film.width=64", "film.height=36") if _bench.SMALL else ("film.width=640", "film.height=360")
REFERENCE = 32 if _bench.SMALL else 256
REPEATS = 1 if _bench.SMALL else 3
OBSCURANCE = ("ambient=0.4", "obscurance={samples: 4}")
COUNTS = (4, 16)
RUNS = {
    f"{count} samples{kind}": (f"film.samples={count}", f"film.adaptive={adaptive}")
    for count in COUNTS
    for kind, adaptive in (("", "false"), (", adaptive", "true"))
}
BLADES = """\
version: 1
camera: {position: [2.2, 1.4, 2.8], target: [0, 0.35, 0], fov: 34}
ambient: 0.2
objects:
  - {mesh: blades.obj, material: {model: phong, diffuse: [0.2, 0.6, 0.1], specular: 0.3, exponent: 40}}
  - {mesh: {shape: disc, radius: 1.6}, material: {model: lambert, diffuse: [0.6, 0.5, 0.4]}}
lights:
  - {light: point, name: key, position: [3, 4, 2], intensity: [28, 26, 24]}
"""


def blades(folder: Path, count: int = 1500) -> Path:
    """1,500 blades of grass, up to a few pixels wide, in one mesh."""
    random = np.random.default_rng(3)
    lines: list[str] = []
    for k in range(count):
        distance, angle, turn = 1.2 * math.sqrt(random.random()), *(2 * math.pi * random.random(2))
        x, z = distance * math.cos(angle), distance * math.sin(angle)
        height, width = 0.4 + 0.5 * random.random(), 0.004 + 0.012 * random.random()
        along = width * np.array([math.cos(turn), 0, math.sin(turn)])
        lean = 0.4 * (random.random(2) - 0.5)
        middle = np.array([x + 0.4 * lean[0], 0.6 * height, z + 0.4 * lean[1]])
        foot, tip = np.array([x, 0, z]), np.array([x + lean[0], height, z + lean[1]])
        places = (foot - along, foot + along, middle + 0.6 * along, middle - 0.6 * along, tip)
        lines += ["v {:.6f} {:.6f} {:.6f}\n".format(*place) for place in places]
        first = 5 * k + 1
        lines += [
            f"f {first} {first + 1} {first + 2} {first + 3}\n",
            f"f {first + 3} {first + 2} {first + 4}\n",
        ]
    (folder / "blades.obj").write_text("".join(lines))
    path = folder / "blades.yaml"
    path.write_text(BLADES)
    return path


class Picture:
    """A scene rendered at some sampling, meshes and tree made beforehand."""

    def __init__(self, scene: Path, *overrides: str) -> None:
        loaded = load(scene, (*SIZE, *overrides))
        self.steps = planned(loaded, ["beauty"])
        self.shared = run_once(self.steps, Run())

    def __call__(self) -> None:
        self.stats = RenderStats()
        made = list(bands(self.steps, self.shared, Run(self.stats, threads=1)))
        self.beauty = np.concatenate([band.layers["beauty"] for band in made])

    @property
    def rays(self) -> int:
        """All of them."""
        return sum(self.stats.rays.values())


def compared(what: str, scene: Path, *overrides: str) -> dict[str, Picture]:
    """Print a row per sampling."""
    reference = Picture(scene, *overrides, f"film.samples={REFERENCE}", "film.adaptive=false", "seed=99")
    reference()
    runs = {name: Picture(scene, *overrides, *own) for name, own in RUNS.items()}
    times = _bench.interleaved(runs, REPEATS)
    print(f"\n{what}: {SIZE[0]}, {SIZE[1]}, reference {REFERENCE} samples")
    head = ("RMSE", "to full: RMSE", "99.9 %", "largest", "rays", "refined", "cpu [s]", "cpu / full")
    print(f"{'':22s}" + "".join(f"{each:>16s}" for each in head[:6]) + "".join(f"{e:>26s}" for e in head[6:]))
    for name, run in runs.items():
        full = name.removesuffix(", adaptive")
        apart = np.abs(run.beauty - runs[full].beauty, dtype=np.float64).max(axis=2)
        cpu = [took.cpu for took in times[name]]
        ratio = [a / b.cpu for a, b in zip(cpu, times[full], strict=True)]
        cells = [f"{rmse(run.beauty - reference.beauty):.5f}", f"{rmse(run.beauty - runs[full].beauty):.5f}"]
        cells += [f"{np.quantile(apart, 0.999):.4f}", f"{apart.max():.3f}", f"{run.rays:,}"]
        cells += [f"{run.stats.refined / apart.size:.1%}" if full != name else ""]
        print(f"{name:22s}" + "".join(f"{cell:>16s}" for cell in cells), end="")
        print("".join(f"{_bench.spread(each):>26s}" for each in (cpu, ratio)))
    return runs


def rmse(difference: NDArray[np.float32]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.square(difference, dtype=np.float64).mean()))


def left(folder: Path, what: str, runs: dict[str, Picture]) -> None:
    """Write pictures to look at."""
    from illumcli.film.encode import picture
    from illumcli.images.writer import ImageWriter

    full, adaptive = (runs[f"16 samples{kind}"].beauty for kind in ("", ", adaptive"))
    apart = np.abs(adaptive - full).max(axis=2, keepdims=True)
    same = np.repeat(apart == 0, 3, axis=2).astype(np.float32)
    pictures = {"full": full, "adaptive": adaptive, "difference-x10": np.repeat(10 * apart, 3, axis=2)}
    for name, values in {**pictures, "same": same}.items():
        height, width, _ = values.shape
        path = folder / f"{what}-{name}.png"
        with ImageWriter(path, width, height, dict.fromkeys("RGB", "uint8"), {}) as file:
            file.write_band(0, picture(values))
            file.close()


def main() -> None:
    words = [word for word in sys.argv[1:] if word != "--small"]
    _bench.header("What does adaptive antialiasing save, and how far is it from full sampling?", seed=0)
    with tempfile.TemporaryDirectory() as folder:
        scene, thin = _bench.lit_scene(Path(folder), 640, 360), blades(Path(folder))
        cases = {"lights": (scene, ()), "lights and obscurance": (scene, OBSCURANCE), "blades": (thin, ())}
        for what, (path, overrides) in cases.items():
            runs = compared(what, path, *overrides)
            if words:
                left(Path(words[0]), what.replace(" ", "-"), runs)


if __name__ == "__main__":
    main()

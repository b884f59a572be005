"""What does adaptive antialiasing save, and what does it cost in error?

`python benchmarks/adaptive.py [--small] [FOLDER]`: a mesh over a floor, lit by two shadowed lights, and the
same with obscurance; RMSE of the linear beauty against 256 samples of another seed, by one thread. With a
folder the pictures of 16 samples, 4 to 16, and the pixels that got all of them are left there as PNG.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import _bench
from _bench import planned
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.scene.load import load

SIZE = ("film.width=64", "film.height=36") if _bench.SMALL else ("film.width=480", "film.height=270")
REFERENCE = 32 if _bench.SMALL else 256
REPEATS = 1 if _bench.SMALL else 3
OBSCURANCE = ("ambient=0.4", "obscurance={samples: 4}")
RUNS = {
    "4 samples": ("film.samples=4",),
    "16 samples": ("film.samples=16",),
    "4 to 16, difference 0.05": ("film.samples=16", "film.adaptive={first: 4, difference: 0.05}"),
    "4 to 16, difference 0.1": ("film.samples=16", "film.adaptive=4"),
    "4 to 16, difference 0.2": ("film.samples=16", "film.adaptive={first: 4, difference: 0.2}"),
    "4 to 64, difference 0.1": ("film.samples=64", "film.adaptive=4"),
}


class Picture:
    """A scene rendered at some sampling, meshes and tree made beforehand."""

    def __init__(self, scene: Path, *overrides: str) -> None:
        loaded = load(scene, (*SIZE, *overrides))
        self.steps = planned(loaded, ["beauty"])
        self.shared = run_once(self.steps, Run())

    def __call__(self) -> None:
        self.tally = RenderStats()
        made = list(bands(self.steps, self.shared, Run(self.tally, threads=1)))
        self.beauty = np.concatenate([band.layers["beauty"] for band in made])

    @property
    def rays(self) -> int:
        """All of them."""
        return sum(self.tally.rays.values())


def compared(what: str, scene: Path, *overrides: str) -> dict[str, Picture]:
    """Print a row per sampling."""
    reference = Picture(scene, *overrides, f"film.samples={REFERENCE}", "seed=99")
    reference()
    runs = {name: Picture(scene, *overrides, *own) for name, own in RUNS.items()}
    times = _bench.interleaved(runs, REPEATS)
    print(f"\n{what}: {SIZE[0]}, {SIZE[1]}, reference {REFERENCE} samples")
    head = ("RMSE", "rays", "cpu [s]", "cpu / 16", "refined", "samples saved")
    print(f"{'':26s}" + "".join(f"{each:>26s}" for each in head))
    pixels = reference.beauty.shape[0] * reference.beauty.shape[1]
    for name, run in runs.items():
        rmse = np.sqrt(np.square(run.beauty - reference.beauty, dtype=np.float64).mean())
        cpu = [took.cpu for took in times[name]]
        ratio = [a / b.cpu for a, b in zip(cpu, times["16 samples"], strict=True)]
        cells = [f"{rmse:.5f}", f"{run.rays:,}", _bench.spread(cpu), _bench.spread(ratio)]
        cells += [f"{run.tally.refined / pixels:.1%}", f"{run.tally.saved['samples']:,}"]
        print(f"{name:26s}" + "".join(f"{cell:>26s}" for cell in cells))
    return runs


def left(folder: Path, what: str, runs: dict[str, Picture]) -> None:
    """Write pictures to look at."""
    from illumcli.film.encode import picture
    from illumcli.images.writer import ImageWriter

    full, adaptive, few = (
        runs[name].beauty for name in ("16 samples", "4 to 16, difference 0.1", "4 samples")
    )
    refined = np.repeat((adaptive != few).any(axis=2, keepdims=True), 3, axis=2).astype(np.float32)
    for name, values in (("16", full), ("4-to-16", adaptive), ("refined", refined)):
        height, width, _ = values.shape
        with ImageWriter(
            folder / f"{what}-{name}.png", width, height, dict.fromkeys("RGB", "uint8"), {}
        ) as file:
            file.write_band(0, picture(values))
            file.close()


def main() -> None:
    words = [word for word in sys.argv[1:] if word != "--small"]
    _bench.header("What does adaptive antialiasing save, and what does it cost in error?", seed=0)
    with tempfile.TemporaryDirectory() as folder:
        scene = _bench.lit_scene(Path(folder), 480, 270)
        for what, overrides in (("lights", ()), ("lights and obscurance", OBSCURANCE)):
            runs = compared(what, scene, *overrides)
            if words:
                left(Path(words[0]), what.replace(" ", "-"), runs)


if __name__ == "__main__":
    main()

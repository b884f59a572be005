"""What do copies of one mesh cost?

1, 100, 1,000 and 10,000 copies of the bunny on a floor, of several sizes, obscurance of 16 rays and one light
with shadows, one thread. The copies always fill the same field of the picture. Whole processes, nothing kept,
the counts interleaved: processor seconds, peak memory, and both relative to one copy.

    PYTHONPATH=src python benchmarks/instances.py [--small]
"""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from random import Random

from _bench import REPEATS, SMALL, bunny, header, illum, spread, took

COUNTS = [1, 20] if SMALL else [1, 100, 1000, 10_000]
SIZE = (48, 27) if SMALL else (1280, 720)


def crowd(folder: Path, count: int) -> Path:
    """So many bunnies on a square of 2 x 2."""
    random = Random(count)
    side = math.ceil(math.sqrt(count))
    path = folder / f"crowd{count}.yaml"
    mesh = bunny(folder)
    body = mesh if mesh.startswith("{") else f"{{file: {mesh}}}"
    rows = []
    for i in range(count):
        x, z = ((place + 0.5) / side * 2 - 1 for place in divmod(i, side))
        place = f"fit: {random.uniform(0.8, 1) / side:.5f}, translate: [{x:.4f}, 0, {z:.4f}]"
        rows.append(f"- {{mesh: body, transform: {{{place}}}}}")
    path.write_text(
        "\n".join(
            [
                "version: 1",
                "camera: {position: [0, 2.6, 2.6], target: [0, 0.1, 0.1], fov: 24}",
                f"film: {{width: {SIZE[0]}, height: {SIZE[1]}, samples: 1}}",
                "ambient: 0.5",
                "obscurance: {samples: 16}",
                f"meshes: {{body: {body}}}",
                "lights: [{light: point, position: [3, 4, 4], intensity: 60}]",
                "objects:",
                "- {mesh: {shape: plane}, transform: {scale: 3}}",
                *rows,
                "",
            ]
        )
    )
    return path


def main() -> None:
    header("What do copies of one mesh cost?", size="x".join(map(str, SIZE)))
    seconds: dict[int, list[float]] = {count: [] for count in COUNTS}
    peaks: dict[int, float] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes = {count: crowd(folder, count) for count in COUNTS}
        words = ("-t", 1, "-o", "crowd.exr", "--force", "-q", "--no-cache", "--report", "r.json")
        for _ in range(REPEATS):
            for count, scene in scenes.items():
                own = took(lambda scene=scene: illum("render", scene, *words, cwd=folder))
                seconds[count].append(own.cpu)
                peaks[count] = json.loads((folder / "r.json").read_text())["peak_memory_bytes"] / 2**20
    print(f"{'copies':>7s} {'cpu [s]':>22s} {'peak [MiB]':>11s} {'time / one':>22s} {'memory / one':>13s}")
    first = COUNTS[0]
    for count in COUNTS:
        ratios = [a / b for a, b in zip(seconds[count], seconds[first], strict=True)]
        print(
            f"{count:7d} {spread(seconds[count]):>22s} {peaks[count]:11.0f} "
            f"{spread(ratios):>22s} {peaks[count] / peaks[first]:13.2f}"
        )


if __name__ == "__main__":
    main()

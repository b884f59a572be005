"""How much memory does a large picture take, and is its time linear in pixels?

One mesh over a floor under two lights, beauty to EXR, at doubling sides up to 4096x4096, and 16384x16384 with
`--full`. Peak of the process that renders; seconds by the wall and of all processors. One sample per pixel,
nothing kept.

    PYTHONPATH=src python benchmarks/memory.py [--small | --full]
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from _bench import SMALL, header, illum, lit_scene, took


def main(sides: list[int]) -> None:
    header("How much memory does a large picture take?", runs_of_each=1)
    print(f"{'side':>8s} {'peak [MiB]':>11s} {'wall [s]':>9s} {'cpu [s]':>9s} {'cpu per pixel [ns]':>19s}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for side in sides:
            scene = lit_scene(folder, side, side)
            words = ("-o", "large.exr", "--force", "-q", "--no-cache", "--report", "r.json")
            own = took(lambda scene=scene, words=words: illum("render", scene, *words, cwd=folder))
            peak = json.loads((folder / "r.json").read_text())["peak_memory_bytes"]
            each = own.cpu / side**2 * 1e9
            print(f"{side:8d} {peak / 2**20:11.0f} {own.wall:9.2f} {own.cpu:9.2f} {each:19.0f}", flush=True)


if __name__ == "__main__":
    main([32, 64] if SMALL else [1024, 2048, 4096, *([16384] if "--full" in sys.argv else [])])

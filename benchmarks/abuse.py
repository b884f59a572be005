"""Does damage to the cache change a byte of a picture?

`python benchmarks/abuse.py [FLIPS] [TRUNCATIONS] [PROCESSES] [RUNS]`: random entries are damaged one at a
time and the scene rendered again; then processes render it on one cache at once. Prints how many pictures
differed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SCENE = """
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.2
obscurance: {samples: 4}
materials: {clay: {model: blinn_phong, diffuse: [0.6, 0.4, 0.3]}}
objects: [{mesh: {shape: box}, material: clay}, {mesh: {shape: plane, size: [8, 8]}}]
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
"""
WORKER = """
import sys
from pathlib import Path
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
for k in range(int(sys.argv[2])):
    change, name = f"materials.clay.exponent={4 + k % 5}", f"{sys.argv[1]}-{k % 5}.png"
    _, report = render_scene(RenderJob(Path("scene.yaml"), RenderOptions([change], name, force=True)))
    assert not report.warnings, report.warnings
"""


def main() -> None:
    said = [*sys.argv[1:], *["1000", "100", "8", "50"][len(sys.argv) - 1 :]]
    flips, truncations, processes, runs = map(int, said)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        os.environ["ILLUM_CACHE"] = f"{folder}/kept"
        Path("scene.yaml").write_text(SCENE)
        print(f"{damaged(flips, truncations)} of {flips + truncations} pictures differ after damage")
        print(f"{shared(processes, runs)} pictures differ or runs failed of {processes} x {runs} at once")


def damaged(flips: int, truncations: int) -> int:
    """Pictures that differ after an entry was damaged."""
    from illumcli.cache import policy as artifacts
    from illumcli.cache.location import open_store
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene

    artifacts.worth = lambda seconds, size: True
    (path,), _ = render_scene(
        RenderJob(Path("scene.yaml"), RenderOptions((), "a.png", force=True, cache=False))
    )
    good, random, wrong, seen = path.read_bytes(), np.random.default_rng(0), 0, 0
    render_scene(RenderJob(Path("scene.yaml"), RenderOptions((), "a.png", force=True)))
    for number in range(flips + truncations):
        entries = [entry for entry in open_store().entries() if entry.bytes]  # cut to nothing, not needed
        entry = entries[int(random.integers(len(entries)))].path
        data = bytearray(entry.read_bytes())
        place = int(random.integers(len(data)))
        if number < flips:
            data[place] ^= 1 << int(random.integers(8))
        entry.write_bytes(data if number < flips else data[:place])
        _, report = render_scene(RenderJob(Path("scene.yaml"), RenderOptions((), "a.png", force=True)))
        seen += bool(report.warnings)
        wrong += path.read_bytes() != good
    print(f"{seen} damaged entries were read and found out, the others were not needed")
    return wrong


def shared(processes: int, runs: int) -> int:
    """Runs that failed and pictures that differ between processes."""
    from illumcli.cache.location import open_store

    open_store().prune(0)
    workers = [subprocess.Popen([sys.executable, "-c", WORKER, str(n), str(runs)]) for n in range(processes)]
    failed = sum(worker.wait() != 0 for worker in workers)
    for k in range(min(5, runs)):
        failed += len({Path(f"{n}-{k}.png").read_bytes() for n in range(processes)}) - 1
    return failed


if __name__ == "__main__":
    main()

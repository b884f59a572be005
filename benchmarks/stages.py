"""Where does the time of a render go, stage by stage?

A render bound by obscurance, 1280x720 at 64 rays per pixel, one bound by shading, and a tiny one of 64x64,
each a process of its own. Reference: the whole process. Stage seconds are of all threads together, so a share
is of the stages' sum. Meshes are kept from the first run on; seeds 1, 2, ...: no kept hit is met again.

    PYTHONPATH=src python benchmarks/stages.py [--small]
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from statistics import median

from _bench import REPEATS, SMALL, ambient_scene, header, illum, lit_scene


def profile(scene: Path, *words: str) -> tuple[list[float], list[dict[str, object]]]:
    """Seconds and reports of as many whole processes as there are repeats."""
    walls, reports = [], []
    illum("render", scene, *words, "--force", "-q", cwd=scene.parent)
    for seed in range(1, REPEATS + 1):
        start = time.perf_counter()
        illum(
            "render",
            scene,
            *words,
            *f"--force -q --report report.json --seed {seed}".split(),
            cwd=scene.parent,
        )
        walls.append(time.perf_counter() - start)
        reports.append(json.loads((scene.parent / "report.json").read_text()))
    return walls, reports


def show(title: str, walls: list[float], reports: list[dict]) -> None:
    """Rows of one render, the costliest stage first."""
    stages, rays = defaultdict(list), defaultdict(int)
    for report in reports:
        for name, seconds in report["seconds"].items():
            stages[name].append(seconds)
        rays |= report["rays"]
    total = sum(median(own) for own in stages.values())
    job = median(report["total_seconds"] for report in reports)
    print(f"\n{title}: process {median(walls):.3f} s, job {job:.3f} s, stages {total:.3f} s of all threads")
    print(f"{'stage':22s} {'share':>7s} {'seconds':>9s} {'rays':>12s} {'ns per ray':>11s}")
    for name, own in sorted(stages.items(), key=lambda item: -median(item[1])):
        seconds, count = median(own), rays.get(name, 0)
        each = f"{seconds / count * 1e9:11.0f}" if count else ""
        print(f"{name:22s} {seconds / total:7.1%} {seconds:9.4f} {count or '':>12} {each}")
    beside = median(wall - report["total_seconds"] for wall, report in zip(walls, reports, strict=True))
    print(f"{'beside the job':22s} {'':7s} {beside:9.4f}  interpreter, imports, exit")


def main() -> None:
    header("Where does the time of a render go, stage by stage?")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        large, rays = ((48, 27), 4) if SMALL else ((1280, 720), 64)
        for title, scene, words in (
            ("obscurance", ambient_scene(folder, *large, rays), ("--only", "obscurance")),
            ("beauty under two lights", lit_scene(folder, *large), ()),
            ("tiny", lit_scene(folder, 64, 64), ()),
        ):
            show(f"{title}, {scene.stem}", *profile(scene, *words))


if __name__ == "__main__":
    main()

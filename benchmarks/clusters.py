"""What does a sweep by two local workers of one thread take, against one process of two threads?

`python benchmarks/clusters.py [--variants N] [--small]`: whole commands, each with an empty cache, the start
of the cluster included. That the pictures are the same bytes is checked, too.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from _bench import REPEATS, ROOT, SMALL, header, illum, interleaved, ratio, table

SIZES = ((64, 36),) if SMALL else ((192, 108), (640, 360))
WAYS = {"one process": ("-t", "2"), "two workers": ("--cluster", "local:2")}


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--variants", type=int, default=8 if SMALL else 200)
    options.add_argument("--small", action="store_true", help="see that it runs")
    options.add_argument("--repeats", type=int, default=REPEATS)
    said = options.parse_args()
    question = "what does a sweep by two local workers of one thread take, against a process of two threads?"
    header(question, variants=said.variants, repeats=said.repeats)
    with tempfile.TemporaryDirectory() as folder:
        for width, height in SIZES:
            film = f"film={{width: {width}, height: {height}, samples: 4}}"
            words = ["-D", film, "-D", f"materials.glaze.exponent=4:256:{said.variants}log"]
            runs = {name: swept(Path(folder, name), [*words, *way]) for name, way in WAYS.items()}
            print(f"\n{width} x {height}")
            times = interleaved(runs, said.repeats)
            table(times, "one process")
            ratio("two workers / one process", times, "two workers", "one process")
            a, b = (sorted(Path(folder, name).glob("*.png")) for name in WAYS)
            same = [x.read_bytes() == y.read_bytes() for x, y in zip(a, b, strict=True)]
            print(f"same bytes: {sum(same)} of {said.variants}")


def swept(folder: Path, words: list[str]) -> Callable[[], object]:
    """Runs the sweep into an empty folder."""

    def run() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        scene = ROOT / "scenes" / "teapot.yaml"
        illum("sweep", scene, *words, "-o", "{materials.glaze.exponent}.png", "-q", cwd=folder)

    return run


if __name__ == "__main__":
    main()

"""How long does `illum` take to start, beside what it cannot start without?

References: `python -c "import click"` for `--help`; importing the six libraries a render needs for a tiny
render, 64x64 with its meshes kept. Whole processes, compiled modules at hand, interleaved.

    PYTHONPATH=src python benchmarks/startup.py [--small]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from _bench import REPEATS, SMALL, header, illum, interleaved, lit_scene, process, ratio, table

LIBRARIES = "import click, numpy, pydantic, yaml, embreex, OpenImageIO"


def main() -> None:
    header("How long does illum take to start, beside what it cannot start without?")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tiny = lit_scene(folder, 64, 64)
        runs = {
            "python -c pass": lambda: process([sys.executable, "-c", "pass"], folder),
            "import click": lambda: process([sys.executable, "-c", "import click"], folder),
            "illum --help": lambda: illum("--help", cwd=folder),
            "import six libraries": lambda: process([sys.executable, "-c", LIBRARIES], folder),
            "illum plan": lambda: illum("plan", tiny, cwd=folder),
            "illum render 64x64": lambda: illum("render", tiny, "--force", "-q", cwd=folder),
        }
        for run in runs.values():
            run()  # compiles modules, keeps meshes
        times = interleaved(runs, 1 if SMALL else 3 * REPEATS)
        table(times)
        ratio("--help / import click", times, "illum --help", "import click")
        ratio("tiny render / six libraries", times, "illum render 64x64", "import six libraries")


if __name__ == "__main__":
    main()

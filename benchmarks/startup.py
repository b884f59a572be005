"""How long does `illum` take to start, relative to the imports that it needs?

References: `python -c "import click"` for `--help`. For a tiny render, 64x64 with its meshes kept: to import
the six libraries that it needs. A bare import of pydantic leaves BaseModel out, and the first model that is
defined imports the rest, so there are three of these. Their processor time holds that of the threads which
numpy's linear algebra starts; `illum` lets it start none, as does the last of them. Whole processes, with
compiled modules, interleaved.

    PYTHONPATH=src python benchmarks/startup.py [--small]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from _bench import REPEATS, SMALL, header, illum, interleaved, lit_scene, process, ratio, table

BARE = "import click, numpy, pydantic, yaml, embreex, OpenImageIO"
LIBRARIES = f"{BARE}\nfrom pydantic import BaseModel"
ONE_MODEL = f"{LIBRARIES}, Field\nclass Model(BaseModel):\n    width: int = Field(gt=0)"


def main() -> None:
    header("How long does illum take to start, beside what it cannot start without?")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tiny = lit_scene(folder, 64, 64)
        runs = {
            "python -c pass": lambda: process([sys.executable, "-c", "pass"], folder),
            "import click": lambda: process([sys.executable, "-c", "import click"], folder),
            "illum --help": lambda: illum("--help", cwd=folder),
            "import six libraries, bare": lambda: process([sys.executable, "-c", BARE], folder),
            "import six libraries": lambda: process([sys.executable, "-c", LIBRARIES], folder),
            "six libraries and a model": lambda: process([sys.executable, "-c", ONE_MODEL], folder),
            "six libraries, one thread": lambda: process(
                [sys.executable, "-c", LIBRARIES], folder, OPENBLAS_NUM_THREADS="1"
            ),
            "illum plan": lambda: illum("plan", tiny, cwd=folder),
            "illum render 64x64": lambda: illum("render", tiny, "--force", "-q", cwd=folder),
        }
        for run in runs.values():
            run()  # compiles modules, keeps meshes
        times = interleaved(runs, 1 if SMALL else 3 * REPEATS)
        table(times)
        ratio("--help / import click", times, "illum --help", "import click")
        for reference in [name for name in runs if "six libraries" in name]:
            ratio(f"tiny render / {reference}", times, "illum render 64x64", reference)


if __name__ == "__main__":
    main()

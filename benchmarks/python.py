"""What does the interface in Python cost: its import, and a variant in a loop, beside the command line?

References: `python -c pass` for the import. For 200 variants of a material, 64 x 48 pixels: one sweep of the
command; and one `illum render` for every tenth of them, whose time is multiplied by ten. All write the same
PNGs but one loop, which keeps arrays. Whole processes, one thread, interleaved; all share one cache, which
holds meshes and hits after the first round.

    PYTHONPATH=src python benchmarks/python.py [--small]
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path

from _bench import REPEATS, SMALL, Took, header, illum, interleaved, lit_scene, process, ratio, table

VARIANTS, TENTH = (3, 1) if SMALL else (200, 10)
LOOP = """
import sys, illumcli
scene = illumcli.load(sys.argv[1])
for number in range(int(sys.argv[2])):
    rendering = scene.render({"materials.gloss.exponent": 10.0 + number}, threads=1)
"""
SAVED = LOOP + '    rendering.save(f"{sys.argv[3]}/{number:03d}.png", force=True)\n'


def renders(scene: Path, folder: Path) -> None:
    """A process for each tenth variant."""
    for number in range(0, VARIANTS, TENTH):
        words = ["-D", f"materials.gloss.exponent={10.0 + number}", "-o", f"r/{number:03d}.png"]
        illum("render", scene, *words, "--force", "-q", "-t", 1, cwd=folder)


def main() -> None:
    header("What does the interface in Python cost, beside the command line?", variants=VARIANTS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def python(code: str, *words: object) -> None:
            process([sys.executable, "-c", code, *map(str, words)], folder)

        # What is imported when.
        imports = {
            "python -c pass": partial(python, "pass"),
            "import illumcli": partial(python, "import illumcli"),
            "import numpy": partial(python, "import numpy"),
            "illumcli.render": partial(python, "import illumcli; illumcli.render"),
            "import click": partial(python, "import click"),
        }
        for run in imports.values():
            run()  # compiles modules
        times = interleaved(imports, 2 if SMALL else 3 * REPEATS)
        table(times, "python -c pass")
        ratio("import illumcli / python -c pass", times, "import illumcli", "python -c pass")

        # Many variants.
        scene = lit_scene(folder, 64, 48)
        values = f"materials.gloss.exponent=10:{9 + VARIANTS}:{VARIANTS}"
        sweep = ("sweep", scene, "-D", values, "-o", "s/{materials.gloss.exponent}.png")
        runs = {
            "loop, arrays": partial(python, LOOP, scene, VARIANTS),
            "loop, PNGs": partial(python, SAVED, scene, VARIANTS, "p"),
            "illum sweep": partial(illum, *sweep, "--force", "-q", "-t", 1, cwd=folder),
            "illum render, each": partial(renders, scene, folder),
        }
        times = interleaved(runs, 1 if SMALL else REPEATS)
        times["illum render, each"] = [
            Took(TENTH * each.wall, TENTH * each.cpu) for each in times["illum render, each"]
        ]
        table(times, "illum sweep")
        ratio("loop, PNGs / illum sweep", times, "loop, PNGs", "illum sweep")
        ratio("illum render, each / loop, PNGs", times, "illum render, each", "loop, PNGs")


if __name__ == "__main__":
    main()

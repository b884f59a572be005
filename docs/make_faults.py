"""Draws the pictures of baking-faults.md: the scenes of scenes/faults, baked with their fault and cured.

Run it after a change to those scenes or to bakes:

    python docs/make_faults.py [NAME...]
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from illumcli.images.contact_sheet import write_contact_sheet
from illumcli.images.reader import read_image
from illumcli.images.sheet_layout import Sheet
from illumcli.scene.load import load

ROOT = Path(__file__).parents[1]
PICTURES = Path(__file__).with_name("faults")
WIDTH, HEIGHT = 260, 190
"""Of each view [pixels]."""
TRACED = "as pictures have it"
"""Instead of options: w of every pixel, not baked."""
FAULTS: Mapping[str, Sequence[str]] = {
    "sheets": ("", "--faces ignore", "--occluders ground=post"),
    "poles": ("--samples 8", "--target-error 0.005"),
    "seams": (".ply", ".ply --split"),
    "facets": ("", "-D 'meshes.post.normals={crease: 60}'"),
    "interiors": ("", "--falloff smooth --max-distance 0.3r"),
    "floating": ("--occluders own", "--ground y"),
    "shells": ("", "--occluders head=own"),
    "tight": ("", "--falloff smooth --max-distance 0.2r"),
    "large": ("", "--method fit --samples 2048", TRACED),
}
"""Scene -> the options of its bakes; they bake a GLB unless they begin with another suffix."""


def main() -> None:
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or FAULTS:
        draw(name, FAULTS[name])


def draw(name: str, bakes: Sequence[str]) -> None:
    """Write the picture of one fault: a view of each bake, with its options below."""
    views = []
    with TemporaryDirectory() as folder:
        for number, text in enumerate(bakes):
            views.append(view_of_bake(name, text, Path(folder) / f"{number}"))
    sheet = Sheet((tuple(range(len(views))),), tuple(text or "as it comes" for text in bakes))
    pictures = [lambda view=view: view for view in views]
    write_contact_sheet(PICTURES / f"{name}.png", sheet, pictures, [(HEIGHT, WIDTH)] * len(views), name)


def view_of_bake(name: str, text: str, stem: Path) -> np.ndarray:
    """(HEIGHT, WIDTH, 1) display values of w as a bake has it, from the scene's camera."""
    # Bake the scene, or leave it to the picture.
    scene = ROOT / "scenes" / "faults" / f"{name}.yaml"
    if text == TRACED:
        film = f"{{width: {WIDTH}, height: {HEIGHT}, samples: 16}}"
        layers = "-D ambient=1 -D 'obscurance={samples: 64}' --only obscurance"
        run(f"render '{scene}' {layers} -D 'film={film}' -o '{stem}.png' --no-cache")
        return plain_values(stem)
    suffix, options = text.split(" ")[0] if text.startswith(".") else "", text
    if suffix:
        options = text.removeprefix(suffix)
    baked = stem.with_suffix(suffix or ".glb")
    run(f"ao-bake '{scene}' -o '{baked}' {options}")

    # Show the file.
    shown: dict[str, Any] = {
        "version": 1,
        "camera": dict(load(scene).scene.camera),
        "film": {"width": WIDTH, "height": HEIGHT, "samples": 16},
        "ambient": 1,
        "objects": [{"mesh": {"file": baked.name, "obscurance": baked.name}}],
        "outputs": {"layers": ["obscurance"]},
    }
    stem.with_suffix(".yaml").write_text(json.dumps(shown))
    run(f"render '{stem}.yaml' -o '{stem}.png' --no-cache")
    return plain_values(stem)


def plain_values(stem: Path) -> np.ndarray:
    """(HEIGHT, WIDTH, 1) the picture of a layer."""
    return np.rint(255 * read_image(f"{stem}.png").channels["Y"][..., None]).astype(np.uint8)


def run(words: str) -> None:
    """Run a command of illum."""
    subprocess.run(["bash", "-ec", f"'{sys.executable}' -m illumcli {words} -q"], check=True)


if __name__ == "__main__":
    main()

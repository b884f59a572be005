"""baking-faults.md: every scene has its section and picture, and the cures change what they should."""

from __future__ import annotations

import re
import shlex

import numpy as np
import pytest
from click.testing import CliRunner

from illumcli.cli import illum
from illumcli.visibility.baked import read_npz

LIGHTER = {
    "sheets": ("ground", "", "--occluders ground=post"),
    "shells": ("head", "", "--occluders head=own"),
    "interiors": ("floor", "", "--falloff smooth --max-distance 0.3r"),
    "tight": ("ground", "", "--falloff smooth --max-distance 0.2r"),
    "floating": ("ring", "--ground y", "--occluders own"),
}
"""Scene -> object, and options with which it is darker and lighter."""


def test_every_scene_has_its_section_and_picture(root):
    page = (root / "docs" / "baking-faults.md").read_text()
    scenes = {path.stem for path in (root / "scenes" / "faults").glob("*.yaml")}
    assert set(re.findall(r"\(faults/(\w+)\.png\)", page)) == scenes
    assert set(re.findall(r"scenes/faults/(\w+)\.yaml", page)) == scenes
    pictures = list((root / "docs" / "faults").glob("*.png"))
    assert {path.stem for path in pictures} == scenes
    assert sum(path.stat().st_size for path in pictures) < 400_000

    # each link of the table leads to a heading
    headings = {
        line[3:].lower().replace(" ", "-").replace(",", "") for line in page.splitlines() if line[:3] == "## "
    }
    assert set(re.findall(r"\]\(#([\w-]+)\)", page)) == headings


@pytest.mark.parametrize("name", LIGHTER)
def test_cures_lighten_what_is_too_dark(root, tmp_path, name):
    thing, *options = LIGHTER[name]
    means = []
    for number, text in enumerate(options):
        out = tmp_path / f"{number}.npz"
        scene = root / "scenes" / "faults" / f"{name}.yaml"
        words = ["ao-bake", str(scene), "-o", str(out), "--samples", "16", "-q", *shlex.split(text)]
        assert CliRunner().invoke(illum, words).exit_code == 0
        baked = read_npz(out)
        sizes = baked.about["vertices"]
        first = sum(list(sizes.values())[: list(sizes).index(thing)])
        means.append(np.mean(baked.obscurance[first : first + sizes[thing]]))
    assert means[1] > means[0] + 0.02


def test_what_interpolates_shows_both_posts_alike(root, tmp_path):
    """`--method fit` on large polygons: the darkest vertex around each post."""
    darkest = {}
    for method in ("vertex", "fit"):
        out = tmp_path / f"{method}.npz"
        scene = root / "scenes" / "faults" / "large.yaml"
        words = ["ao-bake", str(scene), "-o", str(out), "--samples", "256", "-q", "--method", method]
        assert CliRunner().invoke(illum, words).exit_code == 0
        w = read_npz(out).obscurance[:81].reshape(9, 9)  # rows from z = 2, columns from x = -2
        darkest[method] = w[3:6, 2:5].min(), w[3:5, 5:7].min()
    left, right = darkest["vertex"]
    assert left < 0.2 < 0.8 < right
    left, right = darkest["fit"]
    assert abs(left - right) < 0.3

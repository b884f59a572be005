"""An output folder that vanishes while its files are written: exit code 5, and no other failure."""

from __future__ import annotations

import shutil

import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.commands import render
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep import sweep_scene
from illumcli.commands.sweep_files import SweepFiles
from illumcli.errors import OutputError
from illumcli.scene.variants import variants_of

SMALL = ["film.width=24", "film.height=16"]


@pytest.mark.parametrize("name", ["a.exr", "a.png", "{layer}.png"])
def test_of_a_render(folder, name):
    def gone(what, done, of):
        shutil.rmtree(folder / "new", ignore_errors=True)

    options = RenderOptions(SMALL, str(folder / "new" / name), ["beauty"], threads=1, cache=False)
    with pytest.raises(OutputError, match=r"cannot be written: No such file"):
        render.render_scene(RenderJob(folder / "scene.yaml", options), gone)


@pytest.mark.parametrize("name", ["a.npz", "a.ply", "a.glb"])
def test_of_a_bake_it_is_made_again(folder, name):
    def gone(what, done, of):
        shutil.rmtree(folder / "new", ignore_errors=True)

    settings, options = BakeSettings(samples=8), BakeOptions(threads=1)
    bake_mesh(folder / "thing.obj", [folder / "new" / name], settings, options, gone)
    assert [path.name for path in (folder / "new").iterdir()] == [name]


@pytest.mark.parametrize("what", ["sheet", "table"])
def test_of_a_sweep(folder, what):
    def gone(outcome):
        shutil.rmtree(folder / "new", ignore_errors=True)

    files = SweepFiles(**{what: folder / f"all.{'png' if what == 'sheet' else 'csv'}"})
    settings = RenderOptions(pattern=str(folder / "new" / "{ambient}.png"), cache=False, only=("beauty",))
    variants = variants_of(["ambient=0.1,0.2", *SMALL])
    with pytest.raises(OutputError, match="has been removed since"):
        sweep_scene(folder / "scene.yaml", variants, settings, files, written=gone)

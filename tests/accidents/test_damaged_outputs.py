"""Outputs that were damaged or changed after they were written are never kept as equal."""

from __future__ import annotations

import random

import pytest

from illumcli.accuracy.convergence import ConvergenceSettings, measure_convergence
from illumcli.accuracy.convergence_files import ConvergenceFiles
from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.commands import render, render_all
from illumcli.commands.options import RenderFiles, RenderJob, RenderOptions
from illumcli.commands.runner import Here
from illumcli.commands.sweep import sweep_scene
from illumcli.commands.sweep_files import SweepFiles
from illumcli.errors import OutputError
from illumcli.scene.variants import variants_of


def picture(folder, name):
    def make(force=False):
        changes = ("film.width=24", "film.height=16")
        options = RenderOptions(changes, str(folder / name), ("beauty",), threads=1, force=force, cache=False)
        _, report = render.render_scene(RenderJob(folder / "scene.yaml", options))
        return [str(path) for path in report.kept]

    return make


def bake(folder, name):
    def make(force=False):
        settings = BakeSettings(samples=8)
        return bake_mesh(folder / "thing.obj", [folder / name], settings, BakeOptions(force=force))[1].kept

    return make


def report(folder, name):
    def make(force=False):
        changes = ("film.width=24", "film.height=16")
        settings = RenderOptions(changes, str(folder / "o.exr"), cache=False, force=force)
        ignore = lambda *words: None  # noqa: E731
        kept = render_all.render_scenes(
            [folder / "scene.yaml"], settings, RenderFiles(folder / name), Here(), written=ignore, tell=ignore
        )
        return [*map(str, kept)]

    return make


def swept(folder, name):
    """The table or report of a sweep."""

    def make(force=False):
        pattern = str(folder / "o" / "{ambient}.png")
        settings = RenderOptions(pattern=pattern, only=("beauty",), cache=False, force=force, threads=1)
        files = SweepFiles(**{name.partition(".")[0]: folder / name})
        variants = variants_of(["ambient=0.1,0.2", "film.width=16", "film.height=12"])
        return list(map(str, sweep_scene(folder / "scene.yaml", variants, settings, files).kept))

    return make


def curves(folder, name):
    """The table or drawing of `converge`, of a small measurement."""
    if not name.endswith(".csv"):
        pytest.importorskip("matplotlib")
    settings = ConvergenceSettings(first=4, last=8, samplers=("spiral",), repeats=1, width=16)
    found = measure_convergence(folder / "scene.yaml", settings)
    contents = [run.content for curve in found.curves for point in curve.points for run in point.runs]

    def make(force=False):
        path = folder / name
        table, picture = (path, None) if path.suffix == ".csv" else (None, path)
        outputs = ConvergenceFiles(table, picture, force)
        outputs.look(contents)
        outputs.write(found)
        return list(map(str, outputs.kept))

    return make


OUTPUTS = {
    "a.exr": picture, "a.png": picture, "a.npz": bake, "a.ply": bake, "a.glb": bake, "a.json": report,
    "table.csv": swept, "report.json": swept, "c.csv": curves, "c.svg": curves, "c.png": curves,
}  # fmt: skip


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.parametrize("count", [10, pytest.param(300, marks=pytest.mark.slow)])
def test_a_damaged_output_is_refused_and_made_anew_by_force(folder, name, count):
    make, path = OUTPUTS[name](folder, name), folder / name
    make()
    assert make() == [str(path)]
    whole, draw = path.read_bytes(), random.Random(name)
    for number in range(count):
        at = draw.randrange(len(whole))
        data = bytearray(whole)
        data[at] ^= 1 << draw.randrange(8)
        damaged = bytes(data) if number % 2 else whole[:at]
        path.write_bytes(damaged)
        with pytest.raises(OutputError, match="changed or damaged since it was written; use --force"):
            make()
        assert path.read_bytes() == damaged
    make(force=True)
    # tables, reports and curves hold seconds
    assert path.suffix in (".csv", ".json", ".svg") or name == "c.png" or path.read_bytes() == whole
    assert make() == [str(path)]

"""The layer `error` of pictures with reconstructed obscurance: true in bins, the same however it is made."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.accuracy.audit import Audit, audited_layer
from illumcli.color import LUMINANCE
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.errors import LimitError
from illumcli.images.reader import read_image
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 160, height: 120, samples: 1}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 2, reconstruct: true}
meshes:
  ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}
  torus: {shape: torus, major: 0.4, minor: 0.15}
  box: {shape: box, size: [0.4, 0.8, 0.3]}
objects:
  - {mesh: {shape: plane, size: [6, 6]}}
  - {mesh: ball, transform: {translate: [0, 0.5, 0]}}
  - {mesh: torus, transform: {translate: [1, 0.3, 0.3]}}
  - {mesh: box, transform: {translate: [-0.9, 0.4, 0.2]}}
lights: [{light: directional, direction: [1, -2, -1]}]
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


def luminance(path, *overrides):
    """(H, W) luminance of the beauty over its background."""
    steps = planned(load(path, overrides), ["beauty"])
    layers = {name: values.astype(float) for name, values in layers_of(steps, Run(threads=2)).items()}
    background = np.asarray(steps.graph.scene.film.background or (0, 0, 0))
    return (layers["beauty"] + (1 - layers["alpha"]) * background) @ LUMINANCE


def errors(path, *overrides, threads=2, side=None):
    """(H, W) layer `error`, from tiles of a side."""
    steps = planned(load(path, overrides), ["error"])
    shared, run = run_once(steps, Run()), Run(threads=threads)
    audit = Audit.of(steps, audited_layer(steps), steps.graph.scene.seed)
    for _ in bands(steps, shared, run, side=side, develop=lambda *each: audit.take(*each) or {}):
        pass
    return audit.pixel_errors(audit.measured(shared, run)[1])[..., 0]


@pytest.mark.parametrize(
    "overrides", [("film.samples=1",), ("film.samples=4",), ("film.samples=4", "film.background=[3, 3, 3]")]
)
def test_the_true_error_is_the_stated_one_in_bins_of_it(path, overrides):
    """Five bins, each with a fifth of the stated square error, over some seeds."""
    several = "film.samples=4" in overrides
    finer = ("film.samples=24", "film.adaptive=false", "obscurance.samples=16") if several else ()
    finer = (*finer, "obscurance.reconstruct=false", "obscurance.sampler=owen")
    finer = finer if several else ("obscurance.samples=256", *finer)
    first, second = (luminance(path, *overrides, *finer, f"seed={seed}") for seed in (91, 92))
    stated, true = [], []
    for seed in range(4):
        picture = luminance(path, *overrides, f"seed={seed}")
        true.append((picture - first) * (picture - second))
        stated.append(np.square(errors(path, *overrides, f"seed={seed}").astype(float)))
    stated, true = np.ravel(stated), np.ravel(true)
    assert stated.mean() == pytest.approx(true.mean(), rel=0.15)
    order = np.argsort(stated, kind="stable")
    upto = np.cumsum(stated[order]) / stated.sum()
    for k in range(5):
        part = order[(upto > k / 5) & (upto <= (k + 1) / 5)]
        assert true[part].mean() == pytest.approx(stated[part].mean(), rel=0.35), k


def rendered(path, folder, *overrides, **options):
    """Channels of a rendered file, and the report of its camera."""
    out = folder / "out.exr"
    chosen = RenderOptions(overrides=overrides, pattern=str(out), force=True, **options)
    _, report = render_scene(RenderJob(path, chosen))
    return read_image(out).channels, report


@pytest.mark.parametrize("samples", [1, 3])
def test_tiles_threads_and_cache_do_not_change_it(path, tmp_path, samples):
    film = ("film.width=90", "film.height=70", f"film.samples={samples}")
    whole = errors(path, *film, threads=1)
    np.testing.assert_array_equal(whole, errors(path, *film, threads=2, side=24))
    for cache in (False, True, True):
        made, _ = rendered(path, tmp_path, *film, only=("error",), cache=cache)
        np.testing.assert_array_equal(made["error.Y"], whole)


@pytest.mark.parametrize("samples", [1, 3])
def test_the_other_layers_are_the_same_beside_it(path, tmp_path, samples):
    film = (f"film.samples={samples}", "film.width=90", "film.height=70")
    others = ("beauty", "depth", "object_id")
    alone, _ = rendered(path, tmp_path, *film, only=others)
    beside, report = rendered(path, tmp_path, *film, only=(*others, "error"))
    for name, values in alone.items():
        np.testing.assert_array_equal(values, beside[name])
    rms = np.sqrt(np.square(beside["error.Y"].astype(float)).mean())
    assert report.standard_error["main"]["rms"] == pytest.approx(rms, rel=1e-3)


def test_its_root_mean_square_is_the_audited_error_of_grey_pictures(path, tmp_path):
    _, report = rendered(path, tmp_path, "ambient=0.4", only=("beauty", "error"))
    rms = report.standard_error["main"]["rms"]
    assert rms == pytest.approx(report.audited_error["main"]["rmse"], rel=1e-4)


def test_without_ambient_light_or_antialiasing_it_is_0(path, tmp_path):
    made, report = rendered(path, tmp_path, "ambient=0", only=("beauty", "error"))
    assert not made["error.Y"].any()
    assert report.standard_error["main"] == {"mean": 0, "rms": 0}


def test_a_sweep_audits_for_it_alone(path, illum, tmp_path):
    words = ("-D", "film.width=64", "-D", "film.height=48", "-D", "ambient=0.2,0.4")
    for only, is_audited in (("error", True), ("beauty", False)):
        done = illum("sweep", path, *words, "--only", only, "-o", "{ambient}.exr", "--force",
                     "--report", "r.json", cwd=tmp_path)  # fmt: skip
        assert done.returncode == 0, done.stderr
        for entry in json.loads((tmp_path / "r.json").read_text()):
            assert bool(entry["standard_error"]) == is_audited
            assert bool(entry["audited_error"]) == is_audited


def test_pictures_that_are_too_large_to_be_held_are_refused(path, tmp_path, monkeypatch):
    monkeypatch.setattr("illumcli.accuracy.sampled_blocks.MOST_PIXELS", 160 * 120 - 1)
    with pytest.raises(LimitError, match=r"camera main: the layer error .* obscurance\.reconstruct=false"):
        rendered(path, tmp_path, only=("error",))
    rendered(path, tmp_path, only=("beauty",))
    rendered(path, tmp_path, "obscurance.reconstruct=false", only=("error",))


def test_the_plan_names_it(path, illum):
    done = illum("plan", path, "--only", "error", "--json")
    assert json.loads(done.stdout)[0]["layers"] == ["error"], done.stderr

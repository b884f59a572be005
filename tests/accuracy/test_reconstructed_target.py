"""`--target-error` with reconstruction: reached with few rays; pilots choose for what cannot be fitted."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from illumcli.accuracy.reconstructed_target import Attempts, Parts, choose_reconstruction
from illumcli.accuracy.sampled import Sampling, sampled_layer
from illumcli.scene.load import load

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 160, height: 120, samples: 1}
ambient: 1
obscurance: {samples: 64}
meshes: {ball: {shape: sphere, radius: 0.5, segments: 40, rings: 20}}
objects:
  - {mesh: {shape: plane, size: [6, 6]}}
  - {mesh: ball, transform: {translate: [0, 0.5, 0]}}
  - {mesh: ball, transform: {translate: [1, 0.5, 0]}}
lights: [{light: directional, direction: [1, -2, -1]}]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def attempts(scene, *overrides, only=()):
    return Attempts(scene, overrides, only, None, 2, None)


def test_the_picture_errs_as_asked_and_says_so(scene):
    choice = choose_reconstruction(attempts(scene, only=("obscurance",)), 0.02)
    assert choice is not None
    own = sampled_layer(load(scene), "obscurance")
    truth = [own.render(Sampling(16, 64, "owen", seed))[0].astype(float) for seed in (77, 78)]
    counts = Sampling(choice.pixel, choice.obscurance, "spiral", 0, reconstruct=True)
    made = own.render(counts)[0]
    true = np.sqrt(np.mean((made - truth[0]) * (made - truth[1])))
    assert true < 1.1 * 0.02
    assert choice.audited["main"].rmse == pytest.approx(true, rel=0.2)
    assert counts.rays < 64


def test_single_centres_are_audited_over_the_pixel(scene):
    """One sample at each centre errs at edges, whatever its obscurance does."""
    made = attempts(scene, only=("beauty",))
    counts = ("film.samples=1", "obscurance.samples=64", "obscurance.reconstruct=true")
    (view,) = made.rendered(counts)
    fit, whole = view.error("fit"), view.error("choice")
    assert whole.rmse > 2 * fit.rmse


def test_counts_of_least_cost():
    edges = Parts(1, 8, 1e-2, 1e-6, 1)
    assert edges.next_counts(0.03) == (16, 1)
    rays = Parts(8, 1, 1e-4, 0.99e-4, 1)
    pixel, each = rays.next_counts(0.005)
    assert pixel * each > 8 * 4
    assert pixel == 8
    assert Parts(1, 256, 1.0, 1.0, 1).next_counts(1e-6) is None


def test_samples_are_cheap_where_few_pixels_take_them():
    parts = Parts(1, 1, 2e-2, 1e-2, 0.05)
    everywhere = replace(parts, refined=1)
    assert parts.cost(16, 1) < everywhere.cost(16, 1) / 2
    pixel, each = parts.next_counts(0.03)
    assert each == 1
    assert pixel > everywhere.next_counts(0.03)[0]


@pytest.mark.parametrize(
    ("adaptive", "samples"), [("null", 4), ("{probes: 2}", 4), ("false", 4), ("null", 1)]
)
def test_attempts_are_adaptive_as_the_scene_is(scene, adaptive, samples):
    made = attempts(scene, f"film.adaptive={adaptive}", only=("beauty",))
    counts = (f"film.samples={samples}", "obscurance.samples=2", "obscurance.reconstruct=true")
    (view,) = made.rendered(counts)
    if adaptive == "false" or samples == 1:
        assert view.refined == 1
    else:
        assert 0 < view.refined < 0.5


@pytest.mark.parametrize(
    ("overrides", "only"),
    [
        (("obscurance.reconstruct=false",), ()),
        (("obscurance=null",), ()),
        ((), ("alpha",)),
        ((), ("beauty", "error")),
        (("ambient=0",), ()),
    ],
)
def test_what_cannot_be_fitted_is_left_to_pilots(scene, overrides, only):
    assert choose_reconstruction(attempts(scene, *overrides, only=only), 0.02) is None


def test_a_target_beyond_fits_is_reached_by_rays_alone(scene, illum, tmp_path, monkeypatch):
    monkeypatch.setattr("illumcli.accuracy.reconstructed_target.MOST_RAYS", 1)
    monkeypatch.setattr("illumcli.accuracy.reconstructed_target.MOST_PIXEL_SAMPLES", 1)
    scene.write_text(SCENE.replace("samples: 64", "samples: 64, reconstruct: true"))
    from illumcli.commands.options import RenderFiles, RenderOptions
    from illumcli.commands.render_all import render_scenes
    from illumcli.commands.runner import Here

    options = RenderOptions(pattern=str(tmp_path / "out.exr"), target_error=0.015, cache=False)
    done = []
    render_scenes([scene], options, RenderFiles(), Here(), done.append, pytest.fail)
    assert done[0].report.error["reached"] < 0.017
    assert "obscurance.reconstruct=false" in done[0].report.chosen
    assert done[0].report.audited_error == {}


def test_adaptive_sampling_is_turned_off_where_nothing_is_fitted(scene, illum, tmp_path):
    words = ("-D", "film.adaptive=true", "-D", "obscurance.reconstruct=false", "--target-error", "0.03")
    done = illum("render", scene, *words, "-o", "out.exr", "--report", "report.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "film.adaptive=false" in done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["error"]["reached"] < 0.033
    assert not report["error"]["reconstructed"]
    assert report["audited_error"] == {}

"""Adaptive antialiasing: all samples where few differ, the same picture for any tiles, threads and layers."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.errors import InputError
from illumcli.layers import NAMES
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.scene.load import load
from planned import planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 60}
film: {width: 59, height: 43, samples: 12, filter: {filter: tent, width: 2}, adaptive: 3}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 5, falloff: {falloff: linear, max_distance: 1}}
materials:
  red: {model: phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20}
  grey: {model: lambert, diffuse: 0.7}
objects:
  - {mesh: {shape: plane, size: [6, 6]}, material: grey}
  - {mesh: {shape: sphere, radius: 0.5}, material: red, transform: {translate: [0, 0.5, 0]}}
  - {mesh: {shape: box}, material: grey, shading: constant, transform: {translate: [-1, 0.5, 0]}}
lights:
  - {light: point, name: key, position: [2, 3, 2], intensity: [9, 8, 7]}
  - {light: directional, name: sun, direction: [1, -2, -1], irradiance: 0.3, shadows: false}
"""
ALL = [name for name in NAMES if name != "error"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


def rendered(path, only=ALL, threads=1, side=None, overrides=()):
    """Layers, and what was done."""
    loaded = load(path, overrides)
    steps = planned(loaded, only)
    tally = RenderStats()
    made = list(bands(steps, run_once(steps, Run(tally)), Run(tally, threads=threads), side=side))
    return {name: np.concatenate([band.layers[name] for band in made]) for name in made[0].layers}, tally


@pytest.fixture(scope="module")
def whole(scene):
    return rendered(scene, side=64)  # all of the film


@pytest.mark.parametrize(("threads", "side"), [(1, 8), (2, 13), (2, 59), (3, 128), (8, 4), (1, 1)])
def test_threads_and_tiles_change_no_bit(scene, whole, threads, side):
    if side == 1:  # every pixel a tile: slow, a corner of the film is enough
        few = ("film.width=9", "film.height=7")
        one, other = rendered(scene, overrides=few)[0], rendered(scene, side=1, overrides=few)[0]
    else:
        one, other = whole[0], rendered(scene, threads=threads, side=side)[0]
    for name, values in one.items():
        assert values.tobytes() == other[name].tobytes(), name


@pytest.mark.parametrize("layer", ALL)
def test_a_layer_alone_is_the_layer_among_all(scene, whole, layer):
    for name, values in rendered(scene, [layer])[0].items():
        assert values.tobytes() == whole[0][name].tobytes(), name


def test_one_sample_and_the_others_are_all_samples(scene):
    one, _ = rendered(scene, overrides=["film.adaptive={first: 1, difference: 0.000001}"])
    many, _ = rendered(scene, overrides=["film.adaptive=null"])
    refined = (one["beauty"] == many["beauty"]).all(axis=2)
    assert refined.mean() > 0.5


def test_every_pixel_is_that_of_few_or_of_all_samples(scene, whole):
    few, _ = rendered(scene, overrides=["film.adaptive=null", "film.samples=3"])
    many, _ = rendered(scene, overrides=["film.adaptive=null"])
    for name, values in whole[0].items():
        as_few = (values == few[name]).all(axis=2)
        as_many = (values == many[name]).all(axis=2)
        assert (as_few | as_many).all(), name
    edges = (few["beauty"] != whole[0]["beauty"]).any(axis=2)
    assert 0 < edges.mean() < 0.9


def test_edges_and_shadows_get_all_samples(scene):
    quiet = ["ambient=0", "obscurance=null"]  # nothing random but the samples' places
    own, tally = rendered(scene, ["beauty", "object_id"], overrides=quiet)
    many, _ = rendered(scene, ["beauty", "object_id"], overrides=[*quiet, "film.adaptive=null"])
    ids = many["object_id"][..., 0]
    border = np.zeros(ids.shape, bool)
    border[1:] |= ids[1:] != ids[:-1]
    border[:, 1:] |= ids[:, 1:] != ids[:, :-1]
    assert (own["beauty"][border] == many["beauty"][border]).all()
    assert np.sqrt(np.square(own["beauty"] - many["beauty"]).mean()) < 0.003
    assert 0 < tally.refined < 0.8 * ids.size
    assert tally.saved["samples"] > 0


def test_counts_are_those_of_the_rays(scene, whole):
    _, tally = whole
    loaded = load(scene)
    view = planned(loaded).view
    assert tally.saved["samples"] == (59 * 43 - tally.refined) * (12 - 3)
    assert view.is_adaptive


def test_a_first_count_of_all_samples_changes_nothing(scene):
    off = rendered(scene, ["beauty"], overrides=["film.adaptive=null"])[0]
    same = rendered(scene, ["beauty"], overrides=["film.adaptive=12"])[0]
    assert off["beauty"].tobytes() == same["beauty"].tobytes()


def test_a_difference_of_nearly_none_refines_nearly_all(scene):
    few = rendered(scene, ["beauty"], overrides=["film.adaptive={first: 3, difference: 0.9}"])[1].refined
    many = rendered(scene, ["beauty"], overrides=["film.adaptive={first: 3, difference: 0.001}"])[1].refined
    assert few < many


def test_the_error_of_a_fixed_count_is_refused(scene):
    with pytest.raises(InputError, match=r"leave it out, or film\.adaptive"):
        rendered(scene, ["error"])


def test_the_job_reports_it_and_keeps_its_bytes_in_a_cache(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "kept"))
    pictures = []
    for number, cache in enumerate((False, True, True)):
        (path,), report = render_scene(RenderJob(scene, RenderOptions(pattern=f"{number}.exr", cache=cache)))
        pictures.append(path.read_bytes())
        data = json.loads(json.dumps(report.as_data()))
        assert 0 < data["refined"] < 59 * 43
        assert data["saved"]["samples"] != 0
    render_scene(RenderJob(scene, RenderOptions(["film.adaptive=null"], pattern="plain.exr")))
    render_scene(RenderJob(scene, RenderOptions(pattern="again.exr")))
    assert (tmp_path / "again.exr").read_bytes() == pictures[0] == pictures[1] == pictures[2]
    assert (tmp_path / "plain.exr").read_bytes() != pictures[0]

"""Pictures with reconstructed obscurance: the same for any tiles, threads and caches, with less error."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.render_graph.execute import Run, at_pixels, run_once
from illumcli.render_graph.explain import expected_rays
from illumcli.scene.load import load
from planned import layers_of, planned
from tetrahedron import baked_object

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 101, height: 77, samples: 1, adaptive: false}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 4, reconstruct: true}
meshes: {ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}}
objects:
  - {mesh: {shape: plane, size: [6, 6]}}
  - {mesh: ball, transform: {translate: [0, 0.5, 0]}}
  - {mesh: ball, transform: {translate: [1, 0.5, 0]}}
"""
LAYERS = ("beauty", "obscurance", "depth")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


def picture(path, *overrides, only=LAYERS, threads=1, side=None, cache=None):
    run = Run(threads=threads) if cache is None else Run(cache=cache, threads=threads)
    return layers_of(planned(load(path, overrides), only, cache), run, side)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize(("threads", "side"), [(1, 8), (2, 13), (3, 128), (2, 40)])
def test_threads_and_tiles_change_no_bit(path, samples, threads, side):
    count = f"film.samples={samples}"
    whole, again = picture(path, count), picture(path, count, threads=threads, side=side)
    for name, values in whole.items():
        assert values.tobytes() == again[name].tobytes(), name


def test_only_a_fit_that_is_read_again_is_kept(path):
    memory = MemoryCache()
    key = planned(load(path), LAYERS, Cache(None, memory)).lookup.keeps["fitted_obscurance"]
    picture(path, cache=Cache(None, memory))
    assert key not in memory.once
    memory.wanted = frozenset([key])
    picture(path, cache=Cache(None, memory))
    assert key in memory.once


def test_cached_obscurance_changes_no_bit(path):
    memory = MemoryCache()
    first = picture(path, cache=Cache(None, memory))
    memory.wanted = frozenset(planned(load(path), LAYERS, Cache(None, memory)).lookup.keeps.values())
    again = picture(path, cache=Cache(None, memory))
    steps = planned(load(path), LAYERS, Cache(None, memory))
    assert "fitted_obscurance" in steps.lookup.reused
    assert steps.before == 0
    third = picture(path, cache=Cache(None, memory))
    for name, values in picture(path).items():
        assert all(values.tobytes() == each[name].tobytes() for each in (first, again, third)), name


@pytest.mark.parametrize("samples", [1, 4])
def test_error_falls_to_less_than_a_third(path, samples):
    count = f"film.samples={samples}"
    truth = picture(path, count, "obscurance.samples=2048", "obscurance.reconstruct=false")
    raw, after = (picture(path, count, f"obscurance.reconstruct={on}") for on in ("false", "true"))
    errors = [float(np.sqrt(np.mean(np.square(p["obscurance"] - truth["obscurance"])))) for p in (raw, after)]
    assert errors[1] < errors[0] / 3
    np.testing.assert_array_equal(raw["depth"], after["depth"])


def test_an_open_scene_stays_exactly_open(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE.split("  - {mesh: ball")[0])
    made = picture(scene, "film.samples=3", only=("obscurance", "alpha"))
    assert 0 < made["alpha"].mean() < 1
    np.testing.assert_array_equal(made["obscurance"], made["alpha"])


def test_baked_objects_keep_their_values(path, tmp_path, illum):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE + baked_object(tmp_path, illum))
    raw, after = (
        picture(scene, f"obscurance.reconstruct={on}", only=("obscurance", "object_id"))
        for on in ("false", "true")
    )
    baked = after["object_id"] == 4
    assert baked.any()
    np.testing.assert_array_equal(raw["obscurance"][baked], after["obscurance"][baked])
    assert (raw["obscurance"] != after["obscurance"])[~baked].any()


def test_pixels_alone_are_refused(path):
    steps = planned(load(path))
    x = np.arange(3)
    with pytest.raises(ValueError, match="alone"):
        at_pixels(steps, run_once(steps, Run()), Run(), x, x)


def test_expected_rays_are_those_of_the_raw_values(path):
    steps = planned(load(path))
    names = [node.output for node in steps.tile]
    assert names.index("object_pixels") < steps.before <= names.index("obscurance")
    rays = expected_rays(steps.graph.scene, [steps.view], steps.computed)
    assert rays == {"primary": 101 * 77, "raw_obscurance": 4 * 101 * 77}

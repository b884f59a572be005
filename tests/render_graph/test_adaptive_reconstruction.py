"""Reconstructed obscurance in adaptive pictures: the same for any tiles, threads, layers and caches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from illumcli.cache import policy
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run
from illumcli.render_graph.schedule import outputs_of, shared_keys
from illumcli.render_graph.tile_nodes import RenderStats
from illumcli.scene.load import load
from planned import layers_of, planned
from tetrahedron import baked_object

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 50}
film: {width: 75, height: 61, samples: 4, filter: {filter: tent, width: 2}, adaptive: true}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 2, reconstruct: true}
materials:
  red: {model: phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20}
  grey: {model: lambert, diffuse: 0.7}
meshes: {ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}}
objects:
  - {mesh: {shape: plane, size: [6, 6]}, material: grey}
  - {mesh: ball, material: red, transform: {translate: [0, 0.5, 0]}}
  - {mesh: ball, material: grey, transform: {translate: [1, 0.5, 0]}}
lights:
  - {light: point, name: key, position: [2, 3, 2], intensity: [9, 8, 7]}
"""
LAYERS = ("beauty", "obscurance", "ambient", "key", "shadow.key", "alpha", "depth")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


def rendered(path, *overrides, only=LAYERS, threads=1, side=None, cache=None):
    """Layers, and what was done."""
    stats = RenderStats()
    run = Run(stats, threads=threads) if cache is None else Run(stats, cache, threads)
    steps = planned(load(path, overrides), only, cache)
    return layers_of(steps, run, side), stats


@pytest.fixture(scope="module")
def whole(path):
    return rendered(path, side=96)  # all of the film


def assert_same(one, other):
    for name, values in one.items():
        assert values.tobytes() == other[name].tobytes(), name


@pytest.mark.parametrize(("threads", "side"), [(1, 8), (2, 13), (3, 128), (2, 40)])
def test_threads_and_tiles_change_no_bit(path, whole, threads, side):
    assert_same(whole[0], rendered(path, threads=threads, side=side)[0])


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_alone_is_the_layer_among_all(path, whole, layer):
    alone = rendered(path, only=[layer])[0]
    assert_same({layer: alone[layer]}, whole[0])


def test_few_pixels_take_several_samples_all_their_rays(path, whole):
    layers, stats = whole
    pixels = layers["alpha"].size
    assert 0 < stats.refined < pixels / 2
    full = rendered(path, "film.adaptive=false")[1]
    assert stats.rays["raw_obscurance"] == pytest.approx(full.rays["raw_obscurance"], rel=0.02)
    assert stats.rays["hits"] < 0.8 * full.rays["hits"]


def test_light_that_needs_samples_changes_no_obscurance(path, whole):
    """Where light alone wants all samples, these take w from the centre's pair: a fit reads edges alone."""
    finer, stats = rendered(path, "film.adaptive={difference: 0.0001}")
    assert stats.refined > 1.2 * whole[1].refined
    assert (finer["beauty"] != whole[0]["beauty"]).any()
    assert stats.rays["raw_obscurance"] == whole[1].rays["raw_obscurance"]
    assert_same({"obscurance": finer["obscurance"]}, whole[0])


def test_error_is_less_than_half_of_what_is_not_reconstructed(path):
    truth = rendered(
        path,
        "film.adaptive=false",
        "film.samples=64",
        "obscurance.samples=64",
        "obscurance.reconstruct=false",
    )[0]["obscurance"]

    def error(*overrides):
        return float(np.sqrt(np.square(rendered(path, *overrides)[0]["obscurance"] - truth).mean()))

    mixed = error("film.samples=16")
    assert mixed < error("film.samples=16", "obscurance.reconstruct=false") / 2
    assert mixed < 1.1 * error("film.samples=16", "film.adaptive=false")


def test_an_open_scene_stays_exactly_open(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE.split("  - {mesh: ball, material: red")[0])
    made = rendered(scene, only=("obscurance", "alpha"))[0]
    assert 0 < made["alpha"].mean() < 1
    np.testing.assert_array_equal(made["obscurance"], made["alpha"])


def test_baked_objects_keep_their_values(path, tmp_path, illum):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE.replace("lights:", f"{baked_object(tmp_path, illum)}lights:"))
    raw, after = (
        rendered(scene, f"obscurance.reconstruct={on}", only=("obscurance", "object_id"))[0]
        for on in ("false", "true")
    )
    inside = after["object_id"][..., 0] == 4
    for axis in (0, 1):  # pixels whose neighbours see the same object
        inside &= np.roll(inside, 1, axis) & np.roll(inside, -1, axis)
    assert inside.any()
    np.testing.assert_array_equal(raw["obscurance"][inside], after["obscurance"][inside])
    assert (raw["obscurance"] != after["obscurance"])[~inside].any()


CHANGES = {
    "nothing": (),
    "a material": ("materials.red.diffuse=0.3",),
    "a light": ("lights.key.intensity=3",),
    "a place of a light": ("lights.key.position=[-2, 3, 2]",),
    "more pixels": ("film.adaptive={difference: 0.001}",),
    "other probes": ("film.adaptive={probes: 4}",),
    "other rays": ("obscurance.samples=3",),
    "all samples": ("film.adaptive=false",),
    "no fit": ("obscurance.reconstruct=false",),
}


@pytest.fixture
def everything_kept(monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("before", ["beauty", "ambient"])
@pytest.mark.usefixtures("everything_kept")
def test_what_is_stored_changes_no_bit(path, tmp_path, change, before):
    cache = Cache(Store(tmp_path / "store"), None)
    rendered(path, only=[before], cache=cache)
    again, stats = rendered(path, *CHANGES[change], only=["beauty"], cache=cache, side=16)
    assert_same(rendered(path, *CHANGES[change], only=["beauty"])[0], again)
    if change in ("nothing", "a material", "a light", "a place of a light"):
        assert "raw_obscurance" not in stats.rays


@pytest.mark.parametrize("change", CHANGES)
def test_what_a_sweep_keeps_changes_no_bit(path, change):
    memory = MemoryCache()
    graphs = []
    for overrides in ((), CHANGES[change]):
        loaded = load(path, overrides)
        graphs.append(build(loaded.scene, loaded))
    outputs = outputs_of(graphs[0].scene, ["beauty"])
    memory.wanted = shared_keys(graphs[0], graphs[1], outputs)
    cache = Cache(None, memory)
    rendered(path, only=["beauty"], cache=cache)
    again, stats = rendered(path, *CHANGES[change], only=["beauty"], cache=cache)
    assert_same(rendered(path, *CHANGES[change], only=["beauty"])[0], again)
    if change in ("a material", "a light"):
        assert not {"raw_obscurance", "shadow:key"} & stats.rays.keys()


@pytest.mark.usefixtures("everything_kept")
def test_fits_of_large_pictures_are_not_kept(path, tmp_path, monkeypatch):
    monkeypatch.setattr("illumcli.render_graph.tile_nodes.LARGEST_FIT", 75 * 61 - 1)
    cache = Cache(Store(tmp_path / "store"), None)
    made, _ = rendered(path, only=["beauty"], cache=cache)
    again, stats = rendered(path, only=["beauty"], cache=cache)
    assert_same(made, again)
    assert "raw_obscurance" in stats.rays
    assert "hits" not in stats.rays


@pytest.mark.parametrize("size", [(1280, 720), (40000, 1000)])
def test_tiles_are_the_same_with_a_fit_from_the_cache(path, size):
    """Buffers in memory are those of tiles: another size would not find them."""
    overrides = [f"film.width={size[0]}", f"film.height={size[1]}"]
    steps = planned(load(path, overrides), ["beauty"])
    assert steps.before > 0
    assert replace(steps, before=0).tile_side(steps.view) == steps.tile_side(steps.view)


def test_tiles_with_margins_are_larger(path):
    size = ["film.width=1280", "film.height=720"]
    steps, raw = (
        planned(load(path, [*size, f"obscurance.reconstruct={said}"]), ["beauty"])
        for said in ("true", "false")
    )
    assert steps.tile_side(steps.view) ** 2 >= 1.5 * raw.tile_side(raw.view) ** 2


def test_decisions_in_memory_go_with_another_fit(path):
    """The attempts for a target error keep what decides about pixels, too."""
    memory = MemoryCache()
    cache = Cache(None, memory)
    memory.wanted = frozenset(planned(load(path), ["beauty"], cache).lookup.keeps.values())
    rendered(path, only=["beauty"], cache=cache)
    finer = "obscurance.samples=5"
    steps = planned(load(path, [finer]), ["beauty"], cache)
    assert "refined:beauty" in steps.lookup.reused
    assert "fitted_obscurance" not in steps.lookup.reused
    assert_same(
        rendered(path, finer, only=["beauty"])[0], rendered(path, finer, only=["beauty"], cache=cache)[0]
    )

"""Adaptive antialiasing: all samples where few differ, the same picture for any tiles, threads and layers."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.cache import policy
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.film.tiles import tiles
from illumcli.layers import NAMES
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import RenderStats, Run
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.replicates import LUMINANCE
from illumcli.render_graph.schedule import outputs_of, reached, shared_keys
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 60}
film: {width: 59, height: 43, samples: 12, filter: {filter: tent, width: 2}, adaptive: true}
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
    return layers_of(steps, Run(tally, threads=threads), side), tally


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


def test_every_pixel_is_its_centre_with_all_rays_or_that_of_all_samples(scene, whole):
    one, _ = rendered(scene, overrides=["film.adaptive=false", "film.samples=1", "obscurance.samples=60"])
    many, _ = rendered(scene, overrides=["film.adaptive=false"])
    for name, values in whole[0].items():
        as_one = (values == one[name]).all(axis=2)
        as_many = (values == many[name]).all(axis=2)
        assert (as_one | as_many).all(), name
    refined = (one["beauty"] != whole[0]["beauty"]).any(axis=2)
    assert 0 < refined.mean() < 0.9


def test_data_is_that_of_the_centres(scene, whole):
    one, _ = rendered(scene, overrides=["film.adaptive=false", "film.samples=1"])
    for name in ("depth", "position", "normal", "uv", "object_id", "material_id", "triangle_id"):
        assert whole[0][name].tobytes() == one[name].tobytes()


def test_data_alone_takes_one_ray_a_pixel(scene):
    _, stats = rendered(scene, ["depth", "object_id"])
    _, one = rendered(scene, ["depth", "object_id"], overrides=["film.adaptive=false", "film.samples=1"])
    assert dict(stats.rays) == dict(one.rays)


def test_all_rays_of_obscurance_are_cast(scene):
    """Whether a pixel has one sample or all: rays for as many samples as each hit represents."""
    _, stats = rendered(scene, ["ambient"], side=64)
    _, many = rendered(scene, ["ambient"], overrides=["film.adaptive=false"])
    assert stats.refined > 0
    assert stats.rays["obscurance"] == pytest.approx(many.rays["obscurance"], rel=0.02)


def test_edges_shadows_and_highlights_get_all_samples(scene):
    quiet = ["ambient=0", "obscurance=null"]  # nothing random but the samples' places
    own, stats = rendered(scene, ["beauty"], overrides=quiet)
    many, _ = rendered(scene, ["beauty", "object_id"], overrides=[*quiet, "film.adaptive=false"])
    ids = many["object_id"][..., 0]
    border = np.zeros(ids.shape, bool)
    border[1:] |= ids[1:] != ids[:-1]
    border[:, 1:] |= ids[:, 1:] != ids[:, :-1]
    assert (own["beauty"][border] == many["beauty"][border]).all()
    difference = np.abs(own["beauty"] - many["beauty"]).max(axis=2)
    assert np.sqrt(np.square(difference).mean()) < 0.001
    assert difference.max() < 0.01
    assert 0 < stats.refined < 0.8 * ids.size
    assert stats.saved["samples"] == (ids.size - stats.refined) * 11


def test_noise_of_obscurance_refines_nothing(scene):
    """What decides is not random: more pixels would want all samples where w is noisier."""
    few = rendered(scene, ["beauty"], overrides=["obscurance.samples=1"])[1].refined
    many = rendered(scene, ["beauty"], overrides=["obscurance.samples=40"])[1].refined
    assert few == many


WIRE = """
version: 1
camera: {projection: orthographic, position: [0, 0, 5], target: [0, 0, 0], extent: 2}
film: {width: 40, height: 40, samples: 16, adaptive: true}
ambient: 1
objects:
  - {mesh: wire.obj, material: {model: lambert, diffuse: 0.9}}
"""


def quads(*rectangles):
    """The text of an OBJ file of upright rectangles: left, right, low, high and depth of each."""
    text = ""
    for a, b, c, d, z in rectangles:
        text += f"v {a} {c} {z}\nv {b} {c} {z}\nv {b} {d} {z}\nv {a} {d} {z}\n"
    return text + "".join(
        f"f {4 * k + 1} {4 * k + 2} {4 * k + 3} {4 * k + 4}\n" for k in range(len(rectangles))
    )


def test_probes_find_what_lies_between_centres(tmp_path):
    """A wire 0.4 pixels wide between two columns of centres, close to another object: all of it is found."""
    path = tmp_path / "scene.yaml"
    path.write_text(WIRE + "  - {mesh: wall.obj, material: {model: lambert, diffuse: 0.1}}\n")
    (tmp_path / "wall.obj").write_text(quads((-3, 3, -3, 3, -0.02)))
    (tmp_path / "wire.obj").write_text(quads((0.03, 0.05, -0.5, 0.5, 0)))
    own, _ = rendered(path, ["beauty"])
    many, _ = rendered(path, ["beauty"], overrides=["film.adaptive=false"])
    assert np.count_nonzero(many["beauty"][..., 0] > 0.2) == 20
    assert own["beauty"].tobytes() == many["beauty"].tobytes()


def test_probes_find_a_wire_before_a_wall_of_the_same_object(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(WIRE + "obscurance: {samples: 4, falloff: {falloff: step, max_distance: 1}}\n")
    (tmp_path / "wire.obj").write_text(quads((0.03, 0.05, -0.5, 0.5, 0), (-0.9, 0.9, -0.9, 0.9, -0.3)))
    _, stats = rendered(path, ["obscurance"])
    _, flat = rendered(path, ["obscurance"], overrides=["film.adaptive={probes: 1}"])
    assert stats.refined > flat.refined + 20


def test_a_slope_is_no_edge(tmp_path):
    """A floor up to the horizon, in perspective and tilted: only where it ends."""
    path = tmp_path / "scene.yaml"
    path.write_text("""
version: 1
camera: {position: [0, 1, 3], target: [0, 0.6, 0], up: [1, 1, 0], fov: 50}
film: {width: 64, height: 48, samples: 8, adaptive: true}
ambient: 0.5
objects:
  - {mesh: {shape: plane, size: [400, 400]}, material: {model: lambert, diffuse: 0.9}}
""")
    _, stats = rendered(path, ["beauty"])
    assert 50 <= stats.refined <= 280 + 64 * 48 - 62 * 46


def test_a_steep_slope_is_no_edge_at_the_film_s(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(WIRE.replace("[0, 0, 5]", "[0, 1, 5.7]"))  # six pixels deeper with every row
    (tmp_path / "wire.obj").write_text("v -9 0 -90\nv 9 0 -90\nv 9 0 90\nv -9 0 90\nf 4 3 2 1\n")
    _, stats = rendered(path, ["beauty"])
    assert stats.refined == 40 * 40 - 38 * 38  # the film's border alone


def test_a_shadow_s_edge_beyond_the_last_centres_is_found(tmp_path):
    """In the lower half of the last row, where no centre lies beyond it."""
    path = tmp_path / "scene.yaml"
    path.write_text(WIRE + "lights: [{light: directional, direction: [0, 1, -1], irradiance: 1}]\n")
    (tmp_path / "wire.obj").write_text(quads((-9, 9, -9, 9, 0), (-9, 9, -3, -1.985, 1)))
    own, _ = rendered(path, ["beauty"])
    many, _ = rendered(path, ["beauty"], overrides=["film.adaptive=false"])
    assert 0.02 < np.ptp(many["beauty"][-2:, 20, 0]) < 0.2
    assert own["beauty"].tobytes() == many["beauty"].tobytes()


def test_a_texture_finer_than_pixels_wants_all_samples(tmp_path):
    """Stripes that repeat with every pixel: the centres all see the same colour."""
    from illumcli.images.writer import ImageWriter

    with ImageWriter(tmp_path / "stripes.png", 80, 80, dict.fromkeys("RGB", "uint8"), {}) as file:
        file.write_band(0, np.tile(np.array([250, 10], np.uint8)[None, :, None], (80, 40, 3)))
        file.close()
    path = tmp_path / "scene.yaml"
    path.write_text("""
version: 1
camera: {projection: orthographic, position: [0, 0, 5], target: [0, 0, 0], extent: 2}
film: {width: 40, height: 40, samples: 16, adaptive: true}
ambient: 1
objects:
  - mesh: {shape: plane, size: [2, 2]}
    material: {model: lambert, diffuse: {texture: stripes.png, filter: nearest}}
    transform: {rotate: [90, 0, 0]}
""")
    own, _ = rendered(path, ["beauty"])
    many, _ = rendered(path, ["beauty"], overrides=["film.adaptive=false"])
    assert own["beauty"].tobytes() == many["beauty"].tobytes()


def test_a_smaller_difference_refines_more(scene):
    few = rendered(scene, ["beauty"], overrides=["film.adaptive={difference: 0.9}"])[1].refined
    many = rendered(scene, ["beauty"], overrides=["film.adaptive={difference: 0.0001}"])[1].refined
    assert few < many


def test_a_wide_filter_is_refined_as_far_from_edges(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(WIRE)
    (tmp_path / "wire.obj").write_text(quads((-0.4, 0.3, -0.5, 0.5, 0)))
    wide = "film.filter={filter: box, width: 8}"
    own, _ = rendered(path, ["beauty"], overrides=[wide])
    many, _ = rendered(path, ["beauty"], overrides=[wide, "film.adaptive=false"])
    assert own["beauty"].tobytes() == many["beauty"].tobytes()


def shown(layers):
    """(H, W) luminance."""
    return layers["beauty"].astype(float) @ LUMINANCE


@pytest.mark.parametrize(
    "overrides",
    [(), ("ambient=0",), ("film.adaptive={difference: 1}", "ambient=0")],
    ids=["rays and edges", "edges", "much that is missed"],
)
def test_the_error_is_that_of_adaptive_pixels(scene, overrides):
    """Against pictures of all samples: (F - C) (F - D) is on average the squared error of F, bias too."""
    full = (*overrides, "film.adaptive=false", "film.samples=48")
    others = [shown(rendered(scene, ["beauty"], overrides=(*full, f"seed={k}"))[0]) for k in (1, 2, 3, 4)]
    c, d = others[0] + others[1], others[2] + others[3]
    true, stated = [], []
    for seed in range(20, 26):
        made, _ = rendered(scene, ["beauty", "error"], overrides=(*overrides, f"seed={seed}"))
        true.append(((shown(made) - c / 2) * (shown(made) - d / 2)).mean())
        stated.append(np.square(made["error"], dtype=float).mean())
    ratio = np.sqrt(np.mean(stated) / np.mean(true))
    # half the squared difference to a replicate has but half of the bias
    assert 0.71 < ratio < 1.2 if "difference" in "".join(overrides) else 0.85 < ratio < 1.15


def test_the_error_changes_no_other_layer_and_comes_alone(scene, whole):
    with_error, stats = rendered(scene, [*ALL, "error"], side=16)
    for name, values in whole[0].items():
        assert values.tobytes() == with_error[name].tobytes(), name
    alone, _ = rendered(scene, ["error"], threads=2)
    assert alone.keys() == {"error"}
    assert alone["error"].tobytes() == with_error["error"].tobytes()
    replicated = 30 * 22 * 12
    assert stats.rays["replicate.hits"] == pytest.approx(replicated, rel=0.5)
    loaded = load(scene)
    plan = planned(loaded, ("error",))
    expected = expected_rays(loaded.scene, [plan.view], plan.computed)
    assert expected["replicate.primary"] == replicated
    assert {"replicate.samples", "replicate.luminance"} <= {*reached(plan.graph, plan.outputs)}


def test_no_probe_is_traced_twice(scene):
    _, stats = rendered(scene, ["beauty"], side=16)
    plan = planned(load(scene), ["beauty"])
    view = plan.view
    bordered = [
        tile.grown(view.border, view.width, view.height)
        for row in tiles(view.width, view.height, 16, 1)
        for tile in row
    ]
    pixels = sum(tile.width * tile.height for tile in bordered)
    assert stats.rays["probes"] == view.probing().samples * pixels


def test_threads_share_a_small_picture_of_many_samples(scene):
    plan = planned(load(scene, ["film={width: 64, height: 64, samples: 16, adaptive: true}"]), ["beauty"])
    assert plan.tile_side(plan.view) == 32


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
    render_scene(RenderJob(scene, RenderOptions(["film.adaptive=false"], pattern="plain.exr")))
    render_scene(RenderJob(scene, RenderOptions(pattern="again.exr")))
    assert (tmp_path / "again.exr").read_bytes() == pictures[0] == pictures[1] == pictures[2]
    assert (tmp_path / "plain.exr").read_bytes() != pictures[0]


# --- buffers kept between runs ------------------------------------------------------------------------------


@pytest.fixture
def keeps_everything(monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)


def cached(path, *overrides, store=None, memory=None, only=ALL, threads=1, side=None):
    """Layers, rays by node, and what was loaded from the cache."""
    loaded = load(path, overrides)
    run = Run(RenderStats(), Cache(store, memory), threads)
    plan = planned(loaded, only, run.cache)
    layers = layers_of(plan, run, side)
    others = plan.all_samples.lookup.reused if plan.all_samples else {}
    return layers, dict(run.stats.rays), {**plan.lookup.reused, **others}


def same(a, b):
    assert a.keys() == b.keys()
    for name, values in a.items():
        assert values.tobytes() == b[name].tobytes(), name


CHANGES = [
    "materials.red.diffuse=[0.1,0.2,0.9]", "materials.red.exponent=200", "lights.key.intensity=1",
    "ambient=0.9",
    "lights.key.position=[1,3,2]", "camera.position=[1.4,1.6,3]", "obscurance.samples=3", "film.samples=6",
    "film.adaptive={difference: 0.2}", "film.adaptive={difference: 0.001}", "film.adaptive={probes: 9}",
    "film.adaptive=false", "objects.1.shading=gouraud", "seed=4",
]  # fmt: skip


def test_a_second_run_takes_no_ray_and_gives_the_same_bits(scene, whole, tmp_path, keeps_everything):
    store = Store(tmp_path / "kept")
    same(whole[0], cached(scene, store=store, side=13)[0])
    for threads, side in ((1, None), (2, 13), (2, 59)):
        layers, rays, reused = cached(scene, store=store, threads=threads, side=side)
        same(whole[0], layers)
        assert rays == {}
        assert {"hits", "shadow:key", "obscurance", "edges", "geometry"} <= reused.keys()
        assert "tracer" not in reused


@pytest.mark.parametrize("change", CHANGES)
def test_changes_find_only_what_is_their_own(scene, whole, tmp_path, change, keeps_everything):
    """On disk and in memory, over and over: what one picture lacks, the other may have."""
    expected = cached(scene, change)[0]
    store = Store(tmp_path / "kept")
    first, second = load(scene), load(scene, [change])
    graphs = [build(each.scene, each) for each in (first, second)]
    memory = MemoryCache(shared_keys(*graphs, outputs_of(second.scene, ALL)))
    cached(scene, store=store)
    cached(scene, memory=memory)
    same(expected, cached(scene, change, store=store)[0])
    same(expected, cached(scene, change, memory=memory)[0])
    same(whole[0], cached(scene, store=store)[0])
    same(expected, cached(scene, change, store=store, threads=2, side=16)[0])


@pytest.mark.parametrize("kind", ["store", "memory"])
def test_a_change_of_material_traces_only_where_it_wants_samples(scene, tmp_path, kind, keeps_everything):
    change = "materials.grey.diffuse=0.02"
    plain = sum(cached(scene, change, only=["beauty"])[1].values())
    first, second = load(scene), load(scene, [change])
    graphs = [build(each.scene, each) for each in (first, second)]
    wanted = shared_keys(*graphs, outputs_of(second.scene, ["beauty"]))
    where = {kind: Store(tmp_path / "kept") if kind == "store" else MemoryCache(wanted)}
    cached(scene, only=["beauty"], **where)
    rays = cached(scene, change, only=["beauty"], **where)[1]
    assert 0 < sum(rays.values()) < 0.15 * plain
    exposed = cached(scene, "film.background=0.3", only=["beauty"], **where)[1]
    assert exposed == {}


def test_what_was_not_read_before_is_traced_when_it_is(scene, tmp_path, keeps_everything):
    """Obscurance at the centres of refined pixels, of which another difference refines fewer."""
    store, fewer = Store(tmp_path / "kept"), "film.adaptive={difference: 1}"
    cached(scene, "film.adaptive={difference: 0.0001}", store=store, only=["beauty"])
    layers, rays, reused = cached(scene, fewer, store=store, only=["beauty"])
    same(cached(scene, fewer, only=["beauty"])[0], layers)
    assert "obscurance" in reused
    assert rays["obscurance"] > 0


def test_damaged_entries_of_some_pixels_are_made_again(scene, whole, tmp_path, keeps_everything):
    store = Store(tmp_path / "kept")
    cached(scene, store=store)
    for entry in store.entries():
        entry.path.write_bytes(entry.path.read_bytes()[:-3])
    same(whole[0], cached(scene, store=store)[0])
    assert cached(scene, store=store)[1] == {}


@pytest.mark.parametrize(
    ("overrides", "is_adaptive"),
    [
        (["film.samples=8"], True),
        (["film.samples=7"], False),
        (["film.samples=2", "film.adaptive=true"], True),
        (["film.samples=8", "film.adaptive=false"], False),
        (["film.samples=8", "film.adaptive={probes: 3}"], True),
        (["film.samples=1", "film.adaptive=true"], False),
        (["camera.samples=9", "film.samples=1"], True),
        (["film.samples=2", "obscurance.reconstruct=true"], True),
        (["film.samples=4", "obscurance.reconstruct=true", "film.adaptive=false"], False),
    ],
)
def test_eight_samples_or_two_reconstructed_are_adaptive_by_default(scene, overrides, is_adaptive):
    plan = planned(load(scene, ["film.adaptive=null", *overrides]), ["beauty"])
    assert (plan.all_samples is not None) is is_adaptive

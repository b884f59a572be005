"""Pictures: the same for any threads, tiles and layers; the texts' worked examples; no mixed-up samples."""

from __future__ import annotations

from threading import Barrier, Event

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.film.tiles import MIN_TILE_SAMPLES, Samples, Tile, tiles
from illumcli.graph import Node
from illumcli.layers import NAMES
from illumcli.rays.interaction import Hits
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.render_graph.explain import expected_rays, why_not
from illumcli.render_graph.schedule import Plan
from illumcli.render_graph.stages import ray_order
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 83, height: 61, samples: 3, filter: {filter: tent, width: 2}}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 7, falloff: {falloff: linear, max_distance: 1}}
meshes:
  ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}
materials:
  red: {model: phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20, emission: 0.05}
  grey: {model: lambert, diffuse: 0.7}
objects:
  - {mesh: {shape: plane, size: [6, 6]}, material: grey}
  - {mesh: ball, material: red, transform: {translate: [0, 0.5, 0]}}
  - {mesh: ball, material: red, shading: gouraud, transform: {translate: [1, 0.5, 0]}}
  - {mesh: ball, material: grey, shading: constant, transform: {translate: [-1, 0.5, 0]}}
  - {mesh: ball, material: red, shading: quadratic, transform: {translate: [0, 0.5, -1]}}
lights:
  - {light: point, name: key, position: [2, 3, 2], intensity: [9, 8, 7]}
  - {light: spot, name: rim, position: [-2, 3, -1], target: [0, 0, 0], angle: 40, intensity: 20}
  - {light: directional, name: sun, direction: [1, -2, -1], irradiance: 0.3, shadows: false}
"""
ALL = list(NAMES)


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)

    def render(*only, threads=1, side=None, overrides=(), **more):
        loaded = load(path, overrides)
        steps = planned(loaded, only)
        tally = RenderStats()
        shared = run_once(steps, Run(tally, threads=threads))
        made = list(bands(steps, shared, Run(tally, threads=threads), side=side, **more))
        names = made[0].layers
        return {name: np.concatenate([band.layers[name] for band in made]) for name in names}

    return render


@pytest.fixture(scope="module")
def whole(picture):
    return picture(*ALL)


@pytest.mark.parametrize(("threads", "side"), [(1, 8), (2, 13), (2, 61), (3, 128), (8, 4)])
def test_threads_and_tiles_change_no_bit(picture, whole, threads, side):
    again = picture(*ALL, threads=threads, side=side)
    for name, values in whole.items():
        assert values.tobytes() == again[name].tobytes(), name


@pytest.mark.parametrize("overrides", [(), ("film.samples=8", "film.adaptive=true")])
def test_bands_hold_what_is_made_of_their_tiles(picture, overrides):
    def develop(tile, layers):
        x, y = np.meshgrid(range(tile.x, tile.x + tile.width), range(tile.y, tile.y + tile.height))
        bright = layers["beauty"].max(axis=-1) > 0.5
        return {"place": np.stack([x, y], axis=-1).astype(np.uint16), "bright": bright[..., None]}

    plain = picture("beauty", overrides=overrides)["beauty"]
    made = picture("beauty", side=13, threads=2, overrides=overrides, develop=develop)
    assert set(made) == {"place", "bright"}
    assert made["place"].dtype == np.uint16
    rows, columns = np.indices(plain.shape[:2])
    np.testing.assert_array_equal(made["place"], np.stack([columns, rows], axis=-1))
    np.testing.assert_array_equal(made["bright"][..., 0], plain.max(axis=-1) > 0.5)


@pytest.mark.parametrize(
    ("width", "height", "side", "samples"),
    [
        (1280, 720, 192, 1),
        (1280, 720, 128, 4),
        (83, 61, 13, 3),
        (64, 64, 64, 1),
        (7, 300, 8, 16),
        (5, 3, 8, 1),
    ],
)
def test_tiles_cover_every_pixel_once_and_end_small(width, height, side, samples):
    rows = tiles(width, height, side, samples)
    seen = np.zeros((height, width), int)
    for row in rows:
        assert len({(tile.y, tile.height) for tile in row}) == 1  # a row is a band
        for tile in row:
            assert max(tile.width, tile.height) <= side
            np.add.at(seen, tile.pixels()[::-1], 1)
    assert (seen == 1).all()
    last = [tile.width for tile in rows[-1]]
    assert last == sorted(last, reverse=True)
    if width * height * samples > 100 * MIN_TILE_SAMPLES:
        assert rows[-1][-1].width <= side / 4


def test_tiles_are_about_equal():
    rows = tiles(320, 180, 176, 1)
    assert [[(tile.width, tile.height) for tile in row] for row in rows] == [
        [(160, 96), (160, 96)],
        [(160, 84), (80, 84), (80, 84)],
    ]


@pytest.mark.parametrize(("width", "height"), [(8, 8), (13, 6), (1, 5), (64, 3)])
def test_a_tile_in_blocks_has_every_pixel_once_and_whole_blocks_in_a_row(width, height):
    order = Tile(5, 7, width, height).in_blocks()
    assert np.array_equal(np.sort(order), np.arange(width * height))
    y, x = np.divmod(order, width)
    assert np.count_nonzero(np.diff(y // 4 * width + x // 4)) == -(-width // 4) * -(-height // 4) - 1


def test_shadow_rays_are_cast_in_blocks_of_pixels_without_those_that_miss():
    tile = Tile(0, 0, 6, 5)
    samples = Samples(*tile.pixels(), np.zeros((60, 2)), 2)
    hit = np.delete(np.arange(60, dtype=np.int32), [3, 4, 30])
    order = ray_order(tile, samples, Hits(hit, *[hit] * 4))
    expected = [2 * pixel + each for pixel in tile.in_blocks() for each in (0, 1)]
    assert hit[order].tolist() == [sample for sample in expected if sample in hit]
    whole = np.arange(60, dtype=np.int32)
    assert ray_order(tile, samples, Hits(whole, *[whole] * 4)).tolist() == expected


def only_once(*steps):
    return Plan(None, (), None, steps, ())


def test_what_does_not_need_each_other_is_made_at_once():
    both = Barrier(2, timeout=20)
    steps = only_once(
        Node("a", lambda: 1, {}),
        Node("b", lambda a: (both.wait(), a + 1)[1], {"a": "a"}),
        Node("c", lambda a: (both.wait(), a + 2)[1], {"a": "a"}),
        Node("d", lambda b, c: b + c, {"b": "b", "c": "c"}),
    )
    tally = RenderStats()
    assert list(run_once(steps, Run(tally, threads=2)).items()) == [("a", 1), ("b", 2), ("c", 3), ("d", 5)]
    assert set(tally.seconds) == set("abcd")


def test_of_several_faults_the_plans_first_is_told():
    late, order = Event(), []

    def first():
        late.wait(20)
        order.append("first")
        raise InputError("first")

    def second():
        order.append("second")
        late.set()
        raise InputError("second")

    steps = only_once(Node("a", first, {}), Node("b", second, {}), Node("c", len, {"b": "b"}))
    with pytest.raises(InputError, match="first"):
        run_once(steps, Run(threads=2))
    assert order == ["second", "first"]


@pytest.mark.parametrize("layer", ALL)
def test_a_layer_alone_is_the_layer_among_all(picture, whole, layer):
    for name, values in picture(layer).items():
        assert values.tobytes() == whole[name].tobytes(), name


MIXED = [f"objects.{k}.shading={rate}" for k, rate in enumerate(["quadratic", "phong", "quadratic"])]


def test_rates_that_evaluate_at_samples_mix_without_permuting_them(picture):
    """On flat facets both rates are one; only a change of order could tell the pictures apart."""
    flat = [f"objects.{k}.mesh={{shape: box}}" for k in range(1, 5)]
    few = ["objects.3.shading=phong", "objects.4.shading=quadratic"]
    alike = picture(*ALL, overrides=[*flat, *few, *(f"objects.{k}.shading=phong" for k in range(3))])
    mixed = picture(*ALL, overrides=[*flat, *few, *MIXED])
    for name, values in alike.items():
        np.testing.assert_allclose(mixed[name], values, atol=1e-6, err_msg=name)


def test_names_of_users_are_names_alone(tmp_path):
    """Objects, materials, meshes and cameras may be called what buffers, layers and keys are called."""
    text = """version: 1
film: {width: 12, height: 12, samples: 2}
cameras: {CAMERA: {position: [0, 1, 4], target: [0, 0, 0]}}
meshes: {MESH: {shape: sphere}, OTHER: {shape: box}}
materials: {MATERIAL: {model: phong, exponent: 5}}
objects: [{name: OBJECT, mesh: MESH, material: MATERIAL}, {mesh: OTHER, transform: {translate: [1, 0, 0]}}]
lights: [{light: point, name: LIGHT, position: [2, 3, 4], intensity: 20}]
outputs: {layers: [beauty, lights, object_id, material_id, depth]}
"""
    words = ("CAMERA", "MESH", "OTHER", "MATERIAL", "OBJECT", "LIGHT")
    made = []
    for names in (words, ("view", "lights", "x_textures", "alpha", "beauty", "hits")):
        own = text
        for word, name in zip(words, names, strict=True):
            own = own.replace(word, name)
        (tmp_path / "s.yaml").write_text(own)
        loaded = load(tmp_path / "s.yaml")
        steps = planned(loaded)
        (band,) = bands(steps, run_once(steps, Run()), Run(threads=1))
        made.append([band.layers[layer.name] for layer in steps.outputs])
    for a, b in zip(*made, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_file_without_suffix_is_not_taken_for_a_mesh_of_that_name(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "version: 1\nmeshes: {ball: {shape: sphere}}\nobjects: [{mesh: {file: ball}}, {mesh: ball}]\n"
    )
    (tmp_path / "ball").write_text("")
    loaded = load(tmp_path / "s.yaml")
    with pytest.raises(InputError, match="ball"):
        run_once(planned(loaded), Run())


def test_layers_add_up_to_the_beauty(whole):
    lights = whole["key"] + whole["rim"] + whole["sun"]
    np.testing.assert_allclose(whole["diffuse"] + whole["specular"], lights, atol=2e-6)
    np.testing.assert_allclose(whole["emission"] + whole["ambient"] + lights, whole["beauty"], atol=2e-6)


def test_every_value_is_finite_and_light_is_not_negative(whole):
    for name, values in whole.items():
        assert np.isfinite(values).all(), name
        if name not in ("position", "normal", "geometric_normal"):
            assert (values >= 0).all(), name


def test_shares_stay_between_0_and_1_and_normals_are_unit(whole):
    for name in ("alpha", "obscurance", "shadow.key", "shadow.rim", "shadow.sun"):
        assert whole[name].max() <= 1
    for name in ("normal", "geometric_normal"):
        size = np.linalg.norm(whole[name], axis=2)
        assert np.all((size == 0) | (np.abs(size - 1) < 1e-5))


def test_ids_and_depth_are_never_mixed(whole):
    assert set(np.unique(whole["object_id"])) <= {0, 1, 2, 3, 4, 5}
    seen = whole["depth"][whole["object_id"] > 0]
    assert seen.min() > 1
    assert (whole["depth"][whole["object_id"] == 0] == 0).all()


def test_another_seed_is_other_noise(picture, whole):
    other = picture("beauty", overrides=["seed=5"])["beauty"]
    assert not np.array_equal(other, whole["beauty"])
    np.testing.assert_allclose(other.mean(), whole["beauty"].mean(), rtol=0.05)


def test_what_a_layer_does_not_reach_is_not_run(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(SCENE)
    loaded = load(path)
    p = planned(loaded, ["depth"])
    made = {step.output for step in (*p.once, *p.tile)}
    assert not made & {"corner_normals", "points", "shadow:key", "obscurance", "incident:key", "uvs"}
    assert why_not(p.graph, p.outputs)["shadow:sun"] == "the light casts no shadows"
    assert expected_rays(p.graph.scene, [p.view], p.computed) == {"primary": 83 * 61 * 3}


def test_a_dark_light_a_black_ambient_and_no_obscurance_cost_nothing(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(SCENE)
    loaded = load(path, ["lights.key.intensity=0", "ambient=0", "obscurance=null"])
    p = planned(loaded)
    made = {step.output for step in p.tile}
    assert not made & {"incident:key", "shadow:key", "obscurance", "ambient"}
    assert why_not(p.graph, p.outputs)["shadow:key"] == "the light's intensity is 0"
    assert "incident:rim" in made


@pytest.mark.parametrize(
    ("scene", "overrides", "value"),
    [
        ("textbook-halfway", [], 8.764768000724656),
        ("textbook-halfway", ["camera.position=[-5,5,0]"], 12.045584412271571),
        ("textbook-constant", [], 5.9),
        ("textbook-gouraud", [], 5.151756813226966),
        ("textbook-phong", [], 11.790820242271207),
    ],
)
def test_worked_examples_of_the_texts(root, scene, overrides, value):
    loaded = load(root / "scenes" / f"{scene}.yaml", overrides)
    beauty = layers_of(planned(loaded))["beauty"]
    centre = beauty[beauty.shape[0] // 2, beauty.shape[1] // 2]
    np.testing.assert_allclose(centre, value, rtol=1e-6)


def test_coupled_ambient_is_the_texts_printed_form(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(
        """
version: 1
camera: {projection: orthographic, position: [0, 5, 0], target: [0, 0, 0], extent: 1}
film: {width: 4, height: 4, samples: 1}
ambient: {form: coupled, color: 0.5}
materials: {m: {model: blinn_phong, diffuse: 0.4, ambient: 0.3, specular: 0}}
objects: [{mesh: {shape: plane}, material: m}]
lights: [{light: directional, direction: [0, -1, 0], irradiance: 2}]
"""
    )
    loaded = load(path)
    steps = planned(loaded)
    tally = RenderStats()
    (band,) = bands(steps, run_once(steps, Run(tally)), Run(tally, threads=1))
    np.testing.assert_allclose(band.layers["beauty"], 0.3 * 0.5 + 0.4 * 2 + 2, rtol=1e-6)


def test_w_is_taken_about_the_normal_that_each_rate_interpolates(picture):
    def w(*overrides):
        return picture("obscurance", overrides=("film.samples=1", "objects.1.shading=phong", *overrides))[
            "obscurance"
        ]

    geometric = w("obscurance.about=geometric")
    flat = [f"objects.{k}.shading=constant" for k in range(5)]
    assert np.array_equal(w(*flat), geometric)
    gouraud, phong = (w(*(f"objects.{k}.shading={rate}" for k in range(5))) for rate in ("gouraud", "phong"))
    assert np.array_equal(gouraud, phong)
    assert not np.array_equal(phong, geometric)


def test_the_plan_says_that_w_is_taken_about_geometric_normals(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    loaded = load(path, ("obscurance.about=geometric",))
    p = planned(loaded, ["obscurance"])
    why = why_not(p.graph, p.outputs)["obscurance_normals"]
    assert why == "obscurance rays are cast about the polygons' normals"


def test_a_coarse_smooth_ball_alone_is_open_exactly(picture):
    away = [f"objects.{k}.transform.translate=[{20 * k}, 0.5, 0]" for k in (2, 3, 4)]
    overrides = ("objects.0.mesh.size=[1e-3, 1e-3]", "camera.target=[0, 0.5, 0]", "camera.fov=15", *away)
    layers = picture("obscurance", "alpha", overrides=("obscurance.falloff.max_distance=0.4", *overrides))
    assert (layers["alpha"] > 0).mean() > 0.5
    assert np.array_equal(layers["obscurance"], layers["alpha"])

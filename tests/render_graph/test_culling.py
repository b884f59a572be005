"""Objects that cannot affect any view are culled, and no value of any picture changes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from illumcli.cache import policy
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.commands.sweep import sweep_scene
from illumcli.geometry.bounds import object_bounds
from illumcli.geometry.mesh import Mesh
from illumcli.images.reader import read_image
from illumcli.layers import NAMES
from illumcli.render_graph.build import build
from illumcli.render_graph.culling import why_all
from illumcli.render_graph.execute import Run, run_once
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load
from illumcli.scene.variants import Variant, variants_of
from illumcli.visibility.culling import (
    GROUPED_BOXES,
    LARGE_BOXES,
    Boxes,
    clip_boxes,
    frustum,
    merge_boxes,
    outside_frustum,
    separated,
)
from planned import layers_of

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 48, height: 36, samples: 2}
ambient: 0.3
obscurance: {samples: 4, falloff: {falloff: smooth, max_distance: 0.7}}
materials: {red: {model: phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20}}
meshes: {ball: {shape: sphere, radius: 0.4, segments: 24, rings: 12}}
objects:
  - {name: floor, mesh: {shape: plane, size: [3, 3]}, material: red}
  - {name: ball, mesh: ball, material: red, transform: {translate: [0, 0.5, 0]}}
  - {name: caster, mesh: ball, material: red, transform: {translate: [1, 2.2, 1]}}
  - {name: away, mesh: ball, material: red, transform: {translate: [6, 0.5, 3]}}
  - {name: behind, mesh: {shape: torus}, material: red, transform: {translate: [3, 0.5, 9]}}
lights: [{light: point, name: key, position: [2, 4, 2], intensity: 20}]
"""
ALL = [name for name in NAMES if name not in ("triangle_id", "error")]


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def pictures(path, overrides=(), only=ALL, leave_out=True, store=None):
    """Layers of every view, the names left out, and the triangles that were traced."""
    loaded = load(path, overrides)
    outputs = outputs_of(loaded.scene, only)
    graph, run = build(loaded.scene, loaded), Run(cache=Cache(store))
    graph = place_and_cull(graph, outputs, run) if leave_out else graph
    out = {}
    for view in graph.views:
        plan = plan_view(graph, outputs, view, run.cache)
        shared = run_once(plan, run)
        layers = layers_of(plan, run, shared=shared)
        out |= {(view.name, name): values for name, values in layers.items()}
    names = loaded.scene.object_names()
    triangles = len(shared["geometry"].triangles) if "geometry" in shared else None
    return out, [names[number] for number in graph.culled], triangles


def same(a, b):
    assert a.keys() == b.keys()
    for name, values in a.items():
        assert values.tobytes() == b[name].tobytes(), name


def test_what_is_behind_or_beside_every_view_is_left_out(scene):
    few, left_out, triangles = pictures(scene)
    many, none, all_triangles = pictures(scene, leave_out=False)
    same(few, many)
    assert left_out == ["away", "behind"]
    assert none == []
    assert triangles < all_triangles / 4


@pytest.mark.parametrize(
    ("change", "left_out"),
    [
        ("lights.key.shadows=false", ["caster", "away", "behind"]),
        ("lights.key.intensity=0", ["caster", "away", "behind"]),
        ("lights.key.position=[12,1,6]", ["caster", "behind"]),  # `away` now stands in its way
        ("lights.key={light: directional, direction: [-2,-0.1,-1]}", ["caster", "behind"]),
        ("lights.key={light: directional, direction: [-1,-6,-0.4]}", ["away", "behind"]),
        ("obscurance.falloff.max_distance=9", []),
        ("obscurance.falloff={falloff: step}", []),
        ("ambient=0", ["away", "behind"]),
        ("camera.target=[3,0.5,9]", ["floor", "ball", "caster", "away"]),
        ("camera.fov=120", ["away", "behind"]),
    ],
)
def test_what_shadows_or_obscures_what_is_seen_is_kept(scene, change, left_out):
    few, found, _ = pictures(scene, [change])
    same(few, pictures(scene, [change], leave_out=False)[0])
    assert found == left_out


def test_a_depth_alone_needs_nothing_that_only_shadows(scene):
    assert pictures(scene, only=["depth"])[1] == ["caster", "away", "behind"]


def test_numbers_of_triangles_need_all_objects(scene):
    assert pictures(scene, only=["triangle_id"])[1] == []
    loaded = load(scene)
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, ["triangle_id"])
    assert why_all(graph, outputs).startswith("triangle_id")


def test_an_object_is_kept_that_one_of_several_views_sees(scene):
    two = "cameras={a: {position: [1.5,1.6,3], target: [0,0.4,0]}, b: {position: [5,3,9], target: [6,0.5,3]}}"
    few, left_out, _ = pictures(scene, ["camera=null", two])
    assert left_out == ["behind"]
    same(few, pictures(scene, ["camera=null", two], leave_out=False)[0])


def test_a_view_that_sees_nothing_is_black(scene):
    few, left_out, triangles = pictures(scene, ["camera.target=[1.5,9,3.1]"])
    assert (len(left_out), triangles) == (5, 0)
    assert not any(values.any() for values in few.values())
    same(few, pictures(scene, ["camera.target=[1.5,9,3.1]"], leave_out=False)[0])


def test_artifacts_of_both_kinds_live_side_by_side(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)
    store = Store(tmp_path / "kept")
    plain = pictures(scene, leave_out=False)[0]
    for leave_out in (True, False, True, False):
        same(plain, pictures(scene, leave_out=leave_out, store=store)[0])


def test_of_many_objects_those_out_of_sight_are_left_out(scene):
    field = ", ".join(
        f"{{mesh: {{shape: sphere, segments: 8, rings: 5}}, transform: {{scale: 0.1, "
        f"translate: [{x - 6.013}, 0.102, {z - 4.007}]}}}}"
        for x in range(13)
        for z in range(9)
    )
    floor = "{mesh: {shape: plane, size: [30, 30]}}"
    overrides = [f"objects=[{floor}, {field}]", "camera.fov=20"]
    few, left_out, triangles = pictures(scene, overrides)
    assert 50 < len(left_out) < 110
    assert triangles > 2
    same(few, pictures(scene, overrides, leave_out=False)[0])


def test_the_job_counts_and_names_them(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, report = render_scene(RenderJob(scene, RenderOptions(pattern="few.png", cache=False)))
    assert report.saved["polygons"] == 24 * 12 + 96 * 48
    assert {name for name in report.skipped if name.startswith("object:")} == {"object:away", "object:behind"}
    _, whole = render_scene(RenderJob(scene, RenderOptions(pattern="all.png", cache=False, strict=True)))
    assert "polygons" not in whole.saved
    assert (tmp_path / "few.png").read_bytes() == (tmp_path / "all.png").read_bytes()


def test_a_sweep_shares_what_remains(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = sweep_scene(scene, variants_of(["materials.red.exponent=3,9,27"]), RenderOptions(cache=False))
    rays = [sum(outcome.report.rays.values()) for outcome in done.outcomes]
    assert rays[0] > 0
    assert rays[1:] == [0, 0]


def test_a_moving_camera_shares_the_geometry_of_what_any_variant_saw(scene, tmp_path, monkeypatch):
    """The eye turns from one ball to another and back: each is triangulated once it is seen, and stays."""
    monkeypatch.chdir(tmp_path)
    targets = "[0, 0.4, 0]", "[6, 0.5, 3]", "[0, 0.4, 0]", "[6, 0.5, 3]"
    options = RenderOptions(pattern="{film.exposure}.exr", cache=False)
    rows = [{"camera.target": target, "film.exposure": str(k)} for k, target in enumerate(targets)]
    done = sweep_scene(scene, [Variant(row) for row in rows], options)
    reused = [
        {"geometry", "tracer"} <= next(iter(outcome.report.reused.values())).keys()
        for outcome in done.outcomes
    ]
    assert reused == [False, False, True, True]
    for row in rows:
        overrides = tuple(f"{path}={value}" for path, value in row.items())
        single = RenderOptions(overrides, pattern="single.exr", cache=False, force=True)
        render_scene(RenderJob(scene, single))
        swept = read_image(tmp_path / f"{row['film.exposure']}.exr").channels
        for name, values in read_image(tmp_path / "single.exr").channels.items():
            np.testing.assert_array_equal(values, swept[name])


def test_the_plan_tells_them_once_their_boxes_are_known(scene, tmp_path, monkeypatch):
    from illumcli.commands.plan import ScenePlan

    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "kept"))
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)
    (cold,) = ScenePlan(scene).parts()
    assert "unless their bounds" in cold["objects"]
    render_scene(RenderJob(scene, RenderOptions(pattern=str(tmp_path / "a.png"))))
    (warm,) = ScenePlan(scene).parts()
    assert "object:away" in warm["skipped"]
    assert "hits" in warm["reused"]
    (every,) = ScenePlan(scene, variants_of(["obscurance.falloff={falloff: step}"])).parts()
    assert every["objects"] == "all: obscurance rays reach any distance"


# --- random scenes ------------------------------------------------------------------------------------------


def numbers(low, high):
    return st.floats(low, high, allow_nan=False).map(lambda x: round(x, 3))


def vectors(size):
    return st.tuples(*[numbers(-size, size)] * 3).map(list)


SHAPES = st.sampled_from(
    [
        {"shape": "sphere", "segments": 12, "rings": 6},
        {"shape": "box"},
        {"shape": "cone", "segments": 7},
        {"shape": "torus", "segments": 9, "sides": 5},
        {"shape": "plane", "size": [4, 3]},
    ]
)
OBJECTS = st.fixed_dictionaries(
    {
        "mesh": SHAPES,
        "transform": st.fixed_dictionaries(
            {"translate": vectors(8), "rotate": vectors(180), "scale": numbers(0.2, 1.5)}
        ),
        "shading": st.sampled_from(["phong", "phong", "gouraud", "constant", "quadratic"]),
    }
)
LIGHTS = st.one_of(
    st.fixed_dictionaries({"light": st.just("point"), "position": vectors(9), "intensity": st.just(50)}),
    st.fixed_dictionaries({"light": st.just("spot"), "position": vectors(9), "target": vectors(3).map(
        lambda v: [v[0] + 20, v[1], v[2]]), "angle": st.just(90), "intensity": st.just(50)}),
    st.fixed_dictionaries({"light": st.just("directional"), "direction": vectors(1).map(
        lambda v: [v[0], v[1], v[2] - 2])}),
)  # fmt: skip
CAMERAS = st.builds(
    lambda camera, position, turn: {**camera, "position": position, "target": [
        p + t + (2 if k == 0 else 0) for k, (p, t) in enumerate(zip(position, turn, strict=True))]},
    st.one_of(
        st.fixed_dictionaries({"fov": numbers(5, 120)}),
        st.fixed_dictionaries({"projection": st.just("orthographic"), "extent": numbers(0.5, 8)}),
    ),
    vectors(8),
    vectors(1),
)  # fmt: skip
FILTERS = st.sampled_from(
    [{"filter": "box"}, {"filter": "tent", "width": 3}, {"filter": "gaussian", "width": 4}]
)


def apart_by_a_little(objects):
    """No two surfaces in one plane: which of them is seen is up to Embree's tree."""
    for number, thing in enumerate(objects, 1):
        own = thing["transform"]
        for name, step in (("translate", (0.0123, 0.0217, 0.0319)), ("rotate", (1.23, 0.71, 0.37))):
            own[name] = [value + number * each for value, each in zip(own[name], step, strict=True)]
    return objects


SCENES = st.fixed_dictionaries(
    {
        "version": st.just(1),
        "camera": CAMERAS,
        "film": st.fixed_dictionaries(
            {
                "width": st.just(24),
                "height": st.just(16),
                "samples": st.sampled_from([1, 3]),
                "filter": FILTERS,
            }
        ),
        "ambient": st.just(0.4),
        "obscurance": st.one_of(
            st.none(),
            st.fixed_dictionaries(
                {
                    "samples": st.just(5),
                    "falloff": st.fixed_dictionaries(
                        {"falloff": st.sampled_from(["linear", "step"]), "max_distance": numbers(0.05, 3)}
                    ),
                }
            ),
        ),
        "objects": st.lists(OBJECTS, min_size=2, max_size=9).map(apart_by_a_little),
        "lights": st.lists(LIGHTS, max_size=3),
    }
)
LEFT_OUT = []
EXAMPLES = 60


@settings(max_examples=EXAMPLES, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip
@given(described=SCENES)
def test_random_scenes_keep_every_bit(tmp_path, described):
    path = tmp_path / "random.yaml"
    path.write_text(json.dumps(described))
    only = [name for name in ALL if described["obscurance"] or name != "obscurance"]
    few, left_out, _ = pictures(path, only=only)
    LEFT_OUT.append(len(left_out))
    if left_out:
        same(few, pictures(path, only=only, leave_out=False)[0])


def test_random_scenes_had_something_to_leave_out():
    assert not LEFT_OUT or np.mean(np.array(LEFT_OUT) > 0) > 0.3


# --- the planes ---------------------------------------------------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_boxes_told_apart_are_farther_than_the_gap(seed):
    random = np.random.default_rng(seed)
    points = random.normal(size=(7, 3))
    low = random.normal(size=(20, 3)) * 2
    high = low + random.uniform(0, 1, (20, 3))
    gap = random.uniform(0, 1)
    told = separated(points, Boxes(low, high), gap)
    weights = random.dirichlet(np.full(7, 0.3), 400)
    inside = weights @ points
    way = np.maximum(np.maximum(low[:, None] - inside, inside - high[:, None]), 0)
    distance = np.linalg.norm(way, axis=2).min(axis=1)
    assert (distance[told] > gap).all()
    assert told[distance > gap + 1.5].all()


@pytest.mark.parametrize("count", [1, LARGE_BOXES + GROUPED_BOXES, LARGE_BOXES + GROUPED_BOXES + 1, 700])
def test_fewer_boxes_hold_all_of_many(count):
    random = np.random.default_rng(count)
    low = random.normal(size=(count, 3))
    high = low + random.exponential(0.1, (count, 3))
    lower, higher = merge_boxes(Boxes(low, high))
    assert len(lower) <= LARGE_BOXES + GROUPED_BOXES
    inside = (lower[None] <= low[:, None]).all(axis=2) & (high[:, None] <= higher[None]).all(axis=2)
    assert inside.any(axis=1).all()


def test_what_a_box_and_a_frustum_share_holds_all_points_in_both(scene):
    loaded = load(scene)
    mesh = Mesh.of_triangles([[-1, -1, -1], [1, 1, 1], [1, -1, 0]], [[0, 1, 2]])
    frame = object_bounds([mesh], [np.eye(4)]).render_space
    planes = frustum(loaded.scene.camera, frame, 40, 30, None)
    low, high = np.array([[-0.3, -0.4, -0.6]]), np.array([[0.6, 0.5, 0.2]])
    corners = clip_boxes(planes, Boxes(low, high))
    random = np.random.default_rng(0)
    points = random.uniform(low[0], high[0], (4000, 3))
    both = points[(points @ planes[0].T <= planes[1]).all(axis=1)]
    assert 0 < len(both) < 4000
    for direction in random.normal(size=(50, 3)):
        assert (both @ direction).max() <= (corners @ direction).max() + 1e-9
    assert not outside_frustum(planes, Boxes(low, high)).any()
    assert outside_frustum(planes, Boxes(low + 100, high + 100)).all()

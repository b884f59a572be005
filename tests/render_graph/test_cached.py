"""Cached buffers: the same bits with and without them, and no cached buffer is computed again."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from illumcli.cache import policy
from illumcli.cache.codec import decode, encode
from illumcli.cache.memory import MemoryCache, arrays_in
from illumcli.cache.recorder import NO_CACHE, Cache
from illumcli.cache.store import Store
from illumcli.render_graph.build import build
from illumcli.render_graph.cached import Lookup, substitute_cached
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.render_graph.keys import Keys, content_key
from illumcli.render_graph.known import with_known
from illumcli.render_graph.pipeline import plan_view
from illumcli.render_graph.schedule import outputs_of, shared_keys
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 43, height: 31, samples: 3, filter: {filter: tent, width: 2}}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 7, falloff: {falloff: linear, max_distance: 1}}
meshes:
  ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}
  wedge: {file: wedge.obj}
materials:
  red: {model: phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20, emission: 0.05}
  grey: {model: lambert, diffuse: 0.7}
  steel: {model: ward, diffuse: 0.1, specular: 0.3}
objects:
  - {name: floor, mesh: {shape: plane, size: [6, 6]}, material: grey}
  - {name: ball, mesh: ball, material: red, transform: {translate: [0, 0.5, 0]}}
  - {name: cup, mesh: ball, material: steel, transform: {translate: [1, 0.5, 0]}}
  - {name: wedge, mesh: wedge, transform: {translate: [-1, 0.2, 0]}}
lights:
  - {light: point, name: key, position: [2, 3, 2], intensity: [9, 8, 7]}
  - {light: spot, name: rim, position: [-2, 3, -1], target: [0, 0, 0], angle: 40, intensity: 20}
  - {light: directional, name: sun, direction: [1, -2, -1], irradiance: 0.3, shadows: false}
"""
WEDGE = (
    "mtllib wedge.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
)
ALL = [
    "beauty", "ambient", "diffuse", "specular", "emission", "lights", "shadows", "obscurance", "alpha",
    "depth", "position", "normal", "geometric_normal", "uv", "object_id", "material_id", "triangle_id",
]  # fmt: skip
CHANGES = [
    "materials.red.diffuse=[0.1,0.2,0.9]", "materials.red.specular=0", "materials.red.exponent=3",
    "materials.steel={model: cook_torrance}", "materials.grey.emission=0.2", "materials.red.ambient=0",
    "ambient=0", "ambient={form: coupled, color: 0.4}", "obscurance=null", "obscurance.samples=5",
    "obscurance.falloff={falloff: step}", "obscurance.falloff.max_distance=0.4", "seed=9",
    "film.samples=1", "film.width=29", "film.height=17", "film.filter={filter: box}", "film.background=0.4",
    "camera.position=[1,2,3]", "camera.fov=31", "camera.target=[0,0.3,0.1]",
    "camera={projection: orthographic, position: [1,2,3], target: [0,0.4,0]}",
    "lights.key.position=[1,3,2]", "lights.key.intensity=3", "lights.key.shadows=false",
    "lights.key.intensity=0", "lights.key.attenuation={law: none}",
    "lights.rim.angle=20", "lights.rim.target=[1,0,0]", "lights.sun.direction=[-1,-2,0]",
    "lights.sun.shadows=true", "lights.sun.name=moon", "shading=gouraud", "shading=constant",
    "objects.ball.shading=quadratic", "objects.ball.transform.translate=[0,0.6,0]", "objects.cup.mesh=wedge",
    "objects.cup.material=red", "objects.wedge.material=steel", "objects.cup.override={specular: 0.9}",
    "objects.cup.grain=[0,1,0]", "meshes.ball.segments=12", "meshes.ball.radius=0.4",
    "meshes.wedge.normals.crease=10", "meshes.wedge.materials=true",
]  # fmt: skip


@pytest.fixture(autouse=True)
def _keep_everything(monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "wedge.obj").write_text(WEDGE)
    (tmp_path / "wedge.mtl").write_text("newmtl red\nKd 0.2 0.9 0.2\n")
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "kept")


def picture(path, *overrides, store=None, memory=None, only=ALL, threads=1, side=None):
    """Layers, what was made, rays, what was reused."""
    loaded = load(path, overrides)
    run = Run(RenderStats(), Cache(store, memory), threads)
    plan = planned(loaded, only, run.cache)
    layers = layers_of(plan, run, side)
    return layers, plan.computed, dict(run.stats.rays), plan.lookup.reused


def shared(first, second):
    """Keys of what the second scene reads of the first."""
    graphs = [build(each.scene, each) for each in (first, second)]
    return shared_keys(*graphs, outputs_of(second.scene, ALL))


def same(a, b):
    assert a.keys() == b.keys()
    for name, values in a.items():
        assert values.tobytes() == b[name].tobytes(), name


def test_a_second_run_makes_neither_meshes_nor_rays_and_the_same_bits(scene, store):
    cold = picture(scene)
    same(cold[0], picture(scene, store=store)[0])
    for threads, side in ((1, None), (2, 8), (3, 31), (2, 5)):
        again, made, rays, reused = picture(scene, store=store, threads=threads, side=side)
        same(cold[0], again)
        assert rays == {}
        assert not made & {"meshes", "tracer", "hits", "obscurance", "shadow:key", "shadow:rim"}
        assert not made & {"incident:key", "incident:rim"}  # the lit points are known by their shadows
        assert "geometry" in reused


@pytest.mark.parametrize("change", CHANGES)
def test_no_change_finds_what_is_not_its_own(scene, tmp_path, change, store):
    picture(scene, store=store)
    same(picture(scene, change)[0], picture(scene, change, store=store)[0])
    same(picture(scene)[0], picture(scene, store=store)[0])


@pytest.mark.parametrize("change", CHANGES)
def test_variants_share_memory_and_keep_their_bits(scene, change):
    memory = MemoryCache(shared(load(scene), load(scene, [change])))
    picture(scene, memory=memory)
    same(picture(scene, change)[0], picture(scene, change, memory=memory)[0])


@pytest.mark.parametrize(
    "change",
    [
        "materials.red.diffuse=[0.1,0.2,0.9]", "materials.steel={model: cook_torrance}", "ambient=0.7",
        "lights.key.intensity=[1,2,3]", "lights.sun.irradiance=2", "film.exposure=2", "film.background=0.5",
    ],
)  # fmt: skip
def test_a_change_of_material_or_light_colour_takes_no_ray_no_mesh_no_tree(scene, store, change):
    picture(scene, store=store, only=["beauty"])
    _, made, rays, _ = picture(scene, change, store=store, only=["beauty"])
    assert rays == {}
    assert not made & {
        "tracer",
        "meshes",
        "mesh:ball",
        "mesh:wedge.obj",
        "geometry",
        "corner_normals",
        "hits",
    }


def test_a_moved_light_casts_its_own_shadow_rays_alone(scene, store):
    picture(scene, store=store, only=["beauty"])
    _, made, rays, _ = picture(scene, "lights.key.position=[1,3,2]", store=store, only=["beauty"])
    assert rays.keys() == {"shadow:key"}
    assert not made & {"hits", "obscurance", "meshes", "mesh:wedge.obj", "shadow:rim"}


def test_a_moved_eye_parses_no_mesh(scene, store):
    picture(scene, store=store, only=["beauty"])
    _, made, rays, _ = picture(scene, "camera.position=[1,2,3]", store=store, only=["beauty"])
    assert rays.keys() == {"hits", "obscurance", "shadow:key", "shadow:rim"}
    assert not made & {"meshes", "mesh:ball", "mesh:wedge.obj", "geometry", "corner_normals"}


def test_a_changed_byte_of_a_mesh_spoils_what_is_made_of_it_alone(scene, store):
    picture(scene, store=store)
    mesh = scene.parent / "wedge.obj"
    mesh.write_text(WEDGE.replace("v 0 0 1\n", "v 0 0 2\n"))
    cold = picture(scene)[0]
    warm, made, _, reused = picture(scene, store=store)
    same(cold, warm)
    assert {"mesh:wedge.obj", "geometry", "tracer", "hits", "corner_normals"} <= made
    assert "mesh:ball" in reused
    mesh.write_text(WEDGE)
    assert picture(scene, store=store)[2] == {}


def test_a_changed_library_beside_a_mesh_is_another_mesh(scene, store):
    picture(scene, "meshes.wedge.materials=true", store=store)
    (scene.parent / "wedge.mtl").write_text("newmtl red\nKd 0.9 0.1 0.9\n")
    override = ["meshes.wedge.materials=true", "materials={grey: {model: lambert}, steel: {model: lambert}}"]
    text = SCENE.replace("material: red", "material: grey")
    scene.write_text(text)
    same(picture(scene, *override)[0], picture(scene, *override, store=store)[0])


def test_a_mesh_that_changes_while_it_is_read_is_refused(scene, store, monkeypatch):
    from illumcli import mesh_files as readers
    from illumcli.errors import InputError

    own = readers.read_mesh

    def slow(path):
        made = own(path)
        path.write_text(WEDGE + "# later\n")
        return made

    monkeypatch.setattr(readers, "read_mesh", slow)
    with pytest.raises(InputError, match="changed while it was read"):
        picture(scene, store=store)


def test_names_and_places_of_files_do_not_matter(scene, store, tmp_path):
    picture(scene, store=store)
    other = tmp_path / "other"
    other.mkdir()
    (other / "renamed.obj").write_text(WEDGE)
    (other / "wedge.mtl").write_text((scene.parent / "wedge.mtl").read_text())
    (other / "copy.yaml").write_text(
        SCENE.replace("wedge.obj", "renamed.obj").replace("name: key", "name: a")
    )
    assert picture(other / "copy.yaml", store=store)[2] == {}


def test_damage_costs_time_and_no_bit(scene, store):
    cold = picture(scene, store=store)[0]
    rng = np.random.default_rng(5)
    for _ in range(12):
        for entry in store.entries():
            data = bytearray(entry.path.read_bytes())
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            entry.path.write_bytes(data[: int(rng.integers(len(data)))] if rng.random() < 0.2 else data)
        again, made, _, _ = picture(scene, store=store)
        same(cold, again)
        assert {"tracer", "hits"} <= made
    assert picture(scene, store=store)[2] == {}


def test_an_interrupted_picture_keeps_nothing_of_its_tiles(scene, store):
    loaded = load(scene)
    run = Run(RenderStats(), Cache(store))
    plan = planned(loaded, ["beauty"], run.cache)
    rows = bands(plan, run_once(plan, run), run, side=8)
    next(rows)
    rows.close()
    assert picture(scene, store=store)[1] >= {"hits", "obscurance"}
    assert not list(store.folder.glob("*.part"))


def test_keys_are_the_same_in_every_process(scene):
    loaded = load(scene)
    graph = build(loaded.scene, loaded)
    keys = Keys(graph.nodes, graph.views[0], "salt")
    code_ = f"""
from pathlib import Path
from illumcli.render_graph.build import build
from illumcli.render_graph.keys import Keys, content_key
from illumcli.scene.load import load
loaded = load(Path({str(scene)!r}))
graph = build(loaded.scene, loaded)
keys = Keys(graph.nodes, graph.views[0], "salt")
print(*(f"{{name}}={{keys(name)}}" for name in graph.nodes), sep="\\n\\n")
"""
    done = subprocess.run([sys.executable, "-c", code_], capture_output=True, text=True, check=True)
    assert done.stdout.strip().split("\n\n") == [f"{name}={keys(name)}" for name in graph.nodes]


def test_a_file_is_known_by_its_layers_alone(scene):
    def key(layer, *overrides):
        loaded = load(scene, overrides)
        graph = build(loaded.scene, loaded)
        return content_key(graph.nodes, graph.views[0], [layer])

    assert key("depth") == key("depth", "materials.red.diffuse=0.3", "ambient=0", "lights.key.intensity=1")
    assert key("depth") != key("depth", "camera.fov=41")
    assert key("beauty") != key("beauty", "materials.red.diffuse=0.3")


def test_what_costs_more_than_it_saves_is_not_kept(scene, store, monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: size > 1000 and seconds > 1e-9)
    picture(scene, store=store)
    assert {entry.bytes > 1000 for entry in store.entries()} == {True}
    monkeypatch.undo()
    assert not policy.worth(0.0005, 0)
    assert policy.worth(0.5, 10_000_000)
    assert not policy.worth(0.5, 1_000_000_000)


def test_memory_gives_up_what_does_not_fit(scene):
    loaded = load(scene, ["materials.red.diffuse=0.5"])
    first = load(scene)
    memory = MemoryCache(shared(first, loaded), limit=20_000)
    picture(scene, memory=memory)
    same(
        picture(scene, "materials.red.diffuse=0.5")[0],
        picture(scene, "materials.red.diffuse=0.5", memory=memory)[0],
    )
    memory.wanted = frozenset()
    memory.retire()
    assert memory.once == {}


def test_buffers_come_back_as_they_were(scene):
    loaded = load(scene)
    made = planned(loaded, ["beauty"])
    geometry = run_once(made, Run())["geometry"]
    arrays = []
    said = encode(geometry, arrays, {})
    assert sum(array.nbytes for array in arrays) < 1.05 * sum(
        {id(array): array.nbytes for array in arrays_in(geometry)}.values()
    ) + sum(a.nbytes for placed in geometry.placed for a in arrays_in(placed))
    again = decode(said, tuple(arrays))
    assert again.render_space == geometry.render_space
    assert again.placed_mesh[1] == again.placed_mesh[2]
    np.testing.assert_array_equal(again.instances.matrix, geometry.instances.matrix)
    for name in ("vertices", "triangles", "corners", "polygons", "objects"):
        a, b = getattr(geometry, name), getattr(again, name)
        np.testing.assert_array_equal(a, b)
        assert a.flags.f_contiguous == b.flags.f_contiguous


def test_what_is_no_buffer_is_a_programming_error():
    with pytest.raises(TypeError, match="object is not stored"):
        encode(object(), [], {})


def test_a_look_reads_nothing_and_finds_what_is_there(scene, store):
    loaded = load(scene)
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, ["beauty"])

    def look():
        return plan_view(graph, outputs, graph.views[0], Cache(store), look=True).lookup.reused

    assert look() == {}
    picture(scene, store=store, only=["beauty"])
    for entry in store.entries():
        entry.path.write_bytes(b"")
    assert {"hits", "geometry"} <= look().keys()


def test_buffers_of_another_rate_are_not_kept(scene, store):
    """Their elements are vertices or polygons, not samples."""
    picture(scene, "shading=gouraud", store=store, only=["beauty"])
    _, made, _, reused = picture(scene, "shading=gouraud", store=store, only=["beauty"])
    assert "hits" in reused
    assert "points" in made


def test_what_this_run_made_is_loaded_from_nowhere(scene):
    loaded = load(scene)
    graph = with_known(build(loaded.scene, loaded), "object_bounds", Run())
    cached, lookup = substitute_cached(graph, ["object_bounds"], graph.views[0], NO_CACHE)
    assert [node.output for node in cached.topological_order(["object_bounds"])] == ["object_bounds"]
    assert cached.loaders["object_bounds"].run({}) is graph.known["object_bounds"].value
    assert lookup == Lookup()
    assert cached.without_loaders() == graph


def test_a_store_too_small_for_a_buffer_keeps_none_of_it(scene, store):
    store.limit = 4 * 3000
    cold = picture(scene)[0]
    same(cold, picture(scene, store=store)[0])
    again, made, _, _ = picture(scene, store=store)
    same(cold, again)
    assert "hits" in made
    assert all(entry.bytes <= 3000 + 1024 for entry in store.entries())

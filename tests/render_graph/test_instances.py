"""Pictures of objects that share a mesh: the same by any way, and close to those of copies."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeSettings
from illumcli.cache.store import Store
from illumcli.compiled import SWITCH
from illumcli.rays.embree_library import embree_library
from illumcli.render_graph import build_geometry
from metamorphic.pictures import close, pictures, same

pytestmark = pytest.mark.skipif(embree_library() is None, reason="embreex without its library")

SCENE = """
version: 1
film: {width: 64, height: 40, samples: 2}
camera: {position: [0, 1.5, 5], target: [0, 0.4, 0], fov: 40}
ambient: 0.4
obscurance: {samples: 12, falloff: {falloff: linear, max_distance: 1}}
meshes: {body: MESH}
materials: {clay: {model: phong}}
objects:
- {name: floor, mesh: {shape: plane}, transform: {scale: 8}}
- {name: own, mesh: {shape: cone}, transform: {translate: [0, 0, -1]}}
- {name: one, mesh: body, material: clay, transform: {translate: [-1.2, 0.5, 0]}}
- {name: two, mesh: body, transform: {translate: [0, 0.5, 0.6], rotate: [20, 70, 5], scale: [1, 0.6, 1.3]}}
- {name: turned, mesh: body, transform: {translate: [1.2, 0.5, 0], rotate: [0, 30, 0], scale: [-1, 1, 1]}}
- {name: again, mesh: body, transform: {translate: [0.6, 1.4, -0.7], scale: [0.7, 0.7, -0.7]}}
- {name: away, mesh: body, transform: {translate: [40, 0, 0]}}
- {name: long, mesh: body, transform: {translate: [-0.6, 0.3, 1.2], scale: [2, 0.3, 0.3]}}
lights: [{light: point, position: [3, 4, 4], intensity: 40}]
"""
LAYERS = ("beauty", "obscurance", "normal", "geometric_normal", "uv", "object_id", "depth", "shadows")
MESHES = {"smooth": "{shape: torus}", "polygons": "{shape: box}"}


@pytest.fixture(params=MESHES)
def path(request, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("MESH", MESHES[request.param]))
    return path


@pytest.fixture(params=["phong", "constant", "gouraud", "quadratic"])
def rate(request):
    return (f"shading={request.param}",)


def test_pictures_are_the_same_by_any_way(path, rate, tmp_path, monkeypatch):
    made = pictures(path, rate, LAYERS)
    same(made, pictures(path, rate, LAYERS, threads=2, side=17))
    store = Store(tmp_path / "kept")
    for _ in range(2):
        same(made, pictures(path, rate, LAYERS, store=store))
    with monkeypatch.context() as patch:
        patch.setattr("illumcli.render_graph.culling.unaffecting", lambda *_: ())
        same(made, pictures(path, rate, LAYERS))
    monkeypatch.setenv(SWITCH, "0")
    same(made, pictures(path, rate, LAYERS))


def test_the_shading_rate_of_an_object_changes_no_hit(path):
    layers = ("object_id", "depth", "geometric_normal", "uv")
    same(pictures(path, (), layers), pictures(path, ("objects.two.shading=constant",), layers))


@pytest.mark.parametrize("faces", ["count", "ignore", "one_sided"])
def test_pictures_are_close_to_those_of_copies(path, rate, faces, monkeypatch):
    layers = tuple(name for name in LAYERS if name not in ("beauty", "obscurance"))
    overrides = (*rate, "film.samples=1", f"obscurance.faces={faces}")
    made, w = pictures(path, overrides, (*layers, "triangle_id")), pictures(path, overrides, ("obscurance",))
    monkeypatch.setattr(build_geometry, "embree_library", lambda: None)
    close(made, pictures(path, overrides, (*layers, "triangle_id")), share=1e-4, outliers=3)
    # Single rays meet something else.
    copies = pictures(path, overrides, ("obscurance",))
    for key, values in w.items():
        assert np.abs(values - copies[key]).mean() < 2e-4


def test_baked_values_are_those_of_the_mesh_on_every_copy(tmp_path, monkeypatch):
    mesh = tmp_path / "body.obj"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.3\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 1 4 3 2\n"
    )
    bake_mesh(mesh, [tmp_path / "body.npz"], BakeSettings(samples=32))
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("MESH", "{file: body.obj, obscurance: body.npz}"))
    made = pictures(path, (), ("obscurance", "object_id"))
    monkeypatch.setattr(build_geometry, "embree_library", lambda: None)
    copies = pictures(path, (), ("obscurance", "object_id"))
    baked = {view: made[view, "object_id"][..., 0] > 2 for view, _ in made}
    close(made, copies, where=baked, share=1e-5, outliers=3)

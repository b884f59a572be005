"""Pictures of polygons: the same however these are cut into triangles, and whichever way they run."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.scene.load import load
from illumcli.shading.rates import RATES
from planned import layers_of, planned

SCENE = """
version: 1
camera: {{position: [2, 4, 5], target: [0, 0, 0], fov: 40}}
film: {{width: 61, height: 47, samples: 2}}
ambient: 0.2
shading: {rate}
materials:
  own: {{model: blinn_phong, diffuse: {{vertex: color}}, specular: 0.4, exponent: 12}}
objects:
  - {{mesh: {{file: a.ply}}, material: own}}
lights:
  - {{light: point, name: lamp, position: [1, 2, 1], intensity: 6}}
  - {{light: directional, name: sun, direction: [1, -2, -1], irradiance: 0.5}}
"""


def picture(folder, mesh, rate, *layers):
    """Layers of a mesh, given as the text of a PLY file."""
    (folder / "a.ply").write_text(mesh)
    (folder / "scene.yaml").write_text(SCENE.format(rate=rate))
    return layers_of(planned(load(folder / "scene.yaml"), layers))


def ply(vertices, colors, normals, faces):
    rows = [
        " ".join(f"{x:.9g}" for x in (*vertex, *normal, *color))
        for vertex, normal, color in zip(vertices, normals, colors, strict=True)
    ]
    names = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue")
    head = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return "\n".join([*head, *rows, *(f"{len(face)} {' '.join(map(str, face))}" for face in faces)]) + "\n"


def flat_shapes(seed=1):
    """A square, a hexagon, an L and an arrow in planes of their own; normals lean anywhere on their side."""
    random = np.random.default_rng(seed)
    ring = np.arange(6) * np.pi / 3
    shapes = [
        [[-1, -1], [1, -1], [1, 1], [-1, 1]],
        np.stack([1.2 * np.cos(ring), np.sin(ring)], axis=1),
        [[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1]],
        [[-1, 0], [0, -1.2], [1, 0], [0, -0.4]],
    ]
    vertices, faces = [], []
    for number, (shape, place) in enumerate(zip(shapes, [[-1, -1], [1, -1], [-1, 1], [1, 1]], strict=True)):
        x, z = (0.9 * np.asarray(shape, float) + np.multiply(place, 1.1)).T
        faces.append(list(range(len(vertices), len(vertices) + len(x))))
        vertices += np.stack([x, 0.2 * x - 0.1 * number * z, -z], axis=1).tolist()
    lean = np.stack([random.uniform(-0.6, 0.6, len(vertices)) for _ in range(2)], axis=1)
    normals = np.insert(lean, 1, 1, axis=1)
    return np.array(vertices), random.uniform(0.1, 0.9, (len(vertices), 3)), normals, faces


@pytest.mark.parametrize("rate", RATES)
def test_a_polygon_that_begins_at_another_corner_looks_the_same(tmp_path, rate):
    vertices, colors, normals, faces = flat_shapes()
    layers = ("beauty", "normal", "ambient")
    before = picture(tmp_path, ply(vertices, colors, normals, faces), rate, *layers)
    for turn in (1, 2, 3):
        turned = [face[turn:] + face[:turn] for face in faces]
        after = picture(tmp_path, ply(vertices, colors, normals, turned), rate, *layers)
        for name in layers:
            apart = np.abs(after[name] - before[name]).max(axis=-1)
            assert np.count_nonzero(apart > 3e-4) <= 4, name  # pixels of which an edge takes a sample


@pytest.mark.parametrize("rate", RATES)
def test_faces_against_their_normals_are_lit_as_those_about_them(tmp_path, rate):
    vertices, colors, normals, faces = flat_shapes()
    layers = ("beauty", "normal", "geometric_normal")
    before = picture(tmp_path, ply(vertices, colors, normals, faces), rate, *layers)
    turned = [face[::-1] for face in faces]
    after = picture(tmp_path, ply(vertices, colors, normals, turned), rate, *layers)
    for name in layers:
        apart = np.abs(after[name] - before[name]).max(axis=-1)
        assert np.count_nonzero(apart > 3e-4) <= 4, name
    assert before["beauty"].max() > 0.5


def test_a_planar_polygon_has_one_geometric_normal(tmp_path):
    """A square folded a little, as the digits of a file may leave it."""
    square = np.array([[-1, 0, 1], [1, 0.002, 1], [1, 0, -1], [-1, 0, -1]])
    text = ply(square, np.full((4, 3), 0.5), np.tile([0.1, 1, 0], (4, 1)), [[0, 1, 2, 3]])
    ng = picture(tmp_path, text, "phong", "geometric_normal")["geometric_normal"]
    seen = np.linalg.norm(ng, axis=-1) > 0.99
    a, b = square[2] - square[0], square[3] - square[1]
    wanted = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    np.testing.assert_allclose(ng[seen], np.tile(wanted, (np.count_nonzero(seen), 1)), atol=1e-6)


def test_the_winding_alone_says_where_computed_normals_point(tmp_path):
    vertices, colors, normals, faces = flat_shapes()
    text = ply(vertices, colors, normals, [face[::-1] for face in faces])
    (tmp_path / "a.ply").write_text(text)
    scene = SCENE.format(rate="phong").replace("file: a.ply", "file: a.ply, normals: {source: computed}")
    (tmp_path / "scene.yaml").write_text(scene)
    layers = layers_of(planned(load(tmp_path / "scene.yaml"), ("normal", "geometric_normal")))
    n, ng = layers["normal"], layers["geometric_normal"]
    seen = np.linalg.norm(ng, axis=-1) > 0.99
    np.testing.assert_allclose(n[seen], ng[seen], atol=1e-5)
    seen_from_above = n[seen][:, 1] > 0
    assert seen_from_above.all()

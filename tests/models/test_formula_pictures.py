"""Pictures of formulas equal those of the models of the package: textures, vertex colours and curves."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio

import illumcli

FORMULAS = """
  left: {model: formula, parameters: {kd: {texture: t.png}}, response: n_l * kd / pi}
  right:
    model: formula
    parameters: {kd: {vertex: color}, ks: 0.3, m: {curve: linear, keys: {0: 5, 1: 50}}}
    response: n_l * kd
    specular: ks * max(0, 1 - gap_rv)**m
"""
KNOWN = """
  left: {model: lambert, diffuse: {texture: t.png}}
  right:
    model: phong
    diffuse: {vertex: color}
    specular: 0.3
    exponent: {curve: linear, keys: {0: 5, 1: 50}}
"""
SCENE = """
version: 1
camera: {{position: [0, 0, 5], target: [0, 0, 0]}}
film: {{width: 32, height: 24, samples: 4}}
frames: {{last: 1}}
meshes: {{quad: {{file: quad.obj}}}}
materials: {materials}
objects:
  - {{mesh: quad, material: left, transform: {{translate: [-1.1, 0, 0]}}}}
  - {{mesh: quad, material: right, transform: {{translate: [1.1, 0, 0]}}}}
lights: [{{light: directional, direction: [-1, -1, -2], irradiance: 3}}]
"""
QUAD = """
v -1 -1 0 1 0 0
v 1 -1 0.5 0 1 0
v 1 1 0 0 0 1
v -1 1 0.5 1 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3 4/4
"""


def test_parameters_of_formulas_vary_as_those_of_other_models(tmp_path):
    (tmp_path / "quad.obj").write_text(QUAD)
    texture = oiio.ImageBuf(oiio.ImageSpec(4, 4, 3, "uint8"))
    texture.set_pixels(oiio.ROI(), np.random.default_rng(1).random((4, 4, 3), np.float32))
    assert texture.write(str(tmp_path / "t.png"))
    pictures = []
    for name, materials in (("formulas", FORMULAS), ("known", KNOWN)):
        scene = tmp_path / f"{name}.yaml"
        scene.write_text(SCENE.format(materials=materials))
        pictures.append([each["beauty"] for each in illumcli.render(scene, frames=[0, 1])])
    assert len(np.unique(pictures[0])) > 500
    assert np.abs(pictures[0][0] - pictures[0][1]).max() > 0.01  # the curve
    np.testing.assert_allclose(*pictures, rtol=1e-5, atol=1e-6)

"""Controls of scenes: one for every parameter, from the descriptions."""

from __future__ import annotations

import pytest

from illumcli.scene.load import load
from illumcli.schema.families import member
from illumcli.viewer.controls import controls

SCENE = """version: 1
camera: {position: [0, 1, 4], target: [0, 0, 0]}
film: {width: 32, height: 24}
ambient: [0.3, 0.3, 0.3]
materials:
  clay: {model: phong, diffuse: [0.5, 0.25, 0], exponent: 9}
  metal: {model: cook_torrance, distribution: {D: ggx, alpha: 0.1}}
  shaded: {model: lambert, diffuse: {vertex: color, factor: 0.5}}
objects:
  - {mesh: {shape: sphere}, material: clay, name: ball, override: {exponent: 30}}
  - {mesh: {shape: sphere}, material: {model: ward, alpha_x: 0.3}}
lights:
  - {light: point, name: key, position: [1, 2, 3], intensity: 5}
  - {light: directional, direction: [0, -1, 0]}
"""


@pytest.fixture
def scene(tmp_path):
    def loaded(*overrides, text=SCENE):
        path = tmp_path / "s.yaml"
        path.write_text(text)
        return load(path, overrides)

    return loaded


def by_path(original, now=None):
    return {each.path: each for each in controls(original, now or original)}


def test_every_parameter_of_a_material_has_one_with_range_default_and_text(scene):
    found = by_path(scene())
    for name in member("illumcli.models", "phong").model_fields:
        assert f"materials.clay.{name}" in found
    exponent = found["materials.clay.exponent"]
    assert (exponent.kind, exponent.value, exponent.default, exponent.group) == (
        "number", 9.0, 32.0, "materials.clay"
    )  # fmt: skip
    assert exponent.minimum < 9 < exponent.maximum
    assert exponent.logarithmic
    assert exponent.help.startswith("e, 0 to 10^6")


def test_kinds_follow_from_the_descriptions(scene):
    found = by_path(scene())
    kinds = {
        "materials.clay.diffuse": "color",
        "materials.clay.normalised": "switch",
        "materials.clay.model": "choice",
        "materials.metal.distribution.D": "choice",
        "materials.metal.distribution.alpha": "number",
        "materials.metal.fresnel.ior": "number",
        "materials.shaded.diffuse": "text",
        "materials.shaded.diffuse.factor": "color",
        "lights.key.position": "vector",
        "lights.1.irradiance": "color",
        "lights.key.attenuation.law": "choice",
        "objects.ball.override.exponent": "number",
        "objects.1.material.alpha_x": "number",
        "objects.ball.shading": "choice",
        "ambient.color": "color",
        "obscurance": "switch",
        "shading": "choice",
        "camera.fov": "number",
        "film.samples": "integer",
        "film.filter.filter": "choice",
        "film.adaptive": "text",
    }
    assert {path: found[path].kind for path in kinds} == kinds


def test_what_the_scene_leaves_out_has_one_too(scene):
    found = by_path(scene())
    assert found["camera.fov"].value == 35
    assert found["camera.fov"].unit == "degrees"
    assert found["materials.clay.ambient"].value is None
    assert found["materials.clay.ambient"].optional
    assert found["obscurance"].value is False
    assert "obscurance.samples" not in found
    assert by_path(scene("obscurance={}"))["obscurance.samples"].value == 64


def test_sliders_are_logarithmic_where_the_range_spans_decades(scene):
    found = by_path(scene())
    assert found["materials.metal.distribution.alpha"].logarithmic
    assert found["materials.metal.distribution.alpha"].minimum == 1e-4
    assert not found["camera.fov"].logarithmic
    assert 0 < found["camera.fov"].minimum < found["camera.fov"].maximum < 180


def test_what_differs_from_the_file_is_changed(scene):
    original, now = scene(), scene("materials.clay.exponent=80", "materials.metal={model: lambert}")
    found = by_path(original, now)
    changed = {path for path, each in found.items() if each.changed}
    assert changed == {"materials.clay.exponent", "materials.metal.model"}
    assert found["materials.clay.exponent"].original == 9
    assert not any(each.changed for each in controls(original, original))


def test_numbers_that_vary_over_the_frames_say_so(scene):
    curve = "exponent: {curve: linear, keys: {0: 5, 10: 50}}"
    text = SCENE.replace("exponent: 9", curve).replace("version: 1", "version: 1\nframes: {last: 10}")
    found = by_path(scene(text=text))
    assert "varies with the frame" in found["materials.clay.exponent"].help
    assert "varies with the frame" not in found["materials.clay.diffuse"].help


def test_a_model_of_somebody_else_gets_its_controls(scene, tmp_path, monkeypatch):
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "wool.py").write_text(WOOL)
    monkeypatch.setenv("ILLUM_MODELS", str(folder))
    found = by_path(scene("materials.metal={model: wool}"))
    assert found["materials.metal.fuzz"].value == 0.3
    assert found["materials.metal.fuzz"].maximum == 1
    assert "wool" in found["materials.metal.model"].choices


WOOL = '''"""Wool."""

from typing import Literal

from illumcli.models._base import IlluminationModel
from illumcli.schema.fields import Share


class Wool(IlluminationModel):
    model: Literal["wool"] = "wool"
    fuzz: Share = 0.3
    """How long its hairs are."""

    def diffuse_lobe(self, n_l):
        return n_l[:, None] * (self.fuzz, self.fuzz, self.fuzz)
'''

"""Faults that an override brings name the override, whatever part of the scene they show in."""

from __future__ import annotations

import pytest

from illumcli.errors import InputError
from illumcli.scene.load import load

SCENE = """version: 1
camera: {position: [0, 1, 4], target: [0, 0, 0]}
obscurance: {samples: 4, falloff: {falloff: smooth, max_distance: 3}}
materials:
  clay: {model: phong, diffuse: [0.5, 0.25, 0], specular: 0.2, exponent: 9}
objects: [{mesh: {shape: sphere}, material: clay, name: ball}]
lights:
  - {light: point, name: key, position: [1, 2, 3], intensity: 5}
  - {light: point, name: fill, position: [3, 2, 1]}
"""
LEFT = "leaves specular and exponent, which lambert does not have; replace the whole material, as "


@pytest.fixture
def faults(tmp_path):
    def found(*overrides, text=SCENE):
        path = tmp_path / "s.yaml"
        path.write_text(text)
        try:
            load(path, overrides)
        except InputError as error:
            return [line.replace(str(path), "s.yaml") for line in error.problems]
        return []

    return found


@pytest.mark.parametrize(
    ("override", "facts"),
    [
        ("materials.clay.model=phng", ["no model 'phng'; did you mean 'phong'?"]),
        (
            "materials.clay.model=lambert",
            [f"{LEFT}-D 'materials.clay={{model: lambert, diffuse: [0.5, 0.25, 0]}}'"],
        ),
        (
            "materials.clay.model=merl",
            [
                "materials.clay: missing key 'file'",
                "leaves diffuse, specular and exponent, which merl does not have; replace the whole "
                "material, as -D 'materials.clay={model: merl}'",
            ],
        ),
        (
            "lights.key.light=directional",
            [
                "lights.0: missing key 'direction'",
                "leaves position and intensity, which directional does not have; replace the whole light, as "
                "-D 'lights.key={light: directional, name: key}'",
            ],
        ),
        (
            "obscurance.falloff.falloff=step",
            [],
        ),
        ("camera.position=[0,0,0]", ["camera: position and target must differ"]),
        ("materials.clay=null", ["objects.0.material: no material 'clay'; the scene has no materials"]),
        ("lights.key.name=fill", ["lights.1.name: the name 'fill' is taken"]),
        ("cameras={a: {position: [1, 2, 3]}}", ["camera: give either camera or cameras, not both"]),
        ("materials.clay.exponent=-2", ["must be at least 0, is -2"]),
    ],
)
def test_a_fault_that_an_override_brings_names_it(faults, override, facts):
    assert faults(override) == [f"-D {override}: {fact}" for fact in facts]


def test_what_a_message_proposes_works(faults):
    (line,) = faults("materials.clay.model=lambert")
    assert faults(line.split("'")[-2]) == []


def test_faults_of_the_file_stay_the_files(faults):
    text = SCENE.replace("exponent: 9", "exponent: -9")
    assert faults("camera.position=[0,0,0]", "lights.key.name=fill", text=text) == [
        "s.yaml:5:64: materials.clay.exponent: must be at least 0, is -9",
        "-D camera.position=[0,0,0]: camera: position and target must differ",
        "-D lights.key.name=fill: lights.1.name: the name 'fill' is taken",
    ]
    assert faults("objects.0.name=b", text=text) == faults(text=text)


def test_of_several_overrides_the_one_with_which_it_comes_is_named(faults):
    assert faults("materials.clay.model=lambert", "materials.clay.model=phong") == []
    found = faults("film.width=9", "materials.clay.model=lambert", "seed=3")
    assert [line.partition(": ")[0] for line in found] == ["-D materials.clay.model=lambert"]


@pytest.mark.parametrize("model", ["fong", "phon", "blin_phong"])
def test_a_misspelt_model_hides_no_other_fault(faults, model):
    text = SCENE.replace("model: phong", f"model: {model}").replace("0.2, exp", "-0.2, expo")
    found = faults(text=text)
    assert len(found) == 3
    assert f"materials.clay.model: no model '{model}'; did you mean" in found[0]
    assert "materials.clay.specular: must be at least 0, is -0.2" in found[1]
    assert "unknown key 'expoonent'; did you mean 'exponent'?" in found[2]


def test_a_model_that_is_like_none_hides_nothing_that_no_model_takes(faults):
    nameless = SCENE.replace("model: phong", "model: xyzzy")
    assert len(faults(text=nameless)) == 1
    found = faults(text=nameless.replace("specular: 0.2", "specular: [1, x]").replace("9}", "9, some: 1}"))
    assert [line.partition(": ")[2].partition(":")[0] for line in found] == [
        "materials.clay.model", "materials.clay.specular"
    ]  # fmt: skip

"""Values without effect are reported with their places, and truly have none."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.geometry.repairs import NO_GRAIN, NORMALS_OF_FILE
from illumcli.render_graph.execute import Run, run_once
from illumcli.render_graph.repairs import repairs
from illumcli.scene.load import load
from illumcli.scene.scene_file import unused_lines
from planned import layers_of, planned

BASE = """version: 1
film: {width: 9, height: 8, samples: 2}
camera: {position: [0, 4, 5], target: [0, 0, 0]}
ambient: 0.3
objects: [{name: o, mesh: {file: m.obj}, material: {model: phong, diffuse: 0.5}}]
lights: [{light: point, position: [1, 3, 2], intensity: 9}]
outputs: {layers: [beauty]}
"""
MESH = """mtllib m.mtl
v -1 0 -1
v 1 0 -1
v 1 0.5 1
v -1 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl red
f 4/4 3/3 2/2 1/1
"""
TEXTURE = "{texture: t.png}"
PHONG = "objects.o.material={model: phong, diffuse: "
# overrides that give the scene; the key without effect, by its override; words of the line
CASES = {
    "up": (["camera.target=[0,-9,5]"], "camera.up=[0,2,0]", "camera.up: is not used, it lies along the line"),
    "width": (["camera.width=9"], "film.width=640", "film.width: is not used, every camera has its own"),
    "samples": (["camera.samples=2"], "film.samples=7", "film.samples: is not used, every camera"),
    "adaptive": (["film.samples=1"], "film.adaptive=true", "film.adaptive: is not used, no pixel has more"),
    "filter": (["film.samples=1"], "film.filter={filter: gaussian}", "film.filter: is not used, a single"),
    "rate": (["objects.o.shading=constant"], "shading=gouraud", "shading: is not used, every object has a"),
    "obscurance": (["ambient=0"], "obscurance={samples: 4}", "obscurance: is not used, there is no ambient"),
    "baked": (
        ["ambient=0"],
        "objects.o.mesh.obscurance=m.npz",
        "objects.0.mesh.obscurance: is not used, there is no ambient",
    ),
    "weights": (
        ["shading=constant"],
        "objects.o.mesh.normals.weights=area",
        "objects.0.mesh.normals.weights: is not used, the rate constant",
    ),
    "materials": (
        [],
        "objects.o.mesh.materials=true",
        "objects.0.mesh.materials: is not used, its objects have materials of their own",
    ),
    "grain": ([], "objects.o.grain=[1,0,0]", "objects.0.grain: is not used, the model phong has none"),
    "scale": (["objects.o.transform.fit=1"], "objects.o.transform.scale=3", "scale: is not used, fit says"),
    "channel": (
        [f"{PHONG}{TEXTURE}}}"],
        "objects.o.material.diffuse.channel=g",
        "objects.0.material.diffuse.channel: is not used, a colour reads r, g and b",
    ),
    "channel of an override": (
        [f"objects.o.override={{diffuse: {TEXTURE}}}"],
        "objects.o.override.diffuse.channel=g",
        "objects.0.override.diffuse.channel: is not used, a colour",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Loads the scene with overrides."""
    from illumcli.images.writer import ImageWriter

    folder = tmp_path_factory.mktemp("unused")
    (folder / "s.yaml").write_text(BASE)
    (folder / "m.obj").write_text(MESH)
    (folder / "m.mtl").write_text("newmtl red\nKd 1 0 0\n")
    with ImageWriter(folder / "t.png", 2, 2, dict.fromkeys("RGB", "uint8")) as writer:
        writer.write_band(0, np.arange(12, dtype=np.uint8).reshape(2, 2, 3) * 20)
    return lambda overrides: load(folder / "s.yaml", overrides)


def lines(loaded):
    outputs = loaded.scene.outputs
    return unused_lines(loaded, loaded.scene, outputs.layers, outputs.files)


def pixels(loaded):
    return layers_of(planned(loaded))["beauty"]


@pytest.mark.parametrize("name", CASES)
def test_a_key_without_effect_is_told_and_has_none(scene, name):
    given, key, words = CASES[name]
    without, said = scene(given), scene([*given, key])
    (line,) = set(lines(said)) - set(lines(without))
    # an override's line has of the path only what the override does not name itself
    assert line.startswith(f"-D {key}: ")
    assert words.partition(": ")[2] in line
    if name != "baked":  # what is not read need not be there
        np.testing.assert_array_equal(pixels(said), pixels(without))


@pytest.mark.parametrize(
    "overrides",
    [
        ["film.filter={filter: tent}"],
        ["film.samples=8", "film.adaptive=true"],
        ["camera.up=[0,0,-1]"],
        ["obscurance={samples: 4}"],
        ["obscurance={samples: 4}", "ambient=0", "outputs.layers=[obscurance]"],
        ["obscurance={samples: 4}", "ambient={color: 0, form: coupled}"],
        ["objects.o.mesh.normals={weights: area, crease: 30}"],
        ["objects.o.material={model: ward}", "objects.o.grain=[1,0,0]"],
        ["objects.o.transform={fit: 1, scale: [1, 2, 1]}"],
        ["objects.o.transform={fit: 1, scale: -1}"],
        [f"{PHONG}0.5, exponent: {{texture: t.png, channel: g}}}}"],
        ["outputs={colour: float, files: [a.exr, b.png]}"],
    ],
)
def test_what_has_an_effect_is_not_told(scene, overrides):
    assert lines(scene(overrides)) == []


def test_the_precision_of_exr_is_not_that_of_png(scene):
    loaded = scene(["outputs.colour=float"])
    (line,) = lines(loaded)
    assert line.startswith("-D outputs.colour=float: is not used, it is the precision of .exr")
    assert unused_lines(loaded, loaded.scene, ("beauty",), ()) == []


def test_an_override_of_materials_that_a_mesh_selects_is_told(scene):
    (line,) = lines(
        scene(["objects.o.material=null", "objects.o.mesh.materials=true", "objects.o.override.diffuse=0.1"])
    )
    assert "replaces all that the mesh file selects" in line


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["objects.o.mesh.normals.crease=20"], {}),  # the file has no normals
        (["objects.o.mesh={file: n.obj, normals: {crease: 20}}"], {NORMALS_OF_FILE: "n.obj"}),
        (["objects.o.mesh={file: n.obj, normals: {crease: 20, source: computed}}"], {}),
        (["objects.o.mesh={file: n.obj}"], {}),
        (["objects.o.mesh={file: n.obj}", "objects.o.material={model: ward}"], {NO_GRAIN: "n.obj"}),
        (["objects.o.mesh={shape: box}", "objects.o.material={model: ward}"], {}),  # it has uv
        (
            ["objects.o.mesh={file: n.obj}", "objects.o.material={model: ward}", "objects.o.grain=[1,0,0]"],
            {},
        ),
        (["objects.o.mesh={file: n.obj}", "objects.o.material={model: ward, alpha_x: 0.3}"], {}),
    ],
)
def test_what_only_the_mesh_can_tell_is_told_too(scene, overrides, expected):
    loaded = scene(overrides)
    (loaded.folder / "n.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n")
    found = repairs(run_once(planned(loaded), Run()))
    assert {
        what: each.first for what, each in found.items() if what in (NORMALS_OF_FILE, NO_GRAIN)
    } == expected


def test_shipped_scenes_say_nothing_without_effect(root):
    for path in sorted((root / "scenes").glob("*.yaml")):
        assert lines(load(path)) == [], path.name


# what a picture lacks

EMPTY = "version: 1\nfilm: {width: 8, height: 8, samples: 1}\n"
NO_OBJECT = "objects: the scene has none, its pictures are empty; add objects: [{mesh: FILE}]"
NO_LIGHT = (
    "lights: the scene has none and no ambient light, its pictures are black; add lights, or ambient: 0.5"
)
BALL = EMPTY + "objects: [{mesh: {shape: sphere}}]\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (EMPTY, ["s.yaml:1:1: " + NO_OBJECT]),
        (EMPTY + "objects: []\n", ["s.yaml:3:1: " + NO_OBJECT]),
        (BALL, ["s.yaml:1:1: " + NO_LIGHT]),
        (BALL + "lights: []\n", ["s.yaml:4:1: " + NO_LIGHT]),
        (BALL + "ambient: 0.1\n", []),
        (BALL + "lights: [{light: point, position: [0, 9, 0], intensity: 0}]\n", []),
        (BALL + "outputs: {layers: [depth]}\n", []),
        (
            BALL.replace("}]", "}, material: {model: lambert, emission: 1}}]").replace("sphere}}", "sphere}"),
            [],
        ),
    ],
)
def test_a_scene_without_objects_or_lights_says_so(illum, tmp_path, text, said):
    (tmp_path / "s.yaml").write_text(text)
    for words in ("render s.yaml --force", "sweep s.yaml -D seed=1,2"):
        done = illum(*words.split())
        assert (done.returncode, done.stderr.splitlines()) == (0, said), words

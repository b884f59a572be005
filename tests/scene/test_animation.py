"""Scenes with curves: the scene at each frame, where faults are told, frames of scenes."""

from __future__ import annotations

import pytest

from illumcli.errors import InputError
from illumcli.scene.frames import frame_numbers
from illumcli.scene.load import load, read_frames

SCENE = """version: 1
frames: {last: 10, fps: 10}
materials:
  clay: {model: blinn_phong, diffuse: {curve: linear, keys: {0: 0.1, 10: [0.6, 0.1, 0.1]}}}
  glaze: {model: cook_torrance, fresnel: {F: material, name: copper, curve: schlick}}
objects:
  - mesh: {shape: sphere, segments: {curve: step, keys: {0: 8, 5: 16}}}
    material: {curve: step, keys: {0: clay, 5: glaze}}
lights:
  - {light: point, position: [{curve: formula, value: "3*time"}, 2, 0]}
"""


@pytest.fixture
def scene(tmp_path):
    def write(text=SCENE, name="scene.yaml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def problems(*args, **more):
    with pytest.raises(InputError) as caught:
        load(*args, **more)
    return list(caught.value.problems)


def test_a_scene_at_its_frames(scene):
    path = scene()
    first, middle = load(path), load(path, frame=5)
    assert first.scene == load(path, frame=0).scene
    assert (first.frame, middle.frame) == (0, 5)
    assert middle.scene.materials["clay"].diffuse == (0.35, 0.1, 0.1)
    assert middle.scene.lights[0].position == (1.5, 2, 0)
    assert (first.scene.objects[0].mesh.segments, middle.scene.objects[0].mesh.segments) == (8, 16)
    assert (first.scene.objects[0].material, middle.scene.objects[0].material) == ("clay", "glaze")
    assert middle.scene.materials["glaze"].fresnel.curve == "schlick"


def test_a_frame_is_the_scene_with_overrides_of_its_values(scene):
    path = scene()
    given = [
        "materials.clay.diffuse=[0.25, 0.1, 0.1]",
        "objects.0.mesh.segments=8",
        "objects.0.material=clay",
        "lights.0.position.0=0.9",
    ]
    assert load(path, given).scene == load(path, frame=3).scene


def test_curves_may_come_from_overrides_and_be_changed_by_them(scene):
    path = scene()
    override = "lights.0.intensity={curve: linear, keys: {0: 1, 10: 5}}"
    assert load(path, [override], frame=5).scene.lights[0].intensity == (3, 3, 3)
    changed = load(path, ["materials.clay.diffuse.keys.10=[0.3, 0.1, 0.1]"], frame=5)
    assert changed.scene.materials["clay"].diffuse == (0.2, 0.1, 0.1)


def test_faults_name_place_frame_and_way_out(scene):
    path = scene(SCENE.replace("10: [0.6, 0.1, 0.1]", "10: -0.6").replace("5: 16", "5: 2.5"))
    assert load(path).frame == 0
    color, segments = problems(path, frame=7)
    assert color == f"{path}:4:39: materials.clay.diffuse: at frame 7: must be at least 0, is -0.39"
    assert f"{path}:7:" in segments
    fact = (
        "objects.0.mesh.segments: at frame 7: must be a whole number, is 2.5; whole numbers have curve: step"
    )
    assert segments.endswith(fact)


def test_a_value_of_a_key_has_its_own_place(scene):
    path = scene(SCENE.replace("5: glaze", "5: glace"))
    (line,) = problems(path, frame=8)
    assert line == f"{path}:8:45: objects.0.material: at frame 8: no material 'glace'; did you mean 'glaze'?"


def test_faults_of_curves_stand_beside_all_others(scene):
    text = SCENE.replace("curve: linear, keys: {0: 0.1,", "curve: linea, keys: {0: 0.1,")
    text = text.replace("3*time", "3*tim").replace("model: cook_torrance", "model: cook_torance")
    told = problems(scene(text))
    assert len(told) == 3
    assert "materials.clay.diffuse.curve: no curve 'linea'; did you mean 'linear'?" in told[0]
    assert "no model 'cook_torance'" in told[1]
    assert "lights.0.position.0.value: position 3: unknown name 'tim'; did you mean 'time'?" in told[2]


def test_a_curve_needs_frames(scene):
    path = scene(SCENE.replace("frames: {last: 10, fps: 10}\n", ""))
    told = problems(path)
    assert len(told) == 4
    assert (
        f"{path}:3:30: materials.clay.diffuse: varies with the frame, and there are no frames; add" in told[0]
    )
    assert load(path, frame=5).scene.lights[0].position[0] == 0.625  # 24 frames per second


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ("{first: 3}", "frames: missing key 'last'"),
        ("{first: 3, last: 2}", "frames: last must be at least first, is 2 with first 3"),
        ("{last: 1000000}", "frames: 1000001 frames are more than 100000; render them in parts"),
        ("{last: 4, fps: 0}", "frames.fps: must be above 0, is 0"),
        ("{last: 4, stride: 2}", "frames: unknown key 'stride'"),
        ("{last: {curve: step, keys: {0: 1}}}", "frames.last: must be a whole number, is a mapping"),
    ],
)
def test_faulty_frames_are_told_once(scene, frames, said):
    path = scene(SCENE.replace("{last: 10, fps: 10}", frames))
    told = problems(path)
    assert len(told) == 1
    assert said in told[0] or said.replace("frames: unknown", "frames.stride: unknown") in told[0]
    assert read_frames(path) is None


def test_frames_of_a_scene_and_of_overrides(scene):
    assert read_frames(scene()).numbers == range(11)
    assert read_frames(scene(), ["frames.last=4", "film.samples=3"]).numbers == range(5)
    assert read_frames(scene(), ["frames.step=5"]).numbers == range(0, 11, 5)
    assert read_frames(scene(SCENE.replace("frames:", "film:"))) is None


def test_frames_on_the_command_line():
    assert frame_numbers("2:6:2") == range(2, 7, 2)
    with pytest.raises(InputError, match="the frame 7 alone is 7:7"):
        frame_numbers("7")


def test_sequences_of_files(scene, tmp_path):
    for number in (0, 1):
        (tmp_path / f"m.{number:02d}.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text = "version: 1\nframes: {last: 1}\nobjects: [{mesh: m.##.obj}, {mesh: {file: m.##.obj}}]\n"
    loaded = load(scene(text), frame=1)
    assert [thing.mesh.file if n else thing.mesh for n, thing in enumerate(loaded.scene.objects)] == [
        "m.01.obj", "m.01.obj"
    ]  # fmt: skip
    more = "obscurance: w.#.npz}, material: {model: lambert, diffuse: {texture: t.###.png}}}"
    textured = text.replace("{mesh: {file: m.##.obj}}", "{mesh: {file: m.##.obj, " + more)
    loaded = load(scene(textured), frame=1)
    assert loaded.scene.objects[1].mesh.obscurance == "w.1.npz"
    assert loaded.scene.objects[1].material.diffuse.texture == "t.001.png"
    # Without frames the sign is part of the name.
    assert load(scene(text.replace("frames: {last: 1}\n", ""))).scene.objects[0].mesh == "m.##.obj"


def test_scenes_that_extend_others_with_curves(scene, tmp_path):
    (tmp_path / "deep").mkdir()
    scene(SCENE, "deep/base.yaml")
    (tmp_path / "deep" / "t.csv").write_text("frame,x\n0,0.2\n10,0.4\n")
    base = SCENE.replace(
        "10: [0.6, 0.1, 0.1]}}", "10: 0.6}}, exponent: {curve: column, file: t.csv, column: x}"
    )
    scene(base, "deep/base.yaml")
    loaded = load(scene("extends: deep/base.yaml\nmaterials: {clay: {diffuse: 0.5}}\n"), frame=5)
    assert loaded.scene.materials["clay"].diffuse == (0.5, 0.5, 0.5)
    assert loaded.scene.materials["clay"].exponent == 0.3
    over = "extends: deep/base.yaml\nmaterials: {clay: {diffuse: {curve: step, keys: {0: 0.3}}}}\n"
    assert load(scene(over), frame=5).scene.materials["clay"].diffuse == (0.3, 0.3, 0.3)
    over = "extends: deep/base.yaml\nmaterials: {glaze: {fresnel: {curve: dielectric}}}\n"
    assert load(scene(over), frame=5).scene.materials["glaze"].fresnel.curve == "dielectric"


def test_a_table_outside_of_the_readable_folders_is_refused(scene, tmp_path):
    text = SCENE.replace('{curve: formula, value: "3*time"}', "{curve: column, file: /etc/passwd, column: x}")
    (line,) = problems(scene(text))
    assert "lights.0.position.0: at frame 0: /etc/passwd lies outside the folders a scene may read" in line
    missing = text.replace("/etc/passwd", "none.csv")
    (line,) = problems(scene(missing))
    assert "at frame 0: no file" in line

"""Scenes that a window saves, and the commands that it copies."""

from __future__ import annotations

import itertools
import json
import shlex
import shutil
import subprocess

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from illumcli.errors import InputError, OutputError
from illumcli.scene.load import load, read_text
from illumcli.viewer.edits import overrides_of
from illumcli.viewer.saving import command_text, save
from viewer.window import Window

SCENE = """# by hand
version: 1
materials:
  clay: {model: phong, exponent: 9}
  wall: {model: lambert, diffuse: {texture: wall.png, wrap: clamp}}
objects: [{mesh: ball.obj, material: clay, name: ball}, {mesh: {shape: box}, material: wall}]
lights: [{light: point, name: key, position: [1, 2, 3]}]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scenes" / "s.yaml"
    path.parent.mkdir()
    path.write_text(SCENE)
    (path.parent / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (path.parent / "wall.png").write_bytes(b"no picture")
    for folder in ("scenes/deep", "other", "other/far"):
        (tmp_path / folder).mkdir()
    return path


def saved(path, *overrides, name="new.yaml"):
    save(path.parent / name, path, overrides, read_text(path))
    return path.parent / name


def test_a_link_to_nothing_is_followed_only_if_asked(scene):
    link = scene.with_name("link.yaml")
    link.symlink_to(scene.with_name("new.yaml"))
    with pytest.raises(OutputError, match="link to nothing; replace it, or give another name"):
        saved(scene, name="link.yaml")
    save(link, scene, (), read_text(scene), replace=True)
    assert load(scene.with_name("new.yaml")).scene == load(scene).scene


def test_only_what_was_changed_is_in_it(scene):
    new = saved(scene, "materials.clay.exponent=80", "film.samples=9")
    assert new.read_text() == (
        "# s.yaml with the changes made in illum view.\n"
        "extends: s.yaml\n"
        "materials:\n"
        "  clay: {exponent: 80}\n"
        "film: {samples: 9}\n"
    )


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["materials.clay={model: ward}"],
        ["materials.clay.exponent=null"],
        ["materials.wall.diffuse={texture: other.png}"],
        ["materials.wall.diffuse=0.5"],
        ["materials.wall.diffuse.vertex=color"],
        ["lights.key.attenuation={law: none}"],
        ["lights.key=null"],
        ["film.adaptive=true", "film.samples=1"],
        ["camera={projection: orthographic}", "camera.extent=1e-7"],
        ["frames={last: 4}", "materials.clay.exponent={curve: linear, keys: {0: 1, 4: 20}}"],
    ],
)
@pytest.mark.parametrize("name", ["new.yaml", "deep/new.yml", "../other/new.yaml"])
def test_it_is_the_same_scene(scene, overrides, name):
    (scene.parent / "other.png").write_bytes(b"no picture")
    new = saved(scene, *overrides, name=name)
    found = load(new).scene.model_dump_json().replace("../scenes/", "").replace("../", "")
    assert json.loads(found) == json.loads(load(scene, overrides).scene.model_dump_json())


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_random_changes_of_every_scene_are_saved(root, tmp_path, data):
    scenes = tmp_path / "all"
    if not scenes.exists():
        shutil.copytree(root / "scenes", scenes)
    window = Window(data.draw(st.sampled_from(sorted(scenes.glob("*.yaml")))))
    for _ in range(3):
        window.use(data)
    target = scenes / "saved.yaml"
    save(target, window.path, overrides_of(window.edits), window.text, replace=True)
    assert load(target).scene == window.now.scene
    command = command_text(window.path, overrides_of(window.edits))
    assert load(window.path, overrides_in(command)).scene == window.now.scene
    target.unlink()


def overrides_in(command):
    """The -D of a command, as a shell hands them over."""
    script = f"illum() {{ printf '%s\\0' \"$@\"; }}; {command}"
    words = subprocess.run(["sh", "-c", script], capture_output=True, check=True).stdout.decode().split("\0")
    return [value for option, value in itertools.pairwise(words) if option == "-D"]


def test_a_mesh_is_saved_with_all_of_its_studio(scene):
    mesh = scene.parent / "ball.obj"
    overrides = ["studio.up=z", "materials.subject.exponent=7"]
    save(scene.parent / "deep" / "ball.yaml", mesh, overrides, read_text(mesh))
    found = load(scene.parent / "deep" / "ball.yaml").scene
    assert found.meshes["subject"].file == "../ball.obj"
    expected = load(mesh, overrides).scene
    assert (found.objects, found.lights, found.materials) == (
        expected.objects, expected.lights, expected.materials
    )  # fmt: skip


def test_no_file_is_replaced_unasked(scene):
    new = saved(scene, "film.samples=9")
    saved(scene, "film.samples=9")
    with pytest.raises(OutputError, match=r"new\.yaml: a different file is there; replace it"):
        saved(scene, "film.samples=8")
    assert "samples: 9" in new.read_text()
    save(new, scene, ["film.samples=8"], read_text(scene), replace=True)
    assert "samples: 8" in new.read_text()


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("s.yaml", "is the scene itself"),
        ("new.png", "a scene's name ends in .yaml or .yml"),
        ("none/new.yaml", "there is no folder .*none; give another name"),
        ("../other/far/new.yaml", "lies outside the folders a scene may read"),
    ],
)
def test_names_that_no_scene_can_have_are_refused(scene, name, fact):
    with pytest.raises(InputError, match=fact):
        save(scene.parent / name, scene, [], read_text(scene), replace=True)
    assert scene.read_text() == SCENE


def test_a_scene_is_not_saved_over_one_that_it_extends(scene):
    child = saved(scene, "film.samples=9", name="child.yaml")
    with pytest.raises(InputError, match="extends itself"):
        save(scene, child, ["film.samples=8"], read_text(child), replace=True)


def test_a_command_is_quoted_for_the_shell(scene):
    text = command_text(scene, ["film.samples=9", "materials.clay={model: ward}"], ["--only", "depth"])
    assert text == f"illum render {shlex.quote(str(scene))} -D film.samples=9 " + (
        "-D 'materials.clay={model: ward}' --only depth"
    )
    assert command_text(scene.with_name("-x.yaml").relative_to(scene.parent), []) == "illum render ./-x.yaml"

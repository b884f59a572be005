"""Scenes from files: extended, overridden, validated; every problem at once, each at its place."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from illumcli.errors import InputError, LimitError
from illumcli.scene.access import file_problems, resolve
from illumcli.scene.load import load
from illumcli.scene.spec import Scene
from illumcli.scene.studio import STUDIO

GOOD = """\
version: 1
camera:
  position: [0, 1, 5]
film: {width: 64, height: 48}
meshes:
  ball: {shape: sphere}
materials:
  clay: {model: phong, diffuse: 0.5}
  wall: {model: lambert}
objects:
  - {name: teapot, mesh: ball, material: clay}
  - {mesh: ball, material: wall}
lights:
  - {name: key, light: point, position: [1, 2, 3]}
  - {light: spot, position: [4, 5, 6]}
"""


@pytest.fixture
def write(tmp_path):
    """Writes a scene file, by default in a folder of its own inside the test's; gives its path."""

    def writer(text: str | bytes, name: str = "scenes/s.yaml") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return writer


@pytest.fixture
def problems(write):
    """The lines that a text with overrides gives, without the folder of the file."""

    def lines(text: str, *overrides: str) -> list[str]:
        path = write(text)
        with pytest.raises(InputError) as caught:
            load(path, overrides)
        return [line.replace(f"{path.parent}{os.sep}", "") for line in caught.value.problems]

    return lines


def test_a_good_scene(write):
    path = write(GOOD)
    loaded = load(path)
    assert isinstance(loaded.scene, Scene)
    assert (loaded.path, loaded.folder, loaded.name, loaded.overrides) == (path, path.parent, "s", {})
    assert loaded.scene.film.width == 64
    assert loaded.scene.film.samples == 4
    assert loaded.scene.materials["clay"].diffuse == (0.5, 0.5, 0.5)
    assert list(loaded.scene.named_lights()) == ["key", "spot2"]


TEN = """\
version: 1
camera: {position: [0, 1], fov: 200}
film:
  samples: 0
  width: 1:30
materials:
  clay:
    model: phong
    difuse: 0.5
    exponent: -1
  wall: {model: phng}
objects:
  - mesh: ball
    material: caly
lights:
  - light: point
    intensity: .nan
  - light: point
    position: [1, 2, 3]
    attenuation: {law: quadratic}
shading: gourad
film: {}
"""


def test_ten_mistakes_are_ten_lines_in_the_order_of_the_text(problems):
    assert problems(TEN) == [
        "s.yaml:2:10: camera.position: must be a list of 3 numbers, has 2",
        "s.yaml:2:28: camera.fov: must be below 180, is 200",
        "s.yaml:4:3: film.samples: must be at least 1, is 0",
        "s.yaml:5:3: film.width: must be a whole number, is text '1:30'",
        "s.yaml:9:5: materials.clay.difuse: unknown key 'difuse'; did you mean 'diffuse'?",
        "s.yaml:10:5: materials.clay.exponent: must be at least 0, is -1",
        "s.yaml:11:10: materials.wall.model: no model 'phng'; did you mean 'phong'?",
        "s.yaml:13:5: objects.0.mesh: no mesh 'ball'; the scene has no meshes",
        "s.yaml:14:5: objects.0.material: no material 'caly'; did you mean 'clay'?",
        "s.yaml:16:5: lights.0: missing key 'position'",
        "s.yaml:17:5: lights.0.intensity: must be a finite number, is .nan",
        "s.yaml:20:5: lights.1.attenuation: no law 'quadratic'; there are: none, polynomial, inverse_square, "
        "inverse_square_flux, windowed",
        "s.yaml:21:1: shading: no choice 'gourad'; did you mean 'gouraud'?",
        "s.yaml:22:1: the key 'film' stands twice, first in line 3; remove one",
    ]


@pytest.mark.parametrize(
    ("line", "fact"),
    [
        ("seed: 1.5", "seed: must be a whole number, is 1.5"),
        ("seed: true", "seed: must be a whole number, is true"),
        ("seed: -1", "seed: must be at least 0, is -1"),
        ("camera: {fov: yes}", "camera.fov: must be a number, is text 'yes'"),
        ("camera: {position: 3}", "camera.position: must be a list, is 3"),
        ("camera: {up: [0, 0, 0]}", "camera.up: must not be the zero vector"),
        ("camera: {target: [1, 2, 3, 4]}", "camera.target: must be a list of 3 numbers, has 4"),
        ("camera: {projection: fisheye}", "camera: no such projection; there are: perspective, orthographic"),
        ("cameras: {a: {}}\ncamera: {}", "camera: give either camera or cameras, not both"),
        ("film:", "film: must be a mapping, is empty"),
        ("film: {background: [1e19, 0, 0]}", "film.background.0: must be at most 1e+18, is 1e+19"),
        ("film: {background: -1}", "film.background: must be at least 0, is -1"),
        ("materials: [1]", "materials: must be a mapping, is a list"),
        ("materials: {1a: {model: phong}}", "'1a' is no name; use letters, digits, _ and -"),
        ("materials: {a: {}}", "materials.a: must name its model: "),
        ("materials: {a: 3}", "materials.a: must be a mapping with the key 'model'"),
        (
            "materials: {a: {model: phong, diffuse: {texture: 3}}}",
            "materials.a.diffuse.texture: must be text, is 3",
        ),
        (
            "materials: {a: {model: phong, diffuse: {texture: a.png, wrap: no}}}",
            "materials.a.diffuse.wrap: no choice 'no'; there are: repeat, clamp",
        ),
        (
            "materials: {a: {model: phong, exponent: {vertex: e, x: 1}}}",
            "materials.a.exponent.x: unknown key 'x'",
        ),
        ("obscurance: {falloff: {falloff: linear}}", "obscurance.falloff: missing key 'max_distance'"),
        (
            "obscurance: {falloff: {falloff: linear, max_distance: 0r}}",
            "obscurance.falloff.max_distance: must be a distance above 0, or a share of the radius",
        ),
        (
            "objects: [{mesh: {shape: sphere}, transform: {scale: [1, 2]}}]",
            "objects.0.transform.scale: must be a list of",
        ),
        (
            "objects: [{mesh: a.obj, transform: {matrix: "
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.5, 0, 0, 1]]}}]",
            "objects.0.transform.matrix: the last of its four rows must be 0, 0, 0, 1, is 0.5, 0, 0, 1; "
            "where its numbers stand column by column, write it transposed",
        ),
        ("objects: [{mesh: {shape: spere}}]", "no shape 'spere'; did you mean 'sphere'?"),
        ("objects: [{mesh: {}}]", "objects.0.mesh: missing key 'file'"),
        (
            "objects: [{mesh: a.obj, name: a}, {mesh: a.obj, name: a}]",
            "objects.1.name: the name 'a' is taken",
        ),
        (
            "objects: [{mesh: a.obj, override: {difuse: 1}}]",
            "objects.0.override.difuse: unknown key 'difuse'; did you mean 'diffuse'?",
        ),
        (
            "materials: {p: {model: phong}}\nobjects: [{mesh: a.obj, material: p, override: {exponent: -2}}]",
            "objects.0.override.exponent: must be at least 0, is -2",
        ),
        ("outputs: {layers: []}", "outputs.layers: must have at least 1 part, has 0"),
        ("outputs: {layers: [beaty]}", "outputs.layers.0: no choice 'beaty'; did you mean 'beauty'?"),
        ("lihgts: []", "lihgts: unknown key 'lihgts'; did you mean 'lights'?"),
        ("\\e[31m: 1", "unknown key"),
    ],
)
def test_each_kind_of_fault_in_words(problems, line, fact):
    (found,) = problems(f"version: 1\n{line}\n")
    assert fact in found
    assert found.startswith(("s.yaml:2:", "s.yaml:3:"))


def test_control_characters_do_not_reach_the_terminal(problems):
    (found,) = problems('version: 1\n"\\e[31mred\\n": 1\n')
    assert found.isprintable()


@pytest.mark.parametrize("text", ["", "# nothing\n", "3", "[1, 2]", "text"])
def test_what_is_no_mapping_is_no_scene(problems, text):
    (found,) = problems(text)
    assert "a scene is a mapping" in found


def test_a_scene_that_cannot_be_read(tmp_path):
    for path in (tmp_path, tmp_path / "none.yaml"):
        with pytest.raises(InputError, match="cannot be read"):
            load(path)


# overrides


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("lights.key.intensity=5", lambda s: s.lights[0].intensity == (5, 5, 5)),
        ("lights.0.position=[3, 2, 1]", lambda s: s.lights[0].position == (3, 2, 1)),
        ("lights.spot2.angle=12", lambda s: s.lights[1].angle == 12),
        ("lights.0.position.1=7", lambda s: s.lights[0].position == (1, 7, 3)),
        ("lights.key=null", lambda s: [l.light for l in s.lights] == ["spot"]),
        ("objects.teapot.material=wall", lambda s: s.objects[0].material == "wall"),
        ("objects.object2.shading=constant", lambda s: s.objects[1].shading == "constant"),
        ("camera.width=1920", lambda s: s.camera.width == 1920),
        ("camera.position=null", lambda s: s.camera.position == (1.8, 1.9, 3.6)),
        ("obscurance.samples=16", lambda s: s.obscurance.samples == 16),
        ("materials.clay.diffuse=[0.1, 0.2, 0.3]", lambda s: s.materials["clay"].diffuse == (0.1, 0.2, 0.3)),
        ("materials.new={model: lambert}", lambda s: list(s.materials) == ["clay", "wall", "new"]),
        ("materials.clay={model: lambert}", lambda s: s.materials["clay"].model == "lambert"),
        ("seed=0x10", lambda s: s.seed == 16),
    ],
)
def test_overrides_reach_any_part(write, override, value):
    path = override.partition("=")[0]
    loaded = load(write(GOOD), [override])
    assert value(loaded.scene)
    assert list(loaded.overrides) == [path]


def test_later_overrides_win_and_keep_their_values_for_file_names(write):
    loaded = load(write(GOOD), ["film.samples=1", "film.samples=9", "materials.clay.exponent=1e1"])
    assert loaded.scene.film.samples == 9
    assert loaded.overrides == {"film.samples": 9, "materials.clay.exponent": 10.0}


def test_an_override_changes_one_use_of_an_alias(write):
    text = "version: 1\nmaterials:\n  a: &a {model: phong}\n  b: *a\n"
    scene = load(write(text), ["materials.b.exponent=3"]).scene
    assert (scene.materials["a"].exponent, scene.materials["b"].exponent) == (32, 3)


@pytest.mark.parametrize(
    ("override", "fact"),
    [
        ("film.sampels=3", "unknown key 'sampels'; did you mean 'samples'?"),
        ("film.samples=0", "must be at least 1, is 0"),
        ("film={width: 0}", "width: must be at least 1, is 0"),
        ("materials.caly.diffuse=1", "no material 'caly'; did you mean 'clay'?"),
        ("cameras.a.fov=3", "no camera 'a'; the scene has no cameras"),
        ("lights.kee.intensity=1", "no light 'kee'; did you mean 'key'?"),
        ("lights.2.intensity=1", "lights has 2 parts, numbered from 0"),
        ("objects.pot.material=wall", "no object 'pot'; did you mean 'teapot'?"),
        ("objects.teapot.material=gold", "no material 'gold'; there are: clay, wall"),
        ("lights.0.position.x=1", "no part 'x' in position; number its parts from 0"),
        ("camera.up.0=1", "the scene has no camera.up; give the whole, as -D camera.up=..."),
        (
            "materials.clay.diffuse.0=1",
            "materials.clay.diffuse is 0.5 and has no parts; replace the whole",
        ),
        ("film.samples", "write PATH=VALUE, as in -D film.samples=16"),
        ("film..samples=1", "write PATH=VALUE"),
        ("=1", "write PATH=VALUE"),
        (".".join("a" * 100) + "=1", "write PATH=VALUE"),
        ("film.samples=[1", "not YAML: "),
        ("film.exposure=.inf", "must be a finite number, is .inf"),
        ("seed=" + "[" * 100, "nested deeper than 32 levels"),
        ("lights.0.name=spot\udcff", "is not UTF-8"),
    ],
)
def test_faults_of_overrides_name_the_override(problems, override, fact):
    (found,) = problems(GOOD, override)
    assert fact in found
    shown = override.encode(errors="backslashreplace").decode().replace("\\udcff", "\\xdcff")
    assert found.startswith(f"-D {shown}: ")


def test_faults_of_file_and_overrides_together_overrides_last(problems):
    text = GOOD.replace("width: 64", "width: 0")
    assert problems(text, "film.height=0", "nothing", "film.samples=0") == [
        "s.yaml:4:8: film.width: must be at least 1, is 0",
        "-D film.height=0: must be at least 1, is 0",
        "-D nothing: write PATH=VALUE, as in -D film.samples=16",
        "-D film.samples=0: must be at least 1, is 0",
    ]


def test_an_override_mends_what_the_file_has_wrong(write):
    assert load(write(GOOD.replace("width: 64", "width: 0")), ["film.width=8"]).scene.film.width == 8


# extends


def test_mappings_merge_lists_replace_null_removes(write):
    write(GOOD, "scenes/base.yaml")
    scene = load(
        write(
            "extends: base.yaml\nfilm: {width: 8}\ncamera: {position: null}\n"
            "materials: {clay: {exponent: 3}, new: {model: phong}}\nlights: []\n"
        )
    ).scene
    assert (scene.film.width, scene.film.height) == (8, 48)
    assert scene.camera.position == (1.8, 1.9, 3.6)
    assert (scene.materials["clay"].exponent, scene.materials["clay"].diffuse) == (3, (0.5, 0.5, 0.5))
    assert list(scene.materials) == ["clay", "wall", "new"]
    assert scene.lights == ()


def test_a_mapping_of_another_kind_replaces(write):
    write(GOOD, "scenes/base.yaml")
    text = "extends: base.yaml\nmaterials: {clay: {model: lambert}}\nmeshes: {ball: {file: ball.obj}}\n"
    scene = load(write(text)).scene
    assert scene.materials["clay"].diffuse == (0.8, 0.8, 0.8)
    assert scene.meshes["ball"].file == "ball.obj"


def test_a_facet_distribution_or_fresnel_law_of_another_kind_replaces(write):
    write(
        "version: 1\nmaterials:\n  m: {model: cook_torrance, distribution: {D: beckmann, m: 0.2},"
        " fresnel: {F: schlick, f0: 0.1}}\n",
        "scenes/base.yaml",
    )
    text = "extends: base.yaml\nmaterials: {m: {distribution: {D: ggx}, fresnel: {F: dielectric}}}\n"
    material = load(write(text)).scene.materials["m"]
    assert (material.distribution.D, material.distribution.alpha) == ("ggx", 0.3)
    assert (material.fresnel.F, material.fresnel.ior) == ("dielectric", 1.5)


def test_of_several_bases_the_later_wins(write):
    write("version: 1\nseed: 1\nfilm: {width: 1, height: 1}\n", "scenes/a.yaml")
    write("seed: 2\nfilm: {width: 2}\n", "scenes/b.yaml")
    scene = load(write("extends: [a.yaml, b.yaml]\nfilm: {samples: 3}\n")).scene
    assert (scene.seed, scene.film.width, scene.film.height, scene.film.samples) == (2, 2, 1, 3)


def test_faults_of_a_base_are_placed_there(write):
    base = write("version: 1\nfilm: {width: 0}\n", "scenes/base.yaml")
    path = write("extends: base.yaml\nfilm: {height: 0}\n")
    with pytest.raises(InputError) as caught:
        load(path)
    assert caught.value.problems == (
        f"{base}:2:8: film.width: must be at least 1, is 0",
        f"{path}:2:8: film.height: must be at least 1, is 0",
    )


def test_paths_of_a_base_begin_in_its_own_folder(write):
    write("v 0 0 0\n", "scenes/parts/m/a.obj")
    write("version: 1\nmeshes: {a: {file: m/a.obj}}\nobjects: [{mesh: m/a.obj}]\n", "scenes/parts/base.yaml")
    loaded = load(write("extends: parts/base.yaml\n"))
    assert loaded.scene.meshes["a"].file == os.path.join("parts", "m/a.obj")
    assert loaded.scene.objects[0].mesh == os.path.join("parts", "m/a.obj")
    assert file_problems(loaded) == []


@pytest.mark.parametrize(
    ("extends", "fact"),
    [
        ("s.yaml", "s.yaml extends itself"),
        ("[other.yaml]", "s.yaml extends itself"),
        ("3", "must be the path of a scene, is 3"),
        ("none.yaml", "no file "),
        ("othr.yaml", "did you mean 'other.yaml'?"),
        ("{a: b}", "must be the path of a scene, is a mapping"),
        ("/etc/passwd", "lies outside the folders a scene may read; allow it with --allow /etc"),
    ],
)
def test_bases_that_cannot_be(write, extends, fact):
    write("extends: s.yaml\n", "scenes/other.yaml")
    with pytest.raises(InputError) as caught:
        load(write(f"version: 1\nextends: {extends}\n"))
    assert fact in str(caught.value)


def test_chains_and_fans_of_bases_are_limited(write):
    for i in range(20):
        write(f"extends: c{i + 1}.yaml\n", f"scenes/c{i}.yaml")
    with pytest.raises(InputError, match="more than 8 files"):
        load(write("extends: c0.yaml\n"))
    for i in range(4):
        write(f"version: 1\nextends: [{', '.join([f'f{i + 1}.yaml'] * 9)}]\n", f"scenes/f{i}.yaml")
    write("version: 1\n", "scenes/f4.yaml")
    with pytest.raises(InputError, match="more than 64 files"):
        load(write("extends: f0.yaml\n"))


# files that a scene names


@pytest.fixture
def scene_naming(write, tmp_path, monkeypatch):
    """A scene that names one mesh file, loaded from inside an empty current folder."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.delenv("ILLUM_ALLOW", raising=False)

    def scene(name: str):
        return load(write(f"version: 1\nobjects: [{{mesh: {name!r}}}]\n", "top/scenes/s.yaml"))

    return scene


@pytest.mark.parametrize("name", ["a.obj", "../b.obj", "sub/../a.obj", "../../here/c.obj", "link.obj"])
def test_files_near_the_scene_and_the_current_folder_are_found(scene_naming, write, tmp_path, name):
    for file in ("top/scenes/a.obj", "top/b.obj", "here/c.obj", "top/scenes/sub/d.obj"):
        write("v 0 0 0\n", file)
    (tmp_path / "top/scenes/link.obj").symlink_to("../b.obj")
    loaded = scene_naming(name)
    assert resolve(loaded, name).is_file()
    assert file_problems(loaded) == []


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("../../out/e.obj", "lies outside the folders a scene may read; allow it with --allow"),
        ("../../../../../../../../etc/e.obj", "lies outside"),
        ("/etc/e.obj", "lies outside"),
        ("/proc/self/mem.obj", "lies outside"),
        ("link.obj", "lies outside"),
        ("loop.obj", "oop"),
        ("a.obb", "no file"),
        ("a.oj", "did you mean 'a.obj'?"),
        ("none/a.obj", "there is no folder"),
        ("fifo.obj", "is not a regular file"),
        ("folder.obj", "is not a regular file"),
        ("x" * 5000 + ".obj", "cannot be read"),
    ],
)
def test_files_elsewhere_are_refused_with_place_and_way_out(scene_naming, write, tmp_path, name, fact):
    write("v 0 0 0\n", "out/e.obj")
    write("v 0 0 0\n", "top/scenes/a.obj")
    scenes = tmp_path / "top/scenes"
    (scenes / "link.obj").symlink_to("../../out/e.obj")
    (scenes / "loop.obj").symlink_to("loop.obj")
    (scenes / "folder.obj").mkdir()
    os.mkfifo(scenes / "fifo.obj")
    loaded = scene_naming(name)
    with pytest.raises(InputError) as caught:
        resolve(loaded, name)
    assert fact in str(caught.value)
    assert f"{loaded.path}:2:12: objects.0.mesh: " in str(caught.value)
    assert len(file_problems(loaded)) == 1


def test_allowed_folders_come_from_the_environment(scene_naming, write, tmp_path, monkeypatch):
    write("v 0 0 0\n", "out/e.obj")
    monkeypatch.setenv("ILLUM_ALLOW", os.pathsep.join(["/nowhere", str(tmp_path / "out")]))
    loaded = scene_naming("../../out/e.obj")
    assert resolve(loaded, "../../out/e.obj").is_file()


def test_the_root_of_the_disk_is_not_allowed_by_standing_in_it(scene_naming, write, monkeypatch):
    monkeypatch.chdir("/")
    with pytest.raises(InputError, match="lies outside"):
        resolve(scene_naming("/etc/e.obj"), "/etc/e.obj")


# colours

WAYS = "must be one number, three numbers or '#rrggbb' in quotes"


COLORED = """\
version: 1
film: {background: "COLOR"}
ambient: "COLOR"
depth_cue: {near: 1, far: 2, color: "COLOR"}
materials:
  clay: {model: lambert, diffuse: "COLOR"}
  gold: {model: cook_torrance, fresnel: {F: schlick, f0: "COLOR"}}
objects: [{mesh: a.obj, material: clay, override: {diffuse: "COLOR"}}]
lights: [{light: directional, direction: [0, -1, 0], irradiance: "COLOR"}]
"""


@pytest.mark.parametrize("text", ["#bc8000", "#BC8000"])
def test_colours_may_be_written_as_srgb_anywhere(write, text):
    scene = load(write(COLORED.replace("COLOR", text))).scene
    half = ((0xBC / 255 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
    quarter = ((0x80 / 255 + 0.055) / 1.055) ** 2.4
    model = scene.material_of(scene.objects[0])
    found = [scene.film.background, scene.ambient.color, scene.depth_cue.color, model.diffuse,
             scene.materials["gold"].fresnel.f0, scene.lights[0].irradiance]  # fmt: skip
    for color in found:
        assert color == pytest.approx((half, quarter, 0.0), abs=1e-15)


def test_three_digits_stand_for_six_and_dark_values_for_the_toe(write):
    path = write(GOOD)
    short, long = (load(path, [f"materials.clay.diffuse={c}"]).scene.materials["clay"].diffuse
                   for c in ("#f80", "#ff8800"))  # fmt: skip
    assert short == long
    dark = load(path, ['film={background: "#010203"}']).scene.film.background
    assert dark == pytest.approx([k / 255 / 12.92 for k in (1, 2, 3)], abs=1e-18)


@pytest.mark.parametrize("value", ["red", "[1, 2]", "{r: 1}", '"#12"', "#12", "true", "[]"])
def test_what_is_no_colour_is_told_all_three_ways(problems, value):
    for path in ("film.background", "materials.clay.diffuse", "lights.key.intensity", "ambient"):
        if (path, value) == ("ambient", "{r: 1}"):
            continue  # a mapping says color and form there
        (line,) = problems(GOOD, f"{path}={value}")
        assert line.startswith(f"-D {path}={value}: {WAYS}"), line


def test_ambient_names_its_forms_too(problems):
    (line,) = problems(GOOD + "ambient: copled\n")
    assert line == f"s.yaml:16:1: ambient: {WAYS}, or a form (separate, coupled), is text 'copled'"


def test_a_colour_that_yaml_takes_for_a_comment_is_told(problems):
    lines = problems(GOOD + "ambient: #808080\nfilm2: # no colour\n")
    assert lines[0] == 's.yaml:16:1: ambient: #808080 is a comment here; write "#808080" in quotes'
    assert "unknown key 'film2'" in lines[1]


# a mesh instead of a scene


def test_a_mesh_stands_in_the_studio(write, tmp_path):
    mesh = write("v 0 0 0\n", "m/bunny.obj")
    loaded = load(mesh, ["meshes.subject.normals.crease=30", "film.samples=1"])
    assert (loaded.name, loaded.folder) == ("bunny", mesh.parent)
    assert loaded.scene.meshes["subject"].file == "bunny.obj"
    assert loaded.scene.meshes["subject"].normals.crease == 30
    assert list(loaded.overrides) == ["meshes.subject.normals.crease", "film.samples"]
    assert resolve(loaded, "bunny.obj") == mesh
    assert load(tmp_path / "none.ply").scene.film.width == 1280
    (line,) = file_problems(load(tmp_path / "none.ply"))
    assert line == f"{tmp_path}/none.ply: no file {tmp_path}/none.ply"


# any text


SCENES = [GOOD, TEN, STUDIO.read_text(), "extends: s.yaml\n" + GOOD]


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1), text=st.sampled_from(SCENES))
def test_mutated_scenes_load_or_are_refused(write, seed, text):
    rng = random.Random(seed)
    path = write(mutated(text.encode(), rng))
    overrides = [mutated(b"lights.key.position=[1, 2, 3]", rng).decode("utf-8", "surrogateescape")]
    lines = ["fine"]
    try:
        file_problems(load(path, overrides if rng.random() < 0.3 else ()))
    except InputError as error:
        lines = list(error.problems)
    except LimitError as error:
        lines = [str(error)]
    assert lines
    assert all(line and line.isprintable() for line in lines)


def mutated(text: bytes, rng: random.Random) -> bytes:
    """`text` with a few bytes changed, and pieces of it repeated, moved or taken away."""
    pieces = [
        b"-1",
        b"1e400",
        b".nan",
        b"~",
        b"[",
        b"]",
        b"{",
        b"}",
        b": ",
        b"- ",
        b"&a ",
        b"*a",
        b"!x ",
        b"\n",
        b"'",
        b"\x00",
    ]
    for _ in range(rng.randint(1, 6)):
        i, j = sorted(rng.randrange(len(text) + 1) for _ in range(2))
        j = min(j, i + 40)
        match rng.randrange(5):
            case 0:
                text = text[:i] + rng.choice(pieces) + text[i:]
            case 1:
                text = text[:i] + text[j:]
            case 2:
                text = text[:j] + text[i:]
            case 3:
                text = text[:i] + bytes([rng.randrange(256)]) + text[i + 1 :]
            case _:
                text = text[:i] + rng.choice(pieces) + text[j:]
    return text


def test_bases_count_towards_the_limit_of_parts(problems, write, monkeypatch):
    from illumcli.scene import extend as module

    monkeypatch.setattr(module, "MAX_NODES", 12)
    write("version: 1\nfilm: {width: 4, height: 3, samples: 1}\n", "scenes/base.yaml")
    assert load(write("extends: base.yaml\nseed: 1\n")).scene.film.width == 4
    (line,) = problems("extends: base.yaml\nambient: [1, 2, 3]\nseed: 1\n")
    assert line == "base.yaml:1:1: more than 12 parts with all it extends"


@pytest.mark.parametrize("group", ["objects", "lights"])
def test_an_override_of_a_list_that_is_not_there_is_refused(problems, group):
    (line,) = problems("version: 1\n", f"{group}.0.name=a")
    assert line == f"-D {group}.0.name=a: the scene has no {group}"


def test_a_camera_must_look_somewhere(problems):
    (line,) = problems("version: 1\ncamera: {position: [1, 2, 3], target: [1, 2, 3]}\n")
    assert line == "s.yaml:2:1: camera: position and target must differ"


def test_a_fault_of_a_material_is_said_where_it_stands_and_not_at_its_uses(problems):
    lines = problems(
        "version: 1\nmaterials:\n  clay: {model: phong, diffuse: text}\n"
        "objects:\n  - {mesh: a.obj, material: clay, override: {exponent: 3}}\n"
        "  - {mesh: a.obj, material: clay, override: {exponent: -3}}\n"
    )
    assert [line.partition(": ")[0] for line in lines] == ["s.yaml:3:24", "s.yaml:6:46"]


@pytest.mark.parametrize("character", ["\ufffe", "\uffff"])
def test_what_yaml_takes_for_no_text_is_refused(problems, character):
    (line,) = problems(f"version: 1\nmaterials: {{a: {character}}}\n")
    assert line.startswith("s.yaml:1:1: not YAML: ")


def test_a_pattern_of_a_plug_in_is_said_as_it_stands():
    from illumcli.schema.messages import sentence

    fact = sentence("string_pattern_mismatch", {"pattern": "^[0-9]$"}, "a")
    assert fact == "must match ^[0-9]$, is text 'a'"


@pytest.mark.parametrize(
    ("name", "layer"),
    [("beauty", "beauty"), ("alpha", "alpha"), ("lights", "lights"), ("Depth", "depth"), ("P", "position")],
)
def test_a_light_with_the_name_of_a_layer_is_refused_at_its_place(problems, name, layer):
    text = f"version: 1\nlights:\n  - light: point\n    name: {name}\n    position: [1, 2, 3]\n"
    assert problems(text) == [
        f"s.yaml:4:5: lights.0.name: the layer {layer} has the name '{name}'; give the light another"
    ]


def test_parts_named_as_keys_are_merged_like_others(write):
    """A material may be called `model`, a mesh `shape` or `file`."""
    base = "version: 1\nmaterials: {model: {model: phong}, texture: {model: lambert}}\n"
    base += "meshes: {shape: {shape: box}, file: {file: a.obj}}\n"
    write(base, "scenes/base.yaml")
    more = "materials: {vertex: {model: ward}}\nmeshes: {law: {shape: disc}}\n"
    made = load(write(f"extends: base.yaml\n{more}")).scene
    assert sorted(made.materials) == ["model", "texture", "vertex"]
    assert sorted(made.meshes) == ["file", "law", "shape"]


@pytest.mark.parametrize("group", ["lights", "objects"])
@pytest.mark.parametrize("order", [1, -1])
def test_a_name_that_another_has_by_default_is_taken(problems, group, order):
    """It would hide the other: one light less, and no word of it."""
    kind = {"lights": "{light: point, position: [1, 2, 3]", "objects": "{mesh: {shape: box}"}[group]
    default = {"lights": "point", "objects": "object"}[group]
    parts = [f"{kind}, name: {default}{2 if order > 0 else 1}}}", f"{kind}}}"][::order]
    text = f"version: 1\n{group}:\n" + "".join(f"  - {part}\n" for part in parts)
    (line,) = problems(text)
    assert "is taken" in line


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("camera: {position: [0]}", "camera.position: must be a list of 3 numbers, has 1"),
        ("camera: {fit: nobody}", "camera.fit: no object 'nobody'; the scene has no objects"),
        (
            "lights: [{light: spot, position: [0, 1, 2], target: [0, 1, 2]}]",
            "lights.0: position and target must differ",
        ),
        ("camera: {position: []}", "camera.position: must be a list of 3, has 0"),
        ("shading: 3", "shading: must be 'constant', 'gouraud', 'phong' or 'quadratic', is 3"),
        ("shading: fong", "shading: no choice 'fong'; did you mean 'phong'?"),
        ("ambient: {form: [1]}", "ambient.form: must be 'separate' or 'coupled', is a list"),
        ("meshes: {a: {file: b.obj, materials: 3}}", "meshes.a.materials: must be true or false, is 3"),
        ("camera: {fov: 0}", "camera.fov: must be above 0, is 0"),
        ("camera: {fov: 180}", "camera.fov: must be below 180, is 180"),
        ("objects: 3", "objects: must be a list, is 3"),
        ("objects: [{mesh: a.obj, override: 3}]", "objects.0.override: must be a mapping, is 3"),
        ("film: {width: 1.5}", "film.width: must be a whole number, is 1.5"),
        ("shading:", "shading: must be 'constant', 'gouraud', 'phong' or 'quadratic', is empty"),
    ],
)
def test_one_fault_is_one_line(problems, text, fact):
    (line,) = problems(f"version: 1\n{text}\n")
    assert line.partition(": ")[2] == fact


def test_as_many_bases_as_allowed(write):
    for i in range(8):
        write(f"extends: c{i + 1}.yaml\n" if i < 7 else "version: 1\nseed: 7\n", f"scenes/c{i}.yaml")
    assert load(write("extends: c0.yaml\n")).scene.seed == 7
    with pytest.raises(InputError, match="more than 8 files, each extending the next"):
        load(write("extends: s.yaml\n", "scenes/t.yaml"))
    names = [f"b{i}.yaml" for i in range(64)]
    for name in names:
        write("version: 1\n", f"scenes/{name}")
    assert load(write(f"extends: [{', '.join(names[:63])}]\n")).scene.version == 1
    with pytest.raises(InputError, match="more than 64 files in all"):
        load(write(f"extends: [{', '.join(names)}]\n"))


def test_a_law_of_another_kind_replaces_and_paths_of_bakes_move(write):
    write(
        "version: 1\nlights: []\nmeshes: {a: {file: a.obj, obscurance: a.npz}}\n"
        "materials:\n  m: {model: lambert, diffuse: {texture: t.png, wrap: clamp}}\n"
        "obscurance: {falloff: {falloff: linear, max_distance: 3}}\n",
        "scenes/sub/base.yaml",
    )
    text = "extends: sub/base.yaml\nobscurance: {falloff: {falloff: step}}\n"
    scene = load(write(text)).scene
    assert scene.obscurance.falloff.falloff == "step"
    assert scene.meshes["a"].obscurance == os.path.join("sub", "a.npz")
    assert scene.materials["m"].diffuse.texture == os.path.join("sub", "t.png")
    assert load(write(f"{text}meshes: {{a: {{shape: box}}}}\n")).scene.meshes["a"].shape == "box"

"""Faults of meshes that rendering tolerates: counted, reported with their first place, refused on request."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from illumcli.cache import policy as artifacts
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.geometry.repairs import APPROXIMATED, HARMLESS, NO_MATERIAL, NOT_ASKED

BAD = """v 0 0 0
v 1 0 0
v 0 1 0
v 9 9 9
v 2 0 0
v 7 7 7
vn 0 0 1
vn 0 0 0
f 1//1 2//1 3//1
f 1//1 2//2 5//1
f 2//1 2//1 3//2
f 1//1 3//1 2//1
"""
EXPECTED = {
    "unused vertices": (2, "bad.obj:4"),
    "faces without area": (2, "bad.obj:10"),
    "normals not finite or of no length": (1, "bad.obj:8"),
    "faces that run clockwise about their normals": (1, "bad.obj:12"),
}


@pytest.fixture
def illum(illum_here):
    return illum_here


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "bad.obj").write_text(BAD)
    small = "version: 1\nfilm: {width: 8, height: 8, samples: 1}\n"
    (tmp_path / "s.yaml").write_text(f"{small}objects: [{{mesh: bad.obj}}, {{mesh: bad.obj}}]\n")
    return tmp_path


def test_repairs_are_counted_and_said_once_with_their_first_line(illum, scene):
    done = illum("render", "s.yaml", "--report", "r.json", "-v")
    assert done.returncode == 0, done.stderr
    report = json.loads((scene / "r.json").read_text())
    assert report["repairs"] == {what: count for what, (count, _) in EXPECTED.items()}
    assert report["repairs_first"] == {what: first for what, (_, first) in EXPECTED.items()}
    for what, (count, first) in EXPECTED.items():
        assert done.stderr.count(f"s.yaml: {what}: {count}, the first is {first}\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        ("render", "s.yaml"),
        ("ao-bake", "s.yaml", "-o", "b.npz", "--samples", "4"),
        ("sweep", "s.yaml", "-D", "camera.fov=30,40"),
    ],
)
def test_harmless_counts_are_for_those_who_ask(illum, scene, words):
    quiet, told = illum(*words), illum(*words, "--force", "-v")
    for what in EXPECTED:
        assert quiet.stderr.count(what) == (what not in HARMLESS)
        assert told.stderr.count(what) == 1
    assert not any(what in illum(*words, "--force", "-q").stderr for what in EXPECTED)


def test_a_second_run_from_the_cache_says_the_same(illum, scene):
    first = illum("render", "s.yaml", "--force", ILLUM_CACHE=str(scene / "c"))
    again = illum("render", "s.yaml", "--force", ILLUM_CACHE=str(scene / "c"))
    assert first.stderr == again.stderr
    assert "faces without area" in again.stderr


def test_a_mesh_that_was_renamed_is_called_by_its_new_name(tmp_path, monkeypatch):
    """What is kept of a mesh is named by its content alone."""
    monkeypatch.setattr(artifacts, "worth", lambda seconds, size: True)
    monkeypatch.chdir(tmp_path)
    Path("bad.obj").write_text(BAD)
    Path("s.yaml").write_text(
        "version: 1\nfilm: {width: 8, height: 8, samples: 1}\nobjects: [{mesh: bad.obj}]\n"
    )
    render_scene(RenderJob(Path("s.yaml")))
    Path("deep").mkdir()
    Path("bad.obj").rename("deep/new.obj")
    _, report = render_scene(
        RenderJob(Path("s.yaml"), RenderOptions(["objects.0.mesh=deep/new.obj"], force=True))
    )
    assert any("store" in reused.values() for reused in report.reused.values())
    assert {each.first for each in report.repairs.values()} == {f"deep/new.obj:{n}" for n in (4, 8, 10, 12)}


@pytest.mark.parametrize(
    "words",
    [
        ("render", "s.yaml"),
        ("ao-bake", "bad.obj", "-o", "b.npz", "--samples", "4"),
        ("sweep", "s.yaml", "-D", "camera.fov=30"),
    ],
)
def test_strict_refuses_every_class_and_writes_nothing(illum, scene, words):
    before = sorted(path.name for path in scene.iterdir())
    done = illum(*words, "--strict")
    assert done.returncode == 2, done.stderr
    assert sum("leave --strict out" in line for line in done.stderr.splitlines()) == len(EXPECTED)
    for what in EXPECTED:
        assert what in done.stderr
    assert sorted(path.name for path in scene.iterdir() if path.name != "cache") == before


def test_strict_refuses_where_every_image_is_kept(illum, scene):
    assert illum("render", "s.yaml").returncode == 0
    assert "kept" in illum("render", "s.yaml").stderr
    done = illum("render", "s.yaml", "--strict")
    assert done.returncode == 2
    assert sum("leave --strict out" in line for line in done.stderr.splitlines()) == len(EXPECTED)


def test_strict_takes_a_sound_mesh(illum, scene):
    (scene / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert illum("render", "s.yaml", "--strict").returncode == 0


NAMED = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 3 2\n"
RED = "materials: {red: {model: lambert}}\n"


@pytest.mark.parametrize(
    ("library", "more", "told"),
    [
        ("", "", (NO_MATERIAL, 2)),
        ("", RED, (NO_MATERIAL, 1)),
        ("", RED.replace("red", "red: {model: lambert}, blue"), None),
        ("red blue", "", (NOT_ASKED, 2)),
        ("red blue", RED, (NOT_ASKED, 1)),
        ("red", "meshes: {m: {file: m.obj, materials: true}}\n", ("materials that no library has", 1)),
        ("red blue", "meshes: {m: {file: m.obj, materials: true}}\n", None),
        ("", "meshes: {m: {file: m.obj, materials: true}}\n", (NO_MATERIAL, 2)),
    ],
)
def test_materials_that_a_mesh_names_in_vain_are_said_once(illum, tmp_path, library, more, told):
    (tmp_path / "m.obj").write_text("mtllib m.mtl\n" * bool(library) + NAMED)
    (tmp_path / "m.mtl").write_text("".join(f"newmtl {name}\n" for name in library.split()))
    mesh = "m" if "meshes" in more else "m.obj"
    small = "version: 1\nfilm: {width: 8, height: 8, samples: 1}\nambient: 1\n"
    (tmp_path / "s.yaml").write_text(f"{small}{more}objects: [{{mesh: {mesh}}}]\n")
    done = illum("render", "s.yaml")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stderr.splitlines() if "materials" in line]
    assert len(lines) == (told is not None)
    assert told is None or f"{told[0]}: {told[1]}, the first is m.obj" in lines[0]
    refused = illum("render", "s.yaml", "--strict", "--force").returncode
    assert refused == (2 if told is not None and told[0] not in APPROXIMATED else 0)
    bake = illum("ao-bake", "s.yaml", "-o", "b.npz", "--samples", "4")
    assert not any(what in bake.stderr for what in (NO_MATERIAL, NOT_ASKED))

"""What is wrong with a mesh and can be lived with: counted, said with its first place, refused when asked."""

from __future__ import annotations

import json

import pytest

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
    "unused vertices": (2, "vertex 4 of object 1"),
    "faces without area": (2, "face 2 of object 1"),
    "normals not finite or of no length": (1, "normal 2 of object 1"),
}


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "bad.obj").write_text(BAD)
    small = "version: 1\nfilm: {width: 8, height: 8, samples: 1}\n"
    (tmp_path / "s.yaml").write_text(f"{small}objects: [{{mesh: bad.obj}}, {{mesh: bad.obj}}]\n")
    return tmp_path


def test_repairs_are_counted_and_said_with_their_first_place(illum, scene):
    done = illum("render", "s.yaml", "--report", "r.json")
    assert done.returncode == 0, done.stderr
    report = json.loads((scene / "r.json").read_text())
    assert report["repairs"] == {what: 2 * count for what, (count, _) in EXPECTED.items()}
    assert report["repairs_first"] == {what: first for what, (_, first) in EXPECTED.items()}
    for what, (count, first) in EXPECTED.items():
        assert f"s.yaml: {what}: {2 * count}, the first is {first}" in done.stderr


def test_a_second_run_from_the_cache_says_the_same(illum, scene):
    first = illum("render", "s.yaml", "--force", ILLUM_CACHE=str(scene / "c"))
    again = illum("render", "s.yaml", "--force", ILLUM_CACHE=str(scene / "c"))
    assert first.stderr == again.stderr
    assert "unused vertices" in again.stderr


@pytest.mark.parametrize(
    "words", [("render", "s.yaml"), ("ao-bake", "bad.obj", "-o", "b.npz", "--samples", "4")]
)
def test_strict_refuses_every_class_and_writes_nothing(illum, scene, words):
    before = sorted(path.name for path in scene.iterdir())
    done = illum(*words, "--strict")
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == len(EXPECTED)
    for what in EXPECTED:
        assert what in done.stderr
    assert sorted(path.name for path in scene.iterdir() if path.name != "cache") == before


def test_strict_takes_a_sound_mesh(illum, scene):
    (scene / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert illum("render", "s.yaml", "--strict").returncode == 0

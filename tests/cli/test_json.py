"""`--json`: what was done, as a list on stdout."""

from __future__ import annotations

import json

import pytest

SCENE = "version: 1\nambient: 0.5\nobjects: [{mesh: {shape: box}}]\nfilm: {width: 8, height: 6, samples: 1}\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return tmp_path


def printed(done, code=0):
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


def test_renders_and_their_failures(illum, folder):
    failed, done = printed(
        illum("render", "none.yaml", "s.yaml", "-o", "{scene}.exr", "--json", "--no-cache"), 2
    )
    assert failed == {"error": "none.yaml: cannot be read: No such file or directory"}
    assert (done["files"], done["scene"], list(done["rays"])) == (["s.exr"], "s.yaml", ["hits"])
    (only,) = printed(illum("render", "none.yaml", "--json"), 2)
    assert only == failed
    frames = printed(illum("render", "s.yaml", "--frames", "0:1", "-D", "ambient=frame", "--json"))
    assert [entry["frame"] for entry in frames] == [0, 1]


def test_sweeps(illum, folder):
    failed, done = printed(illum("sweep", "s.yaml", "-D", "film.samples=0,2", "--json"), 2)
    assert failed["label"] == "samples 0"
    assert "film.samples" in failed["error"]
    assert (done["values"], done["files"]) == ({"film.samples": "2"}, ["s-2.png"])
    (planned,) = printed(illum("sweep", "s.yaml", "-D", "film.samples=1,2", "--dry-run", "--json"))
    assert planned["files"] == ["s-1.png", "s-2.png"]


def test_bakes_and_models(illum, folder):
    for given in ("m.obj", "."):
        (done,) = printed(illum("ao-bake", given, "-o", "m.npz", "--samples", "4", "--json"))
        assert (done["files"], done["input"]) == (["m.npz"], "m.obj")
    every = {entry["model"]: entry for entry in printed(illum("models", "--json"))}
    (lambert,) = printed(illum("models", "lambert", "--json"))
    assert lambert == every["lambert"]
    assert "diffuse" in lambert["schema"]["properties"]
    assert lambert["claims"]["reciprocal"] is True

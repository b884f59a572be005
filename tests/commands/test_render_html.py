"""`illum render --html`: scenes and frames in a browser."""

from __future__ import annotations

import json
import shlex

import pytest

SCENE = """
version: 1
film: {width: 12, height: 8, samples: 1}
ambient: 0.2
materials: {clay: {model: phong}}
objects: [{mesh: {shape: sphere}, material: clay}]
lights: [{light: point, position: [3, 4, 5], intensity: 30}]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.yaml").write_text(SCENE)
    (tmp_path / "b.yaml").write_text(SCENE.replace("phong", "lambert") + "cameras: {left: {}, right: {}}")
    return tmp_path


def report_data(folder):
    _, _, text = (folder / "html" / "data.js").read_text().partition("const REPORT = ")
    return json.loads(text.rstrip().removesuffix(";"))


def test_frames_are_entries_whose_commands_make_their_pictures(illum, folder):
    words = ("a.yaml", "--frames", "2:6:2", "-D", "ambient=frame/10", "--seed", "3", "--only", "beauty")
    done = illum("render", *words, "-o", "out/{frame:02d}.png", "--html", "html")
    assert done.returncode == 0, done.stderr
    data = report_data(folder)
    assert (data["title"], data["noun"]) == ("a", "frame")
    assert data["labels"] == ["a, frame 2", "a, frame 4", "a, frame 6"]
    assert [(each["label"], each["values"]) for each in data["parameters"]] == [("frame", ["2", "4", "6"])]
    assert data["states"] == ["rendered"] * 3
    assert data["files"] == [[f"../out/{frame:02d}.png"] for frame in (2, 4, 6)]
    assert [each["name"] for each in data["measures"]] == ["seconds", "rays"]
    pictures = {path: (folder / path).read_bytes() for path in done.stdout.split()}
    for path, command in zip(pictures, data["commands"], strict=True):
        (folder / path).unlink()
        assert illum(*shlex.split(command)[1:]).returncode == 0
        assert (folder / path).read_bytes() == pictures[path]

    # The same again: nothing is written.
    again = illum("render", *words, "-o", "out/{frame:02d}.png", "--html", "html")
    assert "html/index.html: kept, its content is the same" in again.stderr
    assert report_data(folder) == data


def test_scenes_with_several_cameras_and_one_that_fails(illum, folder):
    (folder / "c.yaml").write_text(SCENE.replace("samples: 1", "samples: 0"))
    done = illum("render", "a.yaml", "b.yaml", "c.yaml", "--html", "html")
    assert done.returncode == 2
    data = report_data(folder)
    assert data["states"] == ["rendered", "rendered", "failed"]
    assert data["noun"] == "scene"
    assert "<title>a, b, c: 3 scenes</title>" in (folder / "html" / "index.html").read_text()
    assert "film.samples" in data["errors"][2]
    assert data["pictureNames"] == ["beauty", "left beauty", "right beauty"]
    (folder / "c.yaml").write_text(SCENE)
    done = illum("render", "a.yaml", "b.yaml", "c.yaml", "--html", "html")
    assert done.returncode == 0, done.stderr
    assert report_data(folder)["states"] == ["kept", "kept", "rendered"]


def test_a_report_of_a_shard_is_refused_with_the_way_out(illum, folder):
    done = illum("render", "a.yaml", "b.yaml", "--html", "html", "--shard", "1/2")
    assert done.returncode == 2
    assert "after illum merge" in " ".join(done.stderr.split())

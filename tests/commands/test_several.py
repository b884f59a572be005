"""Several scenes, inputs, variants: if one fails, its error is reported and the others are done."""

from __future__ import annotations

import json

import pytest

SCENE = (
    "version: 1\nfilm: {width: 8, height: 6, samples: 1}\nobjects: [{mesh: {shape: sphere}}]\nambient: 1\n"
)
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0.2\nv 0.4 0.3 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


@pytest.fixture
def folder(tmp_path):
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.yaml").write_text(SCENE)
        (tmp_path / f"{name}.obj").write_text(MESH)
    (tmp_path / "range.yaml").write_text(SCENE.replace("width: 8", "width: -8"))
    (tmp_path / "empty.yaml").write_text(SCENE.replace("{shape: sphere}", "empty.obj"))
    (tmp_path / "empty.obj").write_text("")
    return tmp_path


def made(folder, suffix):
    return sorted(path.stem for path in folder.glob(f"*.{suffix}"))


@pytest.mark.parametrize("bad", ["range.yaml", "none.yaml", "empty.yaml"])
def test_scenes(illum, folder, bad):
    words = ("render", "a.yaml", bad, "c.yaml", "-o", "{scene}.png")
    done = illum(*words)
    assert (done.returncode, done.stdout) == (2, "a.png\nc.png\n"), done.stderr
    told, summary = done.stderr.splitlines()
    assert bad.partition(".")[0] in told
    assert summary == "1 of 3 scenes failed"
    assert made(folder, "png") == ["a", "c"]


def test_scenes_up_to_the_first_that_fails(illum, folder):
    done = illum("render", "a.yaml", "range.yaml", "c.yaml", "-o", "{scene}.png", "--stop-at-first")
    assert (done.returncode, made(folder, "png")) == (2, ["a"])
    assert done.stderr.splitlines()[0].startswith("range.yaml:2:8: film.width")
    done = illum("render", "empty.yaml", "b.yaml", "-o", "{scene}.png", "--stop-at-first")
    assert (done.returncode, made(folder, "png")) == (2, ["a"])


def test_the_exit_code_is_the_first_failures(illum, folder):
    (folder / "c.png").write_text("somebody else's")
    for names, code in ((("c", "range"), 5), (("range", "c"), 2)):
        done = illum("render", *(f"{name}.yaml" for name in names), "a.yaml", "-o", "{scene}.png")
        assert done.returncode == code, done.stderr
        assert done.stderr.splitlines()[-1] == "2 of 3 scenes failed"
    assert (folder / "c.png").read_text() == "somebody else's"


def test_files_of_one_name_are_told_before_anything_is_rendered(illum, folder):
    same = illum("render", "a.yaml", "a.yaml", "-o", "a.png")
    assert (same.returncode, same.stdout) == (0, "a.png\na.png\n")
    (folder / "b.yaml").write_text(SCENE.replace("6", "7"))
    other = illum("render", "a.yaml", "b.yaml", "-o", "other.png")
    assert (other.returncode, made(folder, "png")) == (2, ["a"])
    assert "other.png: the name of 2 images" in other.stderr


def test_a_report_tells_a_failure_of_this_time(illum, folder):
    (folder / "b.obj").write_text(MESH + "v 9 9 9\n")
    (folder / "b.yaml").write_text(SCENE.replace("{shape: sphere}", "b.obj"))
    words = ("render", "a.yaml", "b.yaml", "-o", "{scene}.png", "--report", "r.json", "-q")
    assert illum(*words).returncode == 0
    assert illum(*words).returncode == 0
    assert not any(entry["error"] for entry in json.loads((folder / "r.json").read_text()))

    # the same contents as planned, but one of them cannot be made
    (folder / "b.png").unlink()
    assert illum(*words, "--strict").returncode == 2
    first, second = json.loads((folder / "r.json").read_text())
    assert (first["kept"], first["error"]) == (["a.png"], {})
    assert (second["content"], "unused vertices" in second["error"]) == ("incomplete", True)
    assert illum(*words).returncode == 0
    assert not json.loads((folder / "r.json").read_text())[1]["error"]


def test_meshes(illum, folder):
    words = ("ao-bake", "a.obj", "empty.obj", "none.obj", "c.obj", "--samples", "4", "-q")
    done = illum(*words, "-o", "{scene}.npz", "-o", "{scene}.ply", "--report", "r.json")
    assert (done.returncode, done.stdout) == (2, "a.npz\na.ply\nc.npz\nc.ply\n"), done.stderr
    assert [line.partition(":")[0] for line in done.stderr.splitlines()] == [
        "empty.obj", "none.obj", "2 of 4 inputs failed"
    ]  # fmt: skip
    stopped = illum(*words, "-o", "x-{scene}.npz", "--stop-at-first")
    assert (stopped.returncode, stopped.stdout) == (2, "x-a.npz\n")
    clash = illum("ao-bake", "a.obj", "c.obj", "-o", "one.npz")
    assert clash.returncode == 2
    assert "one.npz: the name of the outputs of a.obj, c.obj; write {name} into the pattern" in clash.stderr


def test_variants_up_to_the_first_that_fails(illum, folder):
    axis = "objects.0.mesh={shape: sphere},empty.obj,{shape: box}"
    words = (
        "sweep",
        "a.yaml",
        "-D",
        axis,
        "-o",
        "{objects.0.mesh}.png",
        "--table",
        "t.csv",
        "--sheet",
        "s.png",
    )
    done = illum(*words, "--stop-at-first")
    assert (done.returncode, len(made(folder, "png"))) == (2, 2)  # the first and the sheet
    assert done.stderr.splitlines()[-1] == "1 of 3 variants failed"
    assert illum(*words).returncode == 2
    assert len(made(folder, "png")) == 3

"""`illum render` for its users: files, names, kept and refused outputs, exit codes, nothing left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from illumcli.images.reader import read_image, read_metadata

SCENE = """
version: 1
film: {width: 32, height: 24, samples: 1}
ambient: 0.2
materials:
  clay: {model: blinn_phong, diffuse: [0.6, 0.4, 0.3]}
objects:
  - {mesh: {shape: sphere}, material: clay}
lights:
  - {light: point, name: key, position: [3, 4, 5], intensity: 30}
outputs: {files: ["{scene}.png"]}
"""
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    return path


def long_ago(path):
    os.utime(path, (1e9, 1e9))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_stdout_is_the_paths_and_nothing_else(illum, scene, tmp_path):
    done = illum("render", "ball.yaml", "-o", "out/{scene}-{camera}.exr", "-o", "out/{scene}-{camera}.exr")
    assert (done.returncode, done.stdout, done.stderr) == (0, "out/ball-main.exr\n", "")
    image = read_image(tmp_path / "out/ball-main.exr")
    assert (image.width, image.height) == (32, 24)
    assert {"R", "G", "B", "A"} == set(image.channels)


def test_one_exr_holds_every_layer_and_pngs_hold_one_each(illum, scene, tmp_path):
    only = [word for layer in ("beauty", "depth", "lights", "shadows") for word in ("--only", layer)]
    assert illum("render", "ball.yaml", *only, "-o", "x.exr").returncode == 0
    assert set(read_image(tmp_path / "x.exr").channels) == {
        "R", "G", "B", "A", "Z", "key.R", "key.G", "key.B", "shadow.key.Y"
    }  # fmt: skip
    done = illum("render", "ball.yaml", *only, "-o", "{layer}.png")
    assert done.stdout.split() == ["beauty.png", "depth.png", "key.png", "shadow.key.png"]
    clash = illum("render", "ball.yaml", *only, "-o", "same.png")
    assert clash.returncode == 2
    assert "same.png" in clash.stderr


def test_every_camera_gets_its_picture(illum, tmp_path):
    text = SCENE.replace(
        "film:", "cameras: {near: {position: [0, 0, 3]}, far: {position: [0, 0, 9], width: 8}}\nfilm:"
    )
    (tmp_path / "two.yaml").write_text(text)
    done = illum("render", "two.yaml", "-o", "{camera}.png")
    assert done.stdout.split() == ["near.png", "far.png"]
    assert read_image(tmp_path / "far.png").width == 8


def test_overridden_values_name_files_and_change_pictures(illum, scene, tmp_path):
    for red in (0.1, 0.9):
        done = illum(
            "render", scene, "-D", f"materials.clay.diffuse={red}", "-o", "red-{materials.clay.diffuse}.exr"
        )
        assert done.returncode == 0, done.stderr
    low, high = (read_image(tmp_path / f"red-{red}.exr").channels["R"] for red in (0.1, 0.9))
    assert low.max() < high.max()


def test_the_same_content_is_kept_and_other_content_is_not_replaced(illum, scene, tmp_path):
    illum("render", scene)
    long_ago(tmp_path / "ball.png")
    again = illum("render", scene)
    assert (again.returncode, again.stdout) == (0, "ball.png\n")
    assert "ball.png: kept" in again.stderr
    before = (tmp_path / "ball.png").stat().st_mtime_ns
    assert before > (tmp_path / "ball.yaml").stat().st_mtime_ns, "make would run it again"
    other = illum("render", scene, "-D", "ambient=0.9")
    assert other.returncode == 5
    assert "--force" in other.stderr
    assert (tmp_path / "ball.png").stat().st_mtime_ns == before
    assert illum("render", scene, "-D", "ambient=0.9", "--force").returncode == 0
    assert (tmp_path / "ball.png").stat().st_mtime_ns != before
    assert names(tmp_path) == ["ball.png", "ball.yaml"]


def test_a_changed_mesh_byte_is_other_content(illum, tmp_path):
    (tmp_path / "t.obj").write_text(TRIANGLE)
    (tmp_path / "s.yaml").write_text("version: 1\nfilm: {width: 8, height: 8}\nobjects: [{mesh: t.obj}]\n")
    assert illum("render", "s.yaml", "-o", "s.exr").returncode == 0
    assert illum("render", "s.yaml", "-o", "s.exr").returncode == 0
    (tmp_path / "t.obj").write_text(TRIANGLE.replace("v 1 0 0", "v 2 0 0"))
    assert illum("render", "s.yaml", "-o", "s.exr").returncode == 5


def test_the_report_says_what_happened(illum, scene, tmp_path):
    illum("render", scene, "--report", "r.json", "--seed", 7)
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["written"] == ["ball.png"]
    assert report["seed"] == 7
    assert report["rays"]["hits"] >= 32 * 24
    assert report["skipped"]["obscurance"]
    assert report["peak_memory_bytes"] > 1e6
    assert {"seconds", "scene_hash", "versions", "repairs", "threads"} <= set(report)


def test_what_half_precision_clamps_is_said_with_v(illum, scene, tmp_path):
    bright = ("render", scene, "-D", "lights.0.intensity=1e9", "-o")
    said = illum(*bright, "half.exr", "-v").stderr
    (line,) = [line for line in said.splitlines() if "65504" in line]
    count = int(line.split(": ")[1].split()[0])
    channels = read_image(tmp_path / "half.exr").channels
    assert count == sum(int((channels[name] == 65504).sum()) for name in "RGB") > 0
    assert "outputs.colour: float" in line
    assert "65504" not in illum(*bright, "again.exr").stderr
    assert "65504" not in illum(*bright, "float.exr", "-v", "-D", "outputs.colour=float").stderr


def test_a_mesh_alone_is_rendered_in_the_studio(illum, tmp_path):
    (tmp_path / "t.obj").write_text(TRIANGLE)
    small = ["-D", "film.width=40", "-D", "film.height=30", "-D", "film.samples=1"]
    done = illum("render", "t.obj", *small)
    assert (done.returncode, done.stdout) == (0, "t.png\n"), done.stderr
    assert read_image(tmp_path / "t.png").channels["R"].std() > 0.01


def test_metadata_say_where_a_picture_comes_from(illum, scene, tmp_path):
    illum("render", scene, "-o", "m.exr")
    said = read_metadata(tmp_path / "m.exr")
    assert said["illum:camera"] == "main"
    assert said["illum:layers"] == "beauty"
    assert len(said["illum:content"]) == 32


FAULTS = {
    "missing mesh": ("objects: [{mesh: nowhere.obj}]", None, 2, "nowhere.obj"),
    "empty mesh": ("objects: [{mesh: m.obj}]", b"v 0 0 0\n", 2, "no faces"),
    "NaN vertices": ("objects: [{mesh: m.obj}]", TRIANGLE.replace("v 1", "v nan").encode(), 2, "finite"),
    "truncated PLY": (
        "objects: [{mesh: m.ply}]",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\0\0\0\0",
        2,
        "m.ply",
    ),
    "huge film": ("film: {width: 1000000, height: 1000000}", None, 4, "limit"),
    "too many rays": ("film: {width: 60000, height: 60000, samples: 1024}", None, 4, "rays"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_one_line_with_the_right_code_and_no_debris(illum, tmp_path, fault):
    text, mesh, code, fact = FAULTS[fault]
    if mesh is not None:
        name = "m.ply" if b"ply" in mesh[:4] else "m.obj"
        (tmp_path / name).write_bytes(mesh)
    (tmp_path / "s.yaml").write_text(f"version: 1\n{text}\n")
    before = names(tmp_path)
    done = illum("render", "s.yaml", "-o", "out/x.png")
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert fact in done.stderr
    assert names(tmp_path) == before


def test_an_output_folder_that_cannot_be_made_is_refused(illum, scene, tmp_path):
    (tmp_path / "file").write_text("")
    done = illum("render", scene, "-o", "file/x.png")
    assert done.returncode == 5, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert names(tmp_path) == ["ball.yaml", "file"]


def test_unknown_layers_formats_and_commands_are_usage_errors(illum, scene):
    for words, fact in (
        (("render", scene, "--only", "dept"), "depth"),
        (("render", scene, "-o", "x.jpg"), ".exr or .png"),
        (("rendr", scene), "render"),
        (("render", scene, "-o", "{scen}.png"), "scene"),
    ):
        done = illum(*words)
        assert done.returncode == 2, words
        assert fact in done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_by_that_signal_and_leaves_no_file(scene, tmp_path, number):
    words = ["render", str(scene), "-D", "film={width: 4000, height: 4000, samples: 16}", "-o", "big.exr"]
    with subprocess.Popen([sys.executable, "-m", "illumcli", *words], cwd=tmp_path, env=os.environ) as run:
        deadline = time.monotonic() + 60
        while run.poll() is None and not any(name.endswith(".part") for name in os.listdir(tmp_path)):
            assert time.monotonic() < deadline, "the run never began to write"
            time.sleep(0.05)
        run.send_signal(number)
        assert run.wait(timeout=30) == -number
    assert names(tmp_path) == ["ball.yaml"]


def test_pixels_of_a_film_with_background_have_no_alpha(illum, scene, tmp_path):
    illum("render", scene, "-D", "film.background=[0.1,0.2,0.3]", "-o", "b.exr")
    image = read_image(tmp_path / "b.exr")
    assert set(image.channels) == {"R", "G", "B"}
    np.testing.assert_allclose([image.channels[c][0, 0] for c in "RGB"], [0.1, 0.2, 0.3], atol=1e-3)

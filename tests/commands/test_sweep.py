"""`illum sweep` for its users: variants, their names, the bytes of single renders, resumption."""

from __future__ import annotations

import csv
import gc
import json
import os
import re
from collections import Counter

import numpy as np
import pytest

from illumcli.cache import fingerprint
from illumcli.cache.fingerprint import file_digest as digest
from illumcli.commands import held_works
from illumcli.commands.options import RenderOptions
from illumcli.commands.sweep import sweep_scene
from illumcli.commands.sweep_files import SweepFiles
from illumcli.errors import InputError, OutputError
from illumcli.graph import Node, short_name
from illumcli.images.reader import read_image
from illumcli.scene.spec import Scene
from illumcli.scene.variants import variants_of

SCENE = """
version: 1
film: {width: 32, height: 24, samples: 2}
ambient: 0.2
obscurance: {samples: 4}
materials:
  clay: {model: blinn_phong, diffuse: [0.6, 0.4, 0.3], specular: 0.3}
objects:
  - {name: ball, mesh: {shape: sphere}, material: clay}
  - {mesh: {shape: plane, size: [8, 8]}, transform: {translate: [0, -1, 0]}}
lights:
  - {light: point, name: key, position: [3, 4, 5], intensity: 30}
outputs: {files: ["{scene}.png"]}
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    return path


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (["-D", "seed=1,2"], ["ball-1.left", "ball-1.right", "ball-2.left", "ball-2.right"]),
        (["--only", "depth", "--only", "uv", "-D", "cameras.right=null"], ["ball.depth", "ball.uv"]),
        (["-D", "cameras=null", "-D", "camera={fov: 30},{fov: 40}"], ["ball-_fov_30_", "ball-_fov_40_"]),
        (["--frames", "7:7"], ["ball.left.0007", "ball.right.0007"]),
        (["-D", "cameras=no:null,one:{a: {}},two:{a: {}, b: {}}"],
         ["ball-no.main", "ball-one.a", "ball-two.a", "ball-two.b"]),
    ],
)  # fmt: skip
def test_default_names_tell_cameras_and_layers_apart(illum, scene, tmp_path, words, written):
    scene.write_text(SCENE + "cameras: {left: {}, right: {}}\n")
    done = illum("sweep", scene, *words, "-D", "film.width=8")
    assert sorted(done.stdout.split()) == [f"{name}.png" for name in written], done.stderr


@pytest.mark.parametrize(
    ("words", "pattern", "said"),
    [
        (
            {"texts": ["film.exposure=" + ",".join("0" * 50_000)]},
            None,
            "50000 variants (1, 2, 3, ",
        ),
        ({"texts": ["film.exposure=1,2,1"]}, "{film.exposure}.png", "2 variants (1, 3); they are equal;"),
        (
            {"texts": ["film.exposure=0:1:90000"]},
            "{scene}.png",
            "add a field to the pattern in which they differ",
        ),
        ({"texts": ["seed=1,2"], "frames": "0:9"}, "{seed}.png", "the name of 10 variants"),
        ({"texts": ["seed=1,2"]}, "{layer}.png", "the name of 2 variants"),
    ],
)
def test_names_that_are_equal_by_their_pattern_are_told_without_reading_a_scene(
    tmp_path, words, pattern, said
):
    with pytest.raises(InputError, match=re.escape(said)):
        sweep_scene(
            tmp_path / "none.yaml", variants_of(**{"texts": [], **words}), RenderOptions(pattern=pattern)
        )


def test_equal_values_that_go_with_others_are_variants(scene, tmp_path):
    variants = variants_of(["film.exposure=0,0", "seed=1,2"], together=True)
    done = sweep_scene(scene, variants, RenderOptions(pattern=str(tmp_path / "{seed}.png")))
    assert len(done.outcomes) == 2


@pytest.fixture
def runs(monkeypatch):
    """How often each node computed its buffer; nodes that load one from a cache do not count."""
    counts = Counter()

    def run(node, buffers, original=Node.run):
        if not short_name(node.function).startswith("_"):
            counts[node.output.partition(":")[0]] += 1
        return original(node, buffers)

    monkeypatch.setattr(Node, "run", run)
    return counts


@pytest.mark.parametrize(
    ("change", "camera", "once"),
    [
        ("objects.0.transform.translate=[0,0,0],[0.1,0,0],[0.2,0,0]", "", ["mesh", "meshes"]),
        (
            "objects.0.transform.translate=[0,0,0],[0.1,0,0],[0.2,0,0]",
            "camera: {fit: ball}",
            ["mesh", "meshes"],
        ),
        ("camera.position=[0,1,6],[0,2,6],[0,3,6]", "", ["mesh", "meshes", "geometry", "tracer"]),
        ("film.samples=1,2,4", "", ["mesh", "meshes", "geometry", "tracer"]),
    ],
    ids=["object", "object that fills the picture", "camera", "samples"],
)
def test_what_no_variant_changes_is_computed_once(scene, tmp_path, runs, change, camera, once):
    scene.write_text(f"{SCENE}\n{camera}")
    options = RenderOptions(pattern=str(tmp_path / f"{{{change.partition('=')[0]}}}.png"), cache=False)
    sweep_scene(scene, variants_of([change]), options)
    assert {name: runs[name] for name in once} == {name: 2 if name == "mesh" else 1 for name in once}
    assert runs["samples"] >= 3 or runs["hits"] >= 3


def scenes_in_memory():
    """The number of scenes that anything holds, tests before this one included."""
    gc.collect()
    return sum(isinstance(each, Scene) for each in gc.get_objects())


def test_many_variants_hold_no_scene(scene, tmp_path):
    options = RenderOptions(pattern=str(tmp_path / "{ambient}.png"), cache=False)
    before = scenes_in_memory()
    done = sweep_scene(scene, variants_of(["ambient=0.1:0.6:6"]), options)
    assert scenes_in_memory() == before
    first, *others = [outcome.report for outcome in done.outcomes[1:-1]]
    assert all(report.skipped is first.skipped and report.reused is first.reused for report in others)


@pytest.mark.parametrize("held", [1, 256])
def test_what_others_write_to_the_scene_and_its_mesh_meanwhile_is_not_seen(tmp_path, monkeypatch, held):
    monkeypatch.setattr(held_works, "HELD", held)
    read = []
    monkeypatch.setattr(fingerprint, "file_digest", lambda path: read.append(path.name) or digest(path))
    mesh = tmp_path / "a.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = tmp_path / "a.yaml"
    scene.write_text("version: 1\nfilm: {width: 8, height: 8}\nambient: 0.1\nobjects: [{mesh: a.obj}]\n")
    options = RenderOptions(pattern=str(tmp_path / "{film.exposure}.png"), cache=False)

    def changed(outcome):
        for path in (mesh, scene):
            path.write_text("no longer")

    done = sweep_scene(scene, variants_of(["film.exposure=0,1,2,3"]), options, written=changed)
    assert [outcome.error for outcome in done.outcomes] == [None] * 4
    assert read == ["a.obj"] * 2  # before the first variant, and once its mesh is read


def test_variants_are_the_bytes_of_single_renders(illum, scene, tmp_path):
    done = illum("sweep", scene, "-D", "materials.clay.exponent=4:256:3log", "-D", "ambient=0.1,0.6",
                 "--table", "t.csv", "--sheet", "s.png", "--reference", "1",
                 "--report", "r.json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    names = done.stdout.split()
    assert names[:2] == ["ball-004-0.1.png", "ball-004-0.6.png"]
    assert len(names) == 6
    for exponent, ambient in ((4, 0.6), (256, 0.1)):
        single = illum("render", scene, "--no-cache", "-D", f"materials.clay.exponent={exponent}",
                       "-D", f"ambient={ambient}", "-o", "one.png", "--force")  # fmt: skip
        assert single.returncode == 0, single.stderr
        swept = tmp_path / f"ball-{exponent:03d}-{ambient}.png"
        assert swept.read_bytes() == (tmp_path / "one.png").read_bytes()
    with (tmp_path / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows] == ["rendered"] * 6
    assert [row["rays"] != "0" for row in rows] == [True] + [False] * 5
    assert float(rows[0]["rmse"]) == 0
    assert float(rows[1]["rmse"]) > 0
    assert read_image(tmp_path / "s.png").width > 2 * 32
    assert [each["values"]["ambient"] for each in json.loads((tmp_path / "r.json").read_text())][:2] == [
        "0.1",
        "0.6",
    ]


def test_a_sheet_replaces_no_picture_of_its_sweep(illum, scene, tmp_path):
    (tmp_path / "x").mkdir()
    words = ("-D", "ambient=0.1,0.2", "-D", "film.width=8", "-o", "{ambient}.png")
    done = illum("sweep", scene, *words, "--sheet", "x/../0.1.png", "--force")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--sheet x/../0.1.png: a picture of the sweep has this name" in done.stderr


@pytest.mark.parametrize("reconstruct", ["false", "true"])
def test_what_is_stored_needs_the_hits_although_its_nodes_do_not_read_them(
    illum, scene, tmp_path, reconstruct
):
    """The second variant reads obscurance from memory. A render alone states its audited error, too."""
    about, layers = "obscurance.about", ["--only", "obscurance", "--only", "normal"]
    same = ["-D", f"obscurance.reconstruct={reconstruct}", *layers]
    done = illum("sweep", scene, "-D", f"{about}=shading,geometric", *same, "-o", "{obscurance.about}.exr")
    assert done.returncode == 0, done.stderr
    illum("render", scene, "--no-cache", "-D", f"{about}=geometric", *same, "-o", "single.exr")
    single, swept = (read_image(tmp_path / name) for name in ("single.exr", "geometric.exr"))
    assert single.channels.keys() == swept.channels.keys()
    for name, values in single.channels.items():
        np.testing.assert_array_equal(values, swept.channels[name])
    more = {"illum:audited_error", "illum:body"}
    assert {key: value for key, value in single.metadata.items() if key not in more} == {
        key: value for key, value in swept.metadata.items() if key not in more
    }


def test_a_sweep_goes_on_where_it_stopped(illum, scene, tmp_path):
    axis = "materials.clay.specular=0.1,0.2,0.3"
    assert illum("sweep", scene, "-D", axis).returncode == 0
    (tmp_path / "ball-0.2.png").unlink()
    held = {path.name: (path.stat().st_ino, os.utime(path, (1e9, 1e9))) for path in tmp_path.glob("*.png")}
    again = illum("sweep", scene, "-D", axis, "--table", "t.csv")
    assert again.stdout.split() == ["ball-0.1.png", "ball-0.2.png", "ball-0.3.png"]
    assert again.stderr.count("kept") == 2
    for name, (inode, _) in held.items():  # the same file, dated now
        assert (tmp_path / name).stat().st_ino == inode
        assert (tmp_path / name).stat().st_mtime > scene.stat().st_mtime
    assert [line.split(",")[5] for line in (tmp_path / "t.csv").read_text().split()] == [
        "state", "kept", "rendered", "kept"
    ]  # fmt: skip


def test_a_failed_sweep_leaves_a_whole_sheet_as_it_is(illum, scene, tmp_path):
    axis = "materials.clay.specular=0.1,0.2"
    assert illum("sweep", scene, "-D", axis, "--sheet", "s.png").returncode == 0
    whole = (tmp_path / "s.png").read_bytes()
    (tmp_path / "ball-0.4.png").mkdir()
    more = "materials.clay.specular=0.3,0.4"
    done = illum("sweep", scene, "-D", more, "--sheet", "s.png", "--force")
    assert done.returncode == 5
    assert (tmp_path / "s.png").read_bytes() == whole
    assert "s.png: stays as it is" in done.stderr
    # one that lacks pictures is replaced by a better one
    assert illum("sweep", scene, "-D", more, "--sheet", "half.png").returncode == 5
    half = (tmp_path / "half.png").read_bytes()
    (tmp_path / "ball-0.4.png").rmdir()
    assert illum("sweep", scene, "-D", more, "--sheet", "half.png").returncode == 0
    assert (tmp_path / "half.png").read_bytes() != half


def test_pictures_that_vanish_before_the_table_is_written_are_exit_5(scene, tmp_path):
    def gone(outcome):
        for path in outcome.paths:
            path.unlink()

    variants = variants_of(["materials.clay.specular=0.1,0.2"])
    files = SweepFiles(table=tmp_path / "t.csv")
    settings = RenderOptions(pattern=str(tmp_path / "o" / "{materials.clay.specular}.png"), cache=False)
    with pytest.raises(OutputError, match="has been removed since"):
        sweep_scene(scene, variants, settings, files, written=gone)


def test_a_moving_light_casts_its_own_rays_alone(illum, scene, tmp_path):
    moving = "lights.key.position=[3*cos(frame), 4, 3*sin(frame)]"
    done = illum("sweep", scene, "--frames", "0:3", "-D", moving, "--no-cache", "--report", "r.json")
    assert done.stdout.split() == [f"ball.{k:04d}.png" for k in range(4)]
    rays = [each["rays"] for each in json.loads((tmp_path / "r.json").read_text())]
    assert set(rays[0]) == {"hits", "obscurance", "shadow:key"}
    assert all(set(each) == {"shadow:key"} for each in rays[1:])


def test_what_has_an_effect_in_some_variant_is_not_told(scene, tmp_path):
    """Without ambient light the obscurance weighs nothing; the same key with the film's filter never does."""
    variants = variants_of(
        ["ambient=0,0.2", "film={width: 4, height: 4, samples: 1, filter: {filter: tent}}"]
    )
    done = sweep_scene(scene, variants, RenderOptions(pattern=str(tmp_path / "{ambient}.png"), cache=False))
    assert len(done.warnings) == 1
    assert "a single sample looks" in done.warnings[0]


def test_faults_of_values_are_told_first_and_the_other_variants_are_done(illum, scene, tmp_path):
    words = ("sweep", scene, "-D", "materials.clay.exponent=-1,4,x")
    stopped = illum(*words, "--stop-at-first")
    assert stopped.returncode == 2
    assert not list(tmp_path.glob("*.png"))
    done = illum(*words, "--table", "t.csv", "--report", "r.json")
    assert (done.returncode, done.stdout) == (2, "ball-4.png\n")
    assert done.stderr.splitlines() == [
        "exponent -1: -D materials.clay.exponent=-1: must be at least 0, is -1",
        "exponent x: -D materials.clay.exponent=x: must be a number, is text 'x'",
        "2 of 3 variants failed",
    ]
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert [row["state"] for row in rows] == ["failed", "rendered", "failed"]
    assert [row["content"] == "incomplete" for row in rows] == [True, False, True]
    assert "must be at least 0" in json.loads((tmp_path / "r.json").read_text())[0]["error"]

    mended = illum("sweep", scene, "-D", "materials.clay.exponent=-1,4", "--table", "t.csv")
    assert mended.returncode == 5
    assert "t.csv: a different file is there" in mended.stderr


def test_warnings_are_told_where_a_variant_failed_too(illum, scene):
    tent = "film={width: 4, height: 4, samples: 1, filter: {filter: tent}}"
    done = illum("sweep", scene, "-D", "materials.clay.exponent=-1,4", "-D", tent)
    assert done.returncode == 2
    assert "a single sample looks" in done.stderr
    assert "1 of 2 variants failed" in done.stderr


def test_names_that_clash_are_told_before_anything_is_rendered(illum, scene, tmp_path):
    clash = illum("sweep", scene, "-D", "ambient=0.1,0.2", "-o", "same.png")
    assert clash.returncode == 2
    assert "same.png: the name of 2 variants" in clash.stderr


def test_a_variant_that_fails_is_told_and_the_others_go_on(illum, scene, tmp_path):
    (tmp_path / "bad.obj").write_text("f 1 2 3\n")
    done = illum("sweep", scene, "-D", "objects.0.mesh={shape: sphere},bad.obj,{shape: box}", "-o", "{frame}-"
                 "{objects.0.mesh}.png")  # fmt: skip
    assert done.returncode == 2
    assert len(list(tmp_path.glob("*.png"))) == 2
    assert "1 of 3 variants failed" in done.stderr


def test_names_of_values_and_rows_name_files_and_tables(illum, scene, tmp_path):
    (tmp_path / "rows.csv").write_text("label,ambient\ndim,0.1\nbright,0.9\n")
    done = illum("sweep", scene, "--rows", "rows.csv", "-D", "film.exposure=low:0,1", "--table", "t.csv")
    assert done.returncode == 0, done.stderr
    names = ["dim-low", "dim-1", "bright-low", "bright-1"]
    assert done.stdout.split() == [f"ball-{name}.png" for name in names]
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert [row["label"] for row in rows] == [
        "dim, low",
        "dim, exposure 1",
        "bright, low",
        "bright, exposure 1",
    ]

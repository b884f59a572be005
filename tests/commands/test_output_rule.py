"""Files that commands write: kept if equal, never replaced without `--force`, faults reported first."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys

import pytest

SCENE = """
version: 1
film: {width: 16, height: 12, samples: 1}
ambient: 0.2
obscurance: {samples: 2}
objects: [{mesh: {shape: sphere}}, {mesh: {shape: plane, size: [8, 8]}}]
lights: [{light: point, position: [3, 4, 5], intensity: 30}]
"""
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0.2\nv 0.4 0.3 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
SWEEP = "sweep s.yaml -D ambient=0.1,0.2 -o {ambient}.png"
OTHER = "sweep s.yaml -D film.height=8,9 -o x{film.height}.png"
CONVERGE = "converge s.yaml --from 2 --to 4 --repeats 1"

# what is written: by which words, and by which other words another one of the same name
WRITERS = {
    "new/render.json": ("render s.yaml -o a.png --report", "render s.yaml -D ambient=0.3 -o b.png --report"),
    "new/sweep.json": (f"{SWEEP} --report", f"{OTHER} --report"),
    "new/sweep.csv": (f"{SWEEP} --table", f"{OTHER} --table"),
    "new/sweep.png": (f"{SWEEP} --sheet", f"{OTHER} --sheet"),
    "new/bake.json": ("ao-bake m.obj --samples 4 -o a.npz --report", "ao-bake m.obj -o b.npz --report"),
    "new/compare.png": ("compare 1.png 2.png --no-flip --heat", "compare 1.png 3.png --no-flip --heat"),
    "new/converge.csv": (f"{CONVERGE} --csv", f"{CONVERGE} --seed 3 --csv"),
    "new/converge.svg": (f"{CONVERGE} -o", f"{CONVERGE} --seed 3 -o"),
    "new/converge.png": (f"{CONVERGE} -o", f"{CONVERGE} --seed 3 -o"),
    "new/brdf.csv": ("brdf phong --csv", "brdf phong -D exponent=3 --csv"),
    "new/render.exr": ("render s.yaml -o", "render s.yaml -D ambient=0.3 -o"),
    "new/bake.ply": ("ao-bake m.obj --samples 4 -o", "ao-bake m.obj --samples 8 -o"),
}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    (folder / "s.yaml").write_text(SCENE)
    (folder / "m.obj").write_text(MESH)
    words = ["sweep", "s.yaml", "-D", "ambient=1,2,3", "-o", "{ambient}.png"]
    subprocess.run([sys.executable, "-m", "illumcli", *words], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture
def folder(tmp_path, pictures):
    shutil.copytree(pictures, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_kept_or_refused_or_replaced_by_force(illum, folder, name):
    same, other = (words.split() for words in WRITERS[name])
    path = folder / name
    first = illum(*same, name)
    assert first.returncode == 0, first.stderr
    held, inode = path.read_bytes(), path.stat().st_ino
    os.utime(path, (1e9, 1e9))

    again = illum(*same, name)
    assert again.returncode == 0, again.stderr
    assert (path.read_bytes(), path.stat().st_ino) == (held, inode)
    assert path.stat().st_mtime > 1.5e9
    assert f"{name}: kept, its content is the same" in again.stderr

    before = sorted(each.name for each in folder.iterdir())
    refused = illum(*other, name)
    assert refused.returncode == 5, refused.stderr
    assert refused.stderr.startswith(f"{name}: a different file is there; use --force")
    assert (path.read_bytes(), path.stat().st_ino) == (held, inode)
    assert sorted(each.name for each in folder.iterdir()) == before  # nothing was rendered for it
    assert illum(*other, name, "--force").returncode == 0
    assert path.read_bytes() != held


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_wrong_with_a_file_is_told_before_the_first_ray(illum, folder, name):
    (folder / "file").write_text("")
    before = sorted(each.name for each in folder.rglob("*"))
    for wrong, code, fact in (
        (name.replace("new", "file"), 5, "part of the path is a file"),
        (name.rpartition(".")[0] + ".jpg", 2, ".jpg"),
    ):
        done = illum(*WRITERS[name][0].split(), wrong)
        assert done.returncode == code, (wrong, done.stderr)
        assert fact in done.stderr
        assert "Traceback" not in done.stderr
        assert sorted(each.name for each in folder.rglob("*")) == before, wrong


@pytest.mark.parametrize("name", ["new/render.exr", "new/bake.ply", "new/sweep.csv", "new/render.json"])
def test_a_name_of_254_bytes_is_written_and_a_longer_one_is_not(illum, folder, name):
    suffix = name[-4:] if name[-4] == "." else name[-5:]
    words, stem = WRITERS[name][0].split(), "é" * 124 + "n" * (6 - len(suffix))
    assert len((stem + suffix).encode()) == 254
    done = illum(*words, stem + suffix)
    assert done.returncode == 0, done.stderr
    assert (folder / (stem + suffix)).is_file()
    before = sorted(each.name for each in folder.rglob("*"))
    done = illum(*words, "é" + stem + suffix, "--force")
    assert done.returncode == 5
    assert "shorten the name" in done.stderr
    assert sorted(each.name for each in folder.rglob("*")) == before


def test_references_are_looked_at_before_the_first_ray(illum, folder):
    illum("render", "s.yaml", "-D", "film.width=20", "-o", "wide.png")
    illum("render", "s.yaml", "-o", "linear.exr")
    words = ("sweep", "s.yaml", "-D", "ambient=0.5,0.6", "--table", "t.csv", "--reference")
    before = sorted(each.name for each in folder.iterdir())
    for reference, fact in (
        ("3", "there are variants 1 to 2"),
        ("0", "there are variants 1 to 2"),
        ("none.png", "none.png"),
        ("s.yaml", "s.yaml"),
        ("wide.png", "s-0.5.png is 16 x 12, the reference 20 x 12"),
        ("linear.exr", "s-0.5.png holds display values, the reference linear light"),
    ):
        done = illum(*words, reference)
        assert done.returncode == 2, (reference, done.stderr)
        assert fact in done.stderr
        assert sorted(each.name for each in folder.iterdir()) == before
    clash = illum("sweep", "s.yaml", "-D", "film.width=16,18", "--table", "t.csv", "--reference", "1")
    assert (clash.returncode, sorted(each.name for each in folder.iterdir())) == (2, before)
    assert illum(*words, "1.png").returncode == 0
    assert illum(*words, "1.png").stderr.count("kept") == 3
    assert illum(*words, "2.png").returncode == 5
    assert illum(*words, "s-0.6.png", "--force").returncode == 0
    second = list(csv.DictReader((folder / "t.csv").read_text().splitlines()))[1]
    assert (second["rmse"], second["psnr"], second["largest"]) == ("0", "inf", "0")


def test_a_report_says_what_failed(illum, folder):
    (folder / "bad.yaml").write_text("version: 1\nambient: -1\n")
    done = illum("render", "s.yaml", "bad.yaml", "none.yaml", "-o", "{scene}.png", "--report", "r.json")
    assert (done.returncode, done.stdout) == (2, "s.png\n")
    entries = json.loads((folder / "r.json").read_text())
    assert [each["content"] == "incomplete" for each in entries] == [False, True, True]
    assert entries[1]["error"] == "bad.yaml:2:1: ambient: must be at least 0, is -1"
    (folder / "bad.yaml").write_text(SCENE)
    (folder / "none.yaml").write_text(SCENE)
    again = illum("render", "s.yaml", "bad.yaml", "none.yaml", "-o", "{scene}.png", "--report", "r.json")
    assert again.returncode == 0, again.stderr
    assert "error" in json.loads((folder / "r.json").read_text())[1]


@pytest.mark.parametrize("name", WRITERS)
def test_no_file_is_made_through_a_link_to_nothing(illum, folder, name):
    (folder / "new").mkdir()
    (folder / name).symlink_to(folder / "elsewhere")
    words = WRITERS[name][0].split()
    done = illum(*words, name)
    assert done.returncode == 5, done.stderr
    assert "is a link to nothing; use --force" in done.stderr
    assert not (folder / "elsewhere").exists()

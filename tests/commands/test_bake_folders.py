"""`illum ao-bake` of folders: which files are baked, what is told of the others, and builds by make."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "obscurance.md"
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0.2\nv 0.4 0.3 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
BAKE = ("ao-bake", "meshes", "-o", "baked/{name}.glb", "--samples", "4")


@pytest.fixture
def folder(tmp_path):
    """20 meshes, of which one is faulty, and other files."""
    meshes = tmp_path / "meshes"
    (meshes / "more").mkdir(parents=True)
    for number in range(19):
        (meshes / f"part{number:02d}.obj").write_text(MESH.replace("0.4", f"0.{number + 1}"))
    (meshes / "part19.obj").write_text(MESH.replace("0.3", "nonsense"))
    for name in ("notes.txt", "part.mtl", "table.yaml", ".hidden.obj"):
        (meshes / name).write_text("")
    return tmp_path


def test_a_folder_with_a_faulty_mesh_and_one_that_is_up_to_date(illum, folder):
    first = illum(*BAKE[:1], "meshes/part07.obj", *BAKE[2:])
    assert first.returncode == 0, first.stderr

    done = illum(*BAKE)
    assert done.returncode == 2
    assert done.stdout.splitlines() == [f"baked/part{number:02d}.glb" for number in range(19)]
    told = done.stderr.splitlines()
    assert told[:4] == [
        "meshes: passed over more: folders in folders are not searched, name them",
        "meshes: passed over notes.txt, part.mtl: no mesh files",
        "meshes: passed over table.yaml: scenes are baked if they are named",
        told[3],
    ]
    assert told[3].startswith("meshes/part19.obj:4")
    assert told[4].startswith("meshes/part00.obj: 4 vertices: obscurance error 0")
    assert "baked/part07.glb: kept, its content is the same" in told
    assert told[-1] == "1 of 20 inputs failed"
    assert len(told) == 4 + 19 + 1


def test_files_that_several_inputs_would_write_are_told_all_at_once(illum, folder):
    for name in ("a.obj", "a.ply", "b.obj", "b.PLY", "c.obj"):
        (folder / name).write_text(MESH)
    done = illum("ao-bake", "a.obj", "a.ply", "b.obj", "b.PLY", "c.obj", "-o", "x/{name}.npz", "-q")
    assert done.returncode == 2
    assert [line.partition(";")[0] for line in done.stderr.splitlines()] == [
        "x/a.npz: the name of the outputs of a.obj, a.ply",
        "x/b.npz: the name of the outputs of b.obj, b.PLY",
    ]
    assert not (folder / "x").exists()


def test_files_baked_into_their_own_folder_are_not_baked_again(illum, folder):
    (folder / "meshes" / "part19.obj").unlink()
    first = illum(*BAKE[:2], "-o", "meshes/{name}.ao.glb", "--samples", "4")
    again = illum(*BAKE[:2], "-o", "meshes/{name}.ao.glb", "--samples", "4")
    assert (first.returncode, again.returncode, again.stdout) == (0, 0, first.stdout)
    assert "meshes: passed over part00.ao.glb, part01.ao.glb, part02.ao.glb, part03.ao.glb" in again.stderr
    assert "part04.ao.glb and 14 more: baked by illum" in again.stderr


def test_a_folder_without_meshes(illum, folder):
    done = illum("ao-bake", "meshes", "meshes/more", "-o", "{name}.npz")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "meshes/more: has no mesh files; name a folder that has some\n"


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_does_nothing_the_second_time(folder):
    for number in range(3, 20):
        (folder / "meshes" / f"part{number:02d}.obj").unlink()
    (makefile,) = re.findall(r"^```make\n(.*?)^```", PAGE.read_text(), flags=re.M | re.S)
    (folder / "Makefile").write_text(makefile)
    program = folder / "illum"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m illumcli "$@"\n')
    program.chmod(0o755)
    command = ["make", "-j2", f"ILLUM={program}", "SAMPLES=4"]
    first = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert first.returncode == 0, first.stderr
    assert len(list((folder / "baked").glob("*.glb"))) == 3
    again = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (again.returncode, again.stdout) == (0, "make: Nothing to be done for 'all'.\n")
    (folder / "meshes" / "part01.obj").write_text(MESH)
    third = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert third.stdout.count("ao-bake") == 1

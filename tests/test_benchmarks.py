"""Benchmarks run on tiny inputs and print their question and rows; the figures themselves are not tested."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from illumcli.geometry.shapes.torus import Torus

SCRIPTS = {
    "clusters": "same bytes: 8 of 8",
    "python": "ratio loop, PNGs / illum sweep",
    "startup": "ratio tiny render / six libraries",
    "stages": "beside the job",
    "threads": "what the machine gives",
    "scaling": "peak [MiB]",
    "growth": "exponent time",
    "memory": "cpu per pixel",
    "instances": "memory / one",
    "replay": "ratio whole / rays alone",
    "packets": "\n0 of ",
    "adaptive": "to full: RMSE",
    "reconstruction": "blades",
    "gonioreflectometer": "mirror grooves of many slopes",
    "fits": "RMS z",
    "view": "resident [MiB]",
}


def printed(root, tmp_path, name, *words):
    """What a script prints; it must end well."""
    command = [sys.executable, str(root / "benchmarks" / f"{name}.py"), "--small", *words]
    environment = {**os.environ, "PYTHONPATH": str(root / "src"), "ILLUM_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_tiny_version_runs(root, tmp_path, name):
    text = printed(root, tmp_path, name)
    assert text.startswith("# ")
    assert text.partition("\n")[0].endswith("?")
    assert "SMALL" in text
    assert SCRIPTS[name] in text


def test_pov_ray_draws_the_same_picture(root, tmp_path):
    if shutil.which("povray") is None:
        pytest.skip("needs POV-Ray: apt-get install povray")
    text = printed(root, tmp_path, "peers", "povray")
    assert float(text.partition("difference of the pictures: RMSE ")[2].split()[0]) < 0.02


def test_mitsuba_draws_the_same_picture(root, tmp_path):
    if not os.environ.get("PEERS"):
        pytest.skip("needs PEERS, the python of an environment with mitsuba")
    text = printed(root, tmp_path, "peers", "mitsuba")
    assert float(text.partition("difference of the references: RMSE ")[2].split()[0]) < 0.06


def test_mitsuba_draws_the_same_rough_conductors(root, tmp_path):
    if not os.environ.get("PEERS"):
        pytest.skip("needs PEERS, the python of an environment with mitsuba")
    rows = printed(root, tmp_path, "rough_conductors").splitlines()[-6:]
    # after the name: lit, alone, then three differences, and three with Mitsuba's own masking of Beckmann
    numbers = [row.partition("  ")[2].split() for row in rows]
    medians = [float(row[5] if len(row) > 5 else row[2]) for row in numbers]
    assert max(medians) < 1e-5


def test_three_js_draws_the_same_materials(root, tmp_path):
    if not os.environ.get("THREE") or shutil.which("chromedriver") is None:
        pytest.skip("needs THREE, a folder node_modules with three, and chromedriver")
    text = printed(root, tmp_path, "gltf_peers", os.environ["THREE"])
    rows = [line.split()[-3:] for line in text.splitlines() if line.startswith("plain ")]
    assert float(rows[-1][0]) < 0.01 < float(rows[0][1])


@pytest.fixture
def torus(tmp_path):
    shape = Torus(segments=24, sides=12).mesh()
    lines = [f"v {x} {y} {z}" for x, y, z in shape.vertices]
    polygons = np.split(shape.corners + 1, shape.starts[1:-1])
    path = tmp_path / "torus.obj"
    path.write_text("\n".join(lines + [f"f {' '.join(map(str, p))}" for p in polygons]))
    return path


def test_w_jumps_less_about_interpolated_normals(root, tmp_path, torus):
    row = printed(root, tmp_path, "ao_facets", str(torus)).splitlines()[-1].split()
    edges, geometric, shading = int(row[1]), float(row[2]), float(row[3])
    assert edges == 20
    assert shading < geometric / 2


def test_pictures_with_baked_values_agree_with_those_without(root, tmp_path, torus):
    row = printed(root, tmp_path, "ao_agree", str(torus)).splitlines()[-1].split()
    assert float(row[1]) >= 0.7  # of 20
    assert float(row[2]) < 1.8
    assert float(row[4]) < 0.05


def test_textures_are_baked_and_their_error_is_checked(root, tmp_path, torus):
    pytest.importorskip("xatlas")
    row = printed(root, tmp_path, "texture_bake", str(torus)).splitlines()[-1]
    assert row.startswith("ours")
    assert float(row.partition("; error ")[2].partition(",")[0]) < 0.1


def test_the_error_of_reconstructed_values_is_stated(root, tmp_path, torus):
    options = ["--seeds", "2", "--reference", "256", "--rays", "16"]
    row = printed(root, tmp_path, "ao_reconstruction", str(torus), *options).splitlines()[-1].split()
    assert row[0] == "16"
    assert 0.7 < float(row[3]) < 1.4

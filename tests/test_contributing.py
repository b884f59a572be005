"""CONTRIBUTING's examples are complete: in their places they render and pass the shared tests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLE = re.compile(r"^`((?:src|tests)/[^`\n]*)`\n\n```(python|diff)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SCENE = """
version: 1
camera: {position: [2, 3, 4], target: [0, 0, 0], fov: 45}
film: {width: 32, height: 24, samples: 1}
ambient: 0.5
obscurance: {samples: 16, sampler: r2, falloff: {falloff: sine, max_distance: 1}}
frames: {last: 0}
materials: {dust: {model: lunar_lambert, diffuse: {curve: pulse, low: 0.5, high: 0.9}}}
lights: [{light: beam, position: [0, 0, 0], direction: [0, -1, 0], radius: 0.8, irradiance: 3}]
objects:
  - {mesh: {shape: star, radius: 3}, material: dust}
  - {mesh: pyramid.off, material: dust, shading: faceted}
outputs: {layers: [beauty, lights, obscurance, slope, incident_angles], files: [out.exr], colour: float}
"""
OFF = "OFF\n5 5 0\n-1 0 -1\n1 0 -1\n1 0 1\n-1 0 1\n0 1 0\n4 0 1 2 3\n3 0 4 1\n3 1 4 2\n3 2 4 3\n3 3 4 0\n"
CHECK = """
import numpy as np
from illumcli.images.reader import read_image

channels = read_image("out.exr").channels
slope = np.round(channels["slope.Y"], 3)
assert {0, 45} <= set(slope.ravel().tolist()), np.unique(slope)
lit, w = channels["beam1.G"] > 0, channels["obscurance.Y"]
on_star = (slope == 0) & (w > 0)
assert (lit & (slope == 45)).any()
assert (on_star & ~lit).any()
assert w[on_star].min() < 1

angle = np.round(channels["angle.beam1.Y"], 3)
assert np.array_equal(angle, slope)  # the light comes along y

shown = read_image("slope.png").channels["Y"]
assert np.allclose(shown * 180, slope, atol=0.4)
"""


def inserted(text: str, diff: str) -> str:
    """The text with the added lines of a diff, each below its context; those at the top are imports."""
    lines = text.splitlines(keepends=True)
    place = lines.index("from __future__ import annotations\n") + 1
    for line in diff.splitlines(keepends=True):
        if line.startswith("+"):
            lines.insert(place, line[1:])
            place += 1
        else:
            place = lines.index(line[1:] or "\n", place) + 1
    return "".join(lines)


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    """A copy of the package and the shared tests, with all examples in it."""
    folder = tmp_path_factory.mktemp("contributing")
    for name in ("src/illumcli", "tests/models", "tests/conftest.py", "tests/chromium.py",
                 "tests/visibility/test_samplers.py",
                 "tests/geometry/shapes/test_all_shapes.py",
                 "tests/test_layers.py", "tests/render_graph/test_polygons.py", "tests/planned.py",
                 "tests/quadrature.py", "tests/rgl_files.py", "scenes", "pyproject.toml"):  # fmt: skip
        place = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        place(ROOT / name, folder / name)
    examples = EXAMPLE.findall((ROOT / "CONTRIBUTING.md").read_text())
    assert len(examples) == 15
    for name, kind, block in examples:
        path = folder / name
        if kind == "diff":
            path.write_text(inserted(path.read_text(), block))
        else:
            assert not path.exists()
            path.write_text(block)
    run(folder, "ruff", "check", "--no-cache", "--fix", "--select", "I", "src")
    return folder


def run(folder: Path, *words: str, code: int = 0) -> str:
    """What a module of Python prints, run in the copy, where it ends with this exit code."""
    environment = {**os.environ, "PYTHONPATH": str(folder / "src"), "ILLUM_CACHE": str(folder / "cache")}
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_examples_are_clean(copy):
    files = [name for name, _, _ in EXAMPLE.findall((ROOT / "CONTRIBUTING.md").read_text())]
    run(copy, "ruff", "check", "--no-cache", *files)
    run(copy, "ruff", "format", "--no-cache", "--check", *files)


@pytest.mark.parametrize(
    ("tests", "names"),
    [
        ("tests/models", "LunarLambert or test_lunar_lambert"),
        ("tests/geometry/shapes/test_all_shapes.py", "star"),
        ("tests/visibility/test_samplers.py", "r2"),
        ("tests/render_graph/test_polygons.py", "faceted"),
        ("tests/test_layers.py", "layer"),
    ],
)
def test_examples_pass_the_shared_tests(copy, tests, names):
    assert "passed" in run(copy, "pytest", tests, "-k", names, "-p", "no:cacheprovider")


def test_a_scene_is_rendered_with_all_examples(copy):
    (copy / "scene.yaml").write_text(SCENE)
    (copy / "pyramid.off").write_text(OFF)
    run(copy, "illumcli", "render", "scene.yaml")
    run(copy, "illumcli", "render", "scene.yaml", "--only", "slope", "-o", "slope.png")
    (copy / "check.py").write_text(CHECK)
    run(copy, "check")
    falloff = ("--falloff", "sine", "--max-distance", "1", "--sampler", "r2", "--samples", "16")
    run(copy, "illumcli", "ao-bake", "pyramid.off", "-o", "w.npz", *falloff)
    refused = run(copy, "illumcli", "ao-bake", "pyramid.off", "-o", "w.npz", "--falloff", "sine", code=2)
    assert "--falloff sine needs --max-distance" in refused
    assert "once, as in dark dust" in run(copy, "illumcli", "models", "lunar_lambert")
    schema = run(copy, "illumcli", "schema")
    for name in ("slope", "incident_angles", "faceted", "r2"):
        assert f"`{name}`: " in schema

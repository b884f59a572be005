"""A small scene with a mesh file and several layers, and a way to run Python in a fresh process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCENE = """
version: 1
camera: {position: [1, 1.5, 3], target: [0.3, 0.3, 0]}
film: {width: 96, height: 64, samples: 1}
ambient: 0.3
obscurance: {samples: 16}
objects:
  - {mesh: thing.obj, material: {model: phong, exponent: 20}}
  - {mesh: {shape: plane, size: [4, 4]}}
lights: [{light: point, name: key, position: [2, 3, 2], intensity: 20}]
outputs: {layers: [beauty, obscurance, depth, normal], files: ["out/{scene}.exr", "out/{scene}-{layer}.png"]}
"""
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0.2\nv 0.4 0.3 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


@pytest.fixture
def folder(tmp_path):
    """A folder that holds the scene."""
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "thing.obj").write_text(MESH)
    return tmp_path


@pytest.fixture
def python(tmp_path):
    """Run a script in a fresh process; its output."""

    def run(script, *words, cwd=tmp_path, timeout=300, **environment):
        env = {**os.environ, "ILLUM_CACHE": str(tmp_path / "cache"), **environment}
        done = subprocess.run(
            [sys.executable, "-c", script, *map(str, words)],
            cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=timeout,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-4000:]
        return done.stdout

    return run

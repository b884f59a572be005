"""The unit of work: a description that can be sent to another process, and the function that does it."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.commands.work import prepared

SCENE = """
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.2
objects: [{mesh: {shape: sphere}}]
lights: [{light: directional, name: sun, direction: [-1, -2, -1], irradiance: 2}]
"""
WORKER = """
import pickle, sys
from illumcli.commands.render import render_scene
paths, report = render_scene(pickle.load(sys.stdin.buffer))
sys.stdout.buffer.write(pickle.dumps((paths, report)))
"""


@pytest.fixture
def job(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    options = RenderOptions(("ambient=0.4",), str(tmp_path / "{ambient}-{frame}.exr"), seed=3, threads=2)
    return RenderJob(tmp_path / "s.yaml", options, {"frame": 7})


def test_a_job_is_what_it_was_pickled_as(job):
    assert pickle.loads(pickle.dumps(job)) == job
    assert prepared(pickle.loads(pickle.dumps(job))).content == prepared(job).content


def test_another_process_makes_the_same_file(job, tmp_path):
    (path,), report = render_scene(job)
    assert path == tmp_path / "0.4-7.exr"
    own = path.read_bytes()
    path.unlink()
    done = subprocess.run(
        [sys.executable, "-c", WORKER], input=pickle.dumps(job), capture_output=True, check=True
    )
    (again,), other = pickle.loads(done.stdout)
    assert again == path
    assert path.read_bytes() == own
    assert (other.scene_hash, other.seed, other.written) == (report.scene_hash, 3, (str(path),))

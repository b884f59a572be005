"""A picture that is large beside the share of a worker, in bands on several workers."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from illumcli.cluster.address import address_of
from illumcli.cluster.runner import ClusterRunner
from illumcli.commands import bands
from illumcli.commands.options import RenderFiles, RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.commands.render_all import render_scenes
from illumcli.commands.runner import Here
from illumcli.progress import no_progress

FILES = "outputs.files=['{scene}.exr', '{scene}.{layer}.png']"
LARGE = ("film.width=96", "film.height=200", FILES)


def rendered(options, runner, report=None):
    done = []
    render_scenes([Path("s.yaml")], options, RenderFiles(report), runner, done.append, print)
    (only,) = done
    return only


def test_bands_make_the_picture_of_one_process(scene, monkeypatch):
    monkeypatch.chdir(scene.parent)
    monkeypatch.setattr(bands, "LEAST", 1)
    options = RenderOptions(LARGE, cache=False)
    whole = rendered(options, Here())
    expected = {path: path.read_bytes() for path in whole.paths}
    for path in expected:
        path.unlink()
    render_scene(RenderJob(Path("s.yaml"), options, rows=(0, 50)))  # as an interrupted command may leave them
    told = []
    runner = ClusterRunner(address_of("local:2"), False, told.append, lambda what, *_: told.append(what))
    done = rendered(options, runner, Path("r.json"))
    assert {path: path.read_bytes() for path in done.paths} == expected
    assert "bands" in told
    assert list(Path().glob("*rows*")) == []
    assert done.report.written == whole.report.written
    assert done.report.scene_hash == whole.report.scene_hash
    assert done.report.rays["obscurance"] == whole.report.rays["obscurance"]
    assert json.loads(Path("r.json").read_text())["written"] == list(whole.report.written)

    # A file that is missing is made again, the others stay.
    whole.paths[0].unlink()
    again = rendered(options, ClusterRunner(address_of("local:2"), False, print, no_progress))
    assert again.report.written == (str(whole.paths[0]),)
    assert again.report.kept == tuple(map(str, whole.paths[1:]))
    assert whole.paths[0].read_bytes() == expected[whole.paths[0]]


def test_workers_without_the_folder_send_their_bands(scene, machines, monkeypatch):
    if os.geteuid() != 0:
        pytest.skip("only root can hide a folder from a worker")
    monkeypatch.chdir(scene.parent)
    monkeypatch.setattr(bands, "LEAST", 1)
    options = RenderOptions(LARGE, cache=False)
    expected = {path: path.read_bytes() for path in rendered(options, Here()).paths}
    for path in expected:
        path.unlink()
    for _ in range(2):
        machines.start_hidden_worker()
    done = rendered(options, ClusterRunner(address_of(machines.address), False, print, no_progress))
    assert {path: path.read_bytes() for path in done.paths} == expected
    assert list(Path().glob("*rows*")) == []
    assert done.report.written == tuple(map(str, expected))

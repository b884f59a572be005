"""Pictures in bands of rows: the same bytes as at once."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from illumcli.commands import bands
from illumcli.commands.bands import LEAST, ROWS, CutJobs, band_counts, remove_bands, rows_of_bands
from illumcli.commands.options import RenderFiles, RenderJob, RenderOptions, Shard
from illumcli.commands.render import render_scene
from illumcli.commands.render_all import render_scenes
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.render_shard import render_shard
from illumcli.commands.runner import Here
from illumcli.commands.unit import Worker
from illumcli.images.picture_bands import join_bands
from ring import RING

LAYERS = "outputs.layers=[beauty, position, object_id, obscurance]"
FILES = "outputs.files=['{scene}.exr', '{scene}.{layer}.png']"


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.yaml").write_text(RING.format(samples=4, ambient=1))
    return tmp_path / "s.yaml"


@pytest.mark.parametrize(
    "overrides", [(), ("film.adaptive=true",), ("film.samples=1", "film.background=[0.1, 0.2, 0.3]")]
)
def test_joined_bands_are_the_bytes_of_the_picture(scene, tmp_path, overrides):
    job = RenderJob(scene, RenderOptions((LAYERS, FILES, *overrides), cache=False))
    pictures, whole = render_scene(job)
    expected = {path: path.read_bytes() for path in pictures}
    parts = [render_scene(replace(job, rows=rows)) for rows in pairwise((0, 8, 24, 36))]
    for number, path in enumerate(pictures):
        path.unlink()
        join_bands([paths[number] for paths, _ in parts], path)
        assert path.read_bytes() == expected[path]
    assert sum(report.rays.get("obscurance", 0) for _, report in parts) == whole.rays["obscurance"]


def test_bands_of_another_cut_are_removed_and_files_of_others_stay(scene, tmp_path):
    job = RenderJob(scene, RenderOptions((LAYERS, "outputs.files=['{scene}.exr']"), cache=False))
    for rows in ((0, 8), (8, 36), (0, 20)):
        render_scene(replace(job, rows=rows))
    other = replace(job, rows=(20, 36), options=replace(job.options, seed=5))
    (band_of_other_content,), _ = render_scene(other)
    foreign = tmp_path / "s.rows-00040-00050.exr"
    foreign.write_text("an image?")
    (picture,) = Worker().prepare(job).targets
    remove_bands(picture)
    assert sorted(Path().glob("*.exr")) == sorted([band_of_other_content, Path(foreign.name)])


def test_large_pictures_are_cut_and_small_ones_stay_whole():
    large = 10 * LEAST
    assert band_counts([large], 1) == [1]
    assert band_counts([large], 2) == [8]
    assert band_counts([LEAST - 1], 2) == [1]
    assert band_counts([large] * 10, 2) == [1] * 10
    assert band_counts([large, LEAST, large], 3) == [6, 1, 6]


def test_bands_have_whole_blocks_and_end_with_the_picture(scene):
    (view,) = Worker().prepare(RenderJob(scene)).graph.views
    for height, count in ((36, 4), (640, 4), (1000, 3), (65, 9)):
        rows = rows_of_bands(replace(view, height=height), count)
        assert len(rows) <= count
        assert [first for first, _ in rows] == [0, *(end for _, end in rows[:-1])]
        assert rows[-1][1] == height
        assert all(first % ROWS == 0 for first, _ in rows)


@pytest.mark.parametrize(
    "options", [RenderOptions(("obscurance.reconstruct=true",)), RenderOptions(target_error=0.1)]
)
def test_pictures_that_need_their_surroundings_stay_whole(scene, monkeypatch, options):
    monkeypatch.setattr(bands, "LEAST", 1)
    options = replace(options, overrides=(*options.overrides, "film.height=300"))
    jobs = RenderJobs([scene], options)
    assert CutJobs(jobs).parts([0], 2) == {}
    assert jobs.work(0).whole_because


def test_shards_of_bands_are_merged_to_the_picture(illum, scene, tmp_path, monkeypatch):
    monkeypatch.setattr(bands, "LEAST", 1)
    overrides = ("film.width=20", "film.height=300", LAYERS)

    def render(folder, shard=None):
        options = RenderOptions(overrides, f"{folder}/{{scene}}.exr", cache=False, shard=shard)
        do = render_scenes if shard is None else render_shard
        return do([scene], options, RenderFiles(Path(folder, "r.json")), Here(), lambda done: None, print)

    render("whole")
    lines = [render(folder, Shard(number, 2)) for number, folder in ((1, "a"), (2, "b"))]
    assert [line.split(";")[0] for line in lines] == ["shard 1/2: 3 of 5", "shard 2/2: 2 of 5"]
    done = illum("merge", "a", "-o", "all", "-q")
    assert done.returncode == 1
    assert "rows 64 to 127: shard-2-of-2.json is missing" in done.stderr
    assert done.stderr.endswith("1 unit is missing\n")
    done = illum("merge", "a", "b", "-o", "all", "-q")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["all/s.exr", "all/r.json"]
    assert Path("all/s.exr").read_bytes() == Path("whole/s.exr").read_bytes()
    merged, whole = (json.loads(Path(name, "r.json").read_text()) for name in ("all", "whole"))
    assert (merged["scene"], merged["scene_hash"]) == (whole["scene"], whole["scene_hash"])
    assert merged["rays"]["obscurance"] == whole["rays"]["obscurance"]
    again = illum("merge", "a", "b", "-o", "all")
    assert "all/s.exr: kept" in again.stderr


def test_plan_and_report_say_which_pictures_stay_whole(illum, scene):
    cut = illum("plan", scene, "-D", "obscurance.reconstruct=false")
    whole = illum("plan", scene, "-D", "obscurance.reconstruct=true")
    assert "whole" not in cut.stdout
    assert "whole   on clusters and in shards: obscurance is reconstructed" in whole.stdout
    illum("render", scene, "-D", "obscurance.reconstruct=true", "--report", "r.json")
    assert json.loads(Path("r.json").read_text())["whole"].startswith("obscurance is reconstructed")

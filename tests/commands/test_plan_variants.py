"""What `illum plan` and `--dry-run` say about several variants."""

from __future__ import annotations

import json

import pytest

SCENE = """
version: 1
film: {width: 16, height: 12, samples: 2}
ambient: 0.2
obscurance: {samples: 4}
objects: [{mesh: {shape: box}}, {mesh: {shape: disc, radius: 9}}]
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
"""
AXES = ("-D", "ambient=0,1", "-D", "lights.key.position=[1,2,3],[3,2,1],[1,3,2]")
FIRST = 16 * 12 * 2
"""Samples of a variant."""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    return tmp_path / "s.yaml"


def test_buffers_count_where_they_differ(illum, scene):
    (part,) = json.loads(illum("plan", scene, *AXES, "--json", "--no-cache").stdout)
    planned = part["variants"]
    assert planned["labels"][0] == "ambient 0, position [1,2,3]"
    assert (len(planned["labels"]), len(planned["files"]), planned["due"]) == (6, 6, 6)
    times = planned["times"]
    assert (times["hits"], times["tracer"], times["obscurance"]) == (1, 1, 1)
    assert times["shadow:key"] == 3  # kept: the second ambient loads it
    assert times["incident:key"] == 6  # not kept
    assert planned["expected_rays"]["shadow:key"] == 3 * FIRST
    assert planned["expected_rays"]["obscurance"] == 4 * FIRST  # the first variant has none
    assert planned["expected_time"]["runs"] == 0


def test_a_dry_run_renders_nothing_and_knows_what_exists_and_how_fast_it_was(
    illum, scene, tmp_path, monkeypatch
):
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "cache"))
    done = illum("sweep", scene, *AXES, "--dry-run")
    assert "all     6 variants from ambient 0, position [1,2,3] to ambient 1, position [1,3,2]" in done.stdout
    assert "files   s-0-_1_2_3_.png to s-1-_1_3_2_.png, 6 images" in done.stdout
    assert "time    unknown" in done.stdout
    assert list(tmp_path.glob("*.png")) == []
    assert illum("sweep", scene, *AXES, "-q").returncode == 0
    done = illum("sweep", scene, *AXES, "--dry-run")
    assert ", 6 of which exist" in done.stdout
    assert "by 6 earlier runs on this machine\n" in done.stdout


@pytest.mark.parametrize(
    "values", [(), ("-D", "ambient=0:0.4:4"), ("-D", "ambient=0:0.4:4", "-o", "x{ambient}.png")]
)
@pytest.mark.parametrize("cameras", ["", "cameras: {left: {}, right: {}}\n"])
def test_a_dry_run_names_the_files_that_the_sweep_writes(illum, scene, cameras, values):
    scene.write_text(SCENE + cameras)
    values = [f"{word[:-4]}.{{camera}}.png" if word[-4:] == ".png" else word for word in values]
    planned = illum("sweep", scene, *values, "--dry-run").stdout.splitlines()
    written = illum("sweep", scene, *values).stdout.split()
    more = f" to {written[-1]}, {len(written)} images" if len(written) > 1 else ""
    assert planned.count(f"files   {written[0]}{more}") == (2 if cameras else 1)
    assert ("view    right" in planned) == bool(cameras)
    assert ("all     1 variant, 1 of which exist" in illum("sweep", scene, "--dry-run").stdout) == (
        not values
    )


def test_a_fault_of_any_variant_is_told(illum, scene):
    done = illum("plan", scene, "-D", "film.samples=4,0")
    assert done.returncode == 2
    assert "film.samples" in done.stderr


def test_a_dry_run_of_a_shard_shows_what_the_shard_does(illum, scene):
    shown = []
    for number in (1, 2, 3):
        more = ("--shard", f"{number}/3", "-o", f"shard{number}/{{ambient}}-{{lights.key.position}}.png")
        dry_run = ("sweep", scene, *AXES, *more, "--no-cache", "--dry-run")
        assert f"shard   {number}/3, of 6 variants\n" in illum(*dry_run).stdout
        (planned,) = json.loads(illum(*dry_run, "--json").stdout)
        written = illum("sweep", scene, *AXES, *more, "-q", "--no-cache").stdout.split()
        assert sorted(planned["files"]) == sorted(written)
        shown += planned["labels"]
    assert sorted(shown) == sorted(dict.fromkeys(shown))
    assert len(shown) == 6


def test_a_dry_run_of_a_shard_without_a_variant_says_so(illum, scene):
    done = illum("sweep", scene, "-D", "ambient=0,1", "--shard", "3/3", "--dry-run")
    assert done.stdout == "shard   3/3, of 2 variants\nall     no variant\n"

"""--shard I/N: disjoint, complete, balanced by costs from scenes; merged they are the whole, byte by byte."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.commands.options import RenderJob, RenderOptions, Shard
from illumcli.commands.shards import loads, shard_of_each
from illumcli.commands.sweep import sweep_scene
from illumcli.commands.unit import Worker
from illumcli.commands.unit_cost import cost_of
from illumcli.render_graph.costs import Cost, CostModel
from illumcli.scene.variants import variants_of

SCENE = """
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.2
obscurance: {samples: 4}
materials: {clay: {model: phong, exponent: 20}}
objects:
  - {mesh: {shape: sphere}, material: clay}
  - {mesh: {shape: plane, size: [4, 4]}, transform: {translate: [0, -1, 0]}}
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
camera: {position: [0, 1, 5]}
"""
CAMERAS = SCENE.replace("camera:", "cameras: {left: {position: [-2, 1, 4]}, wide:") + "}\n"
OF_RUN = {"state", "seconds", "rays", "reused", "body"}
"""Columns of a table that differ from run to run."""
OF_PROCESS = {
    "seconds",
    "rays",
    "ray_loop",
    "saved",
    "reused",
    "skipped",
    "total_seconds",
    "peak_memory_bytes",
}
"""The same in a report; what a run skips depends on what it reuses."""


@pytest.fixture
def folder(tmp_path):
    for name, text in (("a", CAMERAS), ("b", SCENE), ("c", CAMERAS.replace("samples: 2", "samples: 5"))):
        (tmp_path / f"{name}.yaml").write_text(text)
    corners = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    for name, height in (("m", 1), ("n", 2), ("o", 3)):
        text = f"v 0 0 0\nv 1 0 0\nv 0 1 0.2\nv 0.4 0.3 {height}\n{corners}"
        (tmp_path / f"{name}.obj").write_text(text + "# a comment\n" * 500 * height)
    return tmp_path


def digests(folder):
    """The files of a folder, without tables, reports and records."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix not in (".csv", ".json")
    }


def rows(path):
    with path.open(newline="") as file:
        return [{key: cell for key, cell in row.items() if key not in OF_RUN} for row in csv.DictReader(file)]


def entries(path):
    data = json.loads(path.read_text())
    data = data if isinstance(data, list) else [data]
    return [
        {key: value for key, value in entry.items() if key not in OF_PROCESS | {"body", "written", "kept"}}
        | {"files": sorted([*entry.get("written", ()), *entry.get("kept", ())])}
        for entry in data
    ]


SWEEP = (
    "sweep", "b.yaml", "-D", "materials.clay.exponent=5,10,20,40",
    "-D", "camera.position=[0,1,5],[1,1,5],[2,1,5]", "--only", "beauty", "--seed", "7",
    "-o", "{folder}/{{materials.clay.exponent}}/{{camera.position}}.png", "--reference", "8",
    "--table", "{folder}/t.csv", "--sheet", "{folder}/sheet.png", "--report", "{folder}/r.json",
)  # fmt: skip
RENDER = (
    "render", "a.yaml", "b.yaml", "c.yaml", "-o", "{folder}/{{scene}}-{{camera}}.exr",
    "--report", "{folder}/r.json",
)  # fmt: skip
FRAMES = (
    "render", "a.yaml", "b.yaml", "--frames", "0:4:2", "-D", "ambient=frame/10",
    "-o", "{folder}/{{scene}}-{{camera}}.{{frame:04d}}.exr", "--report", "{folder}/r.json",
)  # fmt: skip
BAKE = (
    "ao-bake", "m.obj", "n.obj", "o.obj", "b.yaml", "-o", "{folder}/{{scene}}.npz",
    "-o", "{folder}/{{scene}}.ply", "--samples", "16", "--report", "{folder}/r.json",
)  # fmt: skip
COMMANDS = {"sweep": SWEEP, "render": RENDER, "frames": FRAMES, "ao-bake": BAKE}
UNITS = {"sweep": 12, "render": 5, "frames": 9, "ao-bake": 4}


def words(name, folder, *more):
    return [*(word.format(folder=folder) for word in COMMANDS[name]), *more]


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("count", [1, 3, 14])
def test_shards_that_are_merged_are_the_whole(illum, folder, name, count):
    # every shard in a folder of its own; some have nothing to do
    done = []
    for number in range(1, count + 1):
        run = illum(*words(name, f"shard-{number}", "--shard", f"{number}/{count}"))
        assert run.returncode == 0, run.stderr
        done.append(
            len([line for line in run.stdout.splitlines() if line.endswith((".png", ".exr", ".npz"))])
        )
    assert sum(done) == UNITS[name]
    assert all(done) or count > UNITS[name]
    merged = illum("merge", *(f"shard-{k}" for k in range(1, count + 1)), "-o", "merged/all")
    assert merged.returncode == 0, merged.stderr

    # the whole, in a folder of the same name
    (folder / "whole").mkdir()
    for path in folder.glob("*.*"):
        shutil.copy(path, folder / "whole")
    whole = illum(*words(name, "merged/all"), cwd=folder / "whole")
    assert whole.returncode == 0, whole.stderr
    ours, theirs = folder / "merged/all", folder / "whole/merged/all"
    assert digests(ours) == digests(theirs)
    assert entries(ours / "r.json") == entries(theirs / "r.json")
    if name == "sweep":
        assert rows(ours / "t.csv") == rows(theirs / "t.csv")
    assert sorted(path.name for path in ours.rglob("*.*")) == sorted(
        path.name for path in theirs.rglob("*.*")
    )

    # the whole, once more, keeps all that was merged
    again = illum(*words(name, "merged/all", "-q"))
    assert again.returncode == 0, again.stderr
    assert digests(ours) == digests(theirs)


def test_textures_that_are_named_by_their_objects_are_merged(illum, folder):
    square = "vt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2 3/3\n"
    for name in ("p", "q"):
        (folder / f"{name}.obj").write_text(square)
    bake = ("ao-bake", "p.obj", "q.obj", "--texture", "8", "--samples", "4", "--what", "ao,thickness")
    for number in (1, 2):
        names = f"part-{number}/{{name}}.{{object}}.{{what}}.png"
        run = illum(*bake, "-o", names, "--shard", f"{number}/2")
        assert (run.returncode, len(run.stdout.splitlines())) == (0, 2), run.stderr
    merged = illum("merge", "part-1", "part-2", "-o", "all")
    assert merged.returncode == 0, merged.stderr
    assert illum(*bake, "-o", "whole/{name}.{object}.{what}.png").returncode == 0
    assert digests(folder / "all") == digests(folder / "whole")
    assert len(digests(folder / "all")) == 4


def test_shards_of_one_folder_are_merged_in_it(illum, folder):
    for number in (2, 1, 3):
        assert illum(*words("sweep", "out", "--shard", f"{number}/3")).returncode == 0
    before = digests(folder / "out")
    merged = illum("merge", "out", "-o", "out")
    assert merged.returncode == 0, merged.stderr
    assert len(merged.stdout.splitlines()) == 12 + 3
    assert before.items() <= digests(folder / "out").items()
    assert [row["variant"] for row in rows(folder / "out/t.csv")] == [str(k) for k in range(1, 13)]
    again = illum("merge", "out", "-o", "out")
    assert (again.returncode, len(again.stderr.splitlines())) == (0, 15), again.stderr
    assert again.stderr.count("kept, its content is the same") == 15

    # a shard that is run again keeps its images and its record
    record = (folder / "out/shard-1-of-3.json").read_bytes()
    assert illum(*words("sweep", "out", "--shard", "1/3")).returncode == 0
    assert (folder / "out/shard-1-of-3.json").read_bytes() == record


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_missing_is_named_and_added_later(illum, folder, name):
    for number in (1, 2):
        illum(*words(name, f"s{number}", "--shard", f"{number}/2"))
    shutil.move(folder / "s2", folder / "later")
    first = illum("merge", "s1", "-o", "all")
    assert first.returncode == 1
    lines = first.stderr.splitlines()
    missing = UNITS[name] - len(json.loads((folder / "s1/shard-1-of-2.json").read_text())["results"])
    assert lines[-1] == (f"{missing} units are missing" if missing > 1 else "1 unit is missing")
    assert sum("shard-2-of-2.json is missing" in line for line in lines) == missing
    second = illum("merge", "s1", "later", "-o", "all")
    assert second.returncode == 0, second.stderr
    one_go = illum("merge", "s1", "later", "-o", "other")
    assert one_go.returncode == 0, one_go.stderr
    ours, theirs = digests(folder / "all"), digests(folder / "other")
    assert ours.pop("sheet.png", "") != "" or name != "sweep"  # it holds the names of the pictures
    theirs.pop("sheet.png", None)
    assert ours == theirs


def test_a_picture_that_is_gone_or_changed_is_named(illum, folder):
    for number in (1, 2):
        illum(*words("sweep", f"s{number}", "--shard", f"{number}/2"))
    first, second, *_ = sorted((folder / "s1").rglob("*.png"))
    first.unlink()
    second.write_bytes(second.read_bytes()[:-1] + b"?")
    done = illum("merge", "s1", "s2", "-o", "all")
    assert done.returncode == 1
    gone, changed, count = done.stderr.splitlines()
    assert gone.endswith(f"{first.relative_to(folder)}: no such file or directory")
    assert f"{second.relative_to(folder)} was changed or damaged" in changed
    assert count == "2 units are missing"
    assert len(list((folder / "all").rglob("*.png"))) == 10 + 1


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (("--shard", "2/3"), "is one of 3 shards, another number"),
        (("--shard", "2/2", "-D", "ambient=0.1,0.3"), "is of 24 units, another number"),
        (("--shard", "2/2", "--seed", "8"), "has another scene, other values or names of files"),
        (
            ("--shard", "2/2", "--reference", "2"),
            "names other tables, sheets or reports, or has",
        ),
    ],
    ids=["number", "units", "seed", "table"],
)
def test_shards_of_different_commands_contradict(illum, folder, change, fact):
    illum(*words("sweep", "s1", "--shard", "1/2"))
    pattern = "s2/{ambient}/{materials.clay.exponent}-{camera.position}.png"
    other = illum(*words("sweep", "s2", *change), *(("-o", pattern) if "-D" in change else ()))
    assert other.returncode == 0, other.stderr
    done = illum("merge", "s1", "s2", "-o", "all")
    assert (done.returncode, fact in done.stderr) == (2, True), done.stderr
    assert done.stderr.startswith("s2/shard-2-of-")
    assert not (folder / "all").exists()


def test_a_folder_without_a_record_or_with_a_damaged_one_is_refused(illum, folder):
    done = illum("merge", ".", "none", "-o", "all")
    assert done.returncode == 2
    assert [line.partition(":")[0] for line in done.stderr.splitlines()] == [".", "none"]
    illum(*words("sweep", "s1", "--shard", "1/1"))
    record = folder / "s1/shard-1-of-1.json"
    record.write_text(record.read_text().replace("variant", "varianT", 1))
    done = illum("merge", "s1", "-o", "all")
    assert done.returncode == 2
    assert done.stderr.startswith("s1/shard-1-of-1.json: was changed or damaged")
    record.write_text("{}")
    assert illum("merge", "s1", "-o", "all").returncode == 2


def test_another_sweep_does_not_replace_a_record(illum, folder):
    illum(*words("sweep", "out", "--shard", "1/2"))
    other = illum("sweep", "b.yaml", "-D", "seed=1,2", "-o", "out/{seed}.png", "--shard", "1/2")
    assert other.returncode == 5
    told = "out/shard-1-of-2.json: is the record of another command; remove it, or write to another folder"
    assert told in other.stderr
    (folder / "out/shard-1-of-2.json").unlink()
    again = illum("sweep", "b.yaml", "-D", "seed=1,2", "-o", "out/{seed}.png", "--shard", "1/2")
    assert again.returncode == 0, again.stderr


def test_a_variant_that_fails_is_told_by_its_shard_and_by_merge(illum, folder):
    values = (
        "-D",
        "film.width=24,-3,24.5,25",
        "-o",
        "{folder}/{{film.width}}.png",
        "--table",
        "{folder}/t.csv",
    )
    told = []
    for number in (1, 2):
        given = [word.format(folder=f"s{number}") for word in values]
        done = illum("sweep", "b.yaml", *given, "--shard", f"{number}/2")
        told += [line for line in done.stderr.splitlines() if "film.width" in line]
        assert done.returncode == (2 if "failed" in done.stderr else 0)
    assert len(told) == 2
    merged = illum("merge", "s1", "s2", "-o", "all")
    assert merged.returncode == 1
    assert merged.stderr.splitlines()[-1] == "2 units are missing"
    whole = illum("sweep", "b.yaml", *(word.format(folder="whole") for word in values))
    assert whole.returncode == 2
    ours, theirs = rows(folder / "all/t.csv"), rows(folder / "whole/t.csv")
    for row in (*ours, *theirs):
        row["file"] = row["file"].rpartition("/")[2]
        row["content"] = row["content"] == "incomplete"
    assert ours == theirs


def test_shards_without_a_unit_say_so(illum, folder):
    done = illum("render", "b.yaml", "-o", "x/{scene}.png", "--only", "beauty", "--shard", "2/2")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "shard 2/2: none of 1; illum merge joins it by x/shard-2-of-2.json\n"


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/0", "-1/3", "1/3/5"])
def test_shards_are_counted_from_one(illum, folder, text):
    done = illum(*words("sweep", "out", "--shard", text))
    assert done.returncode == 2
    assert "is not I/N with I from 1 to N" in done.stderr


# --- the division -------------------------------------------------------------------------------------

COSTS = st.lists(
    st.integers(0, 1000).flatmap(lambda alone: st.builds(Cost, st.just(alone), st.integers(0, alone))),
    max_size=40,
)


@given(COSTS, st.integers(1, 50))
def test_every_unit_is_in_one_shard_and_none_is_overloaded(costs, count):
    shards = shard_of_each(costs, count)
    assert len(shards) == len(costs)
    assert all(1 <= shard <= count for shard in shards)
    mean = sum(cost.alone for cost in costs) / count
    assert max(loads(costs, shards, count)) <= mean + max((cost.alone for cost in costs), default=0)


def test_variants_that_share_buffers_stay_together():
    # four cameras, ten materials each: a cut within a camera costs its rays once more
    costs = [Cost(100, 100 if number % 10 == 0 else 1) for number in range(40)]
    assert shard_of_each(costs, 2) == [1] * 20 + [2] * 20
    assert shard_of_each(costs, 4) == [1 + number // 10 for number in range(40)]
    assert max(loads(costs, shard_of_each(costs, 8), 8)) <= 110


def test_units_that_share_nothing_are_spread_by_cost():
    costs = [Cost(each, each) for each in (60, 60, 30, 30)]
    assert sorted(loads(costs, shard_of_each(costs, 2), 2)) == [90, 90]


def test_costs_come_from_the_scene_alone(folder, monkeypatch):
    def costs():
        worker, model = Worker(), CostModel()
        jobs = [
            RenderJob(folder / "b.yaml", RenderOptions((text,), str(folder / "x.png"), ("beauty",)))
            for text in ("seed=0", "materials.clay.exponent=3", "film.width=48", "obscurance.samples=64")
        ]
        return [cost_of(worker.prepare(job), model) for job in jobs]

    first = costs()
    sweep_scene(folder / "b.yaml", variants_of(["seed=0"]), RenderOptions(pattern=str(folder / "y.png")))
    monkeypatch.setenv("ILLUM_CACHE", str(folder / "cache"))
    monkeypatch.setenv("ILLUM_PACKETS", "0")
    assert costs() == first
    one, material, wide, many = first
    assert one.after == one.alone
    assert material.alone == one.alone
    assert material.after < one.alone
    assert wide.alone > one.alone
    assert many.alone > wide.alone / 2


def test_a_shard_leaves_the_work_of_others(folder):
    variants = variants_of(["seed=1:5:5"])
    pattern = str(folder / "{seed}.png")
    done = sweep_scene(folder / "b.yaml", variants, RenderOptions(pattern=pattern, shard=Shard(2, 2)))
    rendered = {each.number for each in done.outcomes if each.report is not None}
    assert rendered
    assert len(list(folder.glob("*.png"))) == len(rendered) < 5

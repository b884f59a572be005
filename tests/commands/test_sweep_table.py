"""The table of a sweep: measures against references, rows of interrupted runs."""

from __future__ import annotations

import csv
import re

import pytest

from illumcli.commands import sweep_table
from illumcli.commands.options import RenderOptions
from illumcli.commands.sweep import sweep_scene
from illumcli.commands.sweep_files import SweepFiles
from illumcli.errors import InputError
from illumcli.scene.variants import variants_of

SCENE = "version: 1\nambient: 0.5\nobjects: [{mesh: {shape: box}}]\nfilm: {width: 12, height: 8}\n"
AXES = ["film.exposure=0,1", "ambient=0.1,0.3,0.4"]
NAMES = "{film.exposure}-{ambient}.png"


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    return tmp_path / "s.yaml"


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def sweep(scene, table, written=lambda outcome: None, pattern=NAMES, **files):
    options = RenderOptions(pattern=str(scene.parent / pattern), cache=False)
    of_all = SweepFiles(table=table, **files)
    return sweep_scene(scene, variants_of(AXES), options, of_all, written=written)


def test_a_pattern_names_a_reference_for_each_variant(scene, tmp_path):
    sweep(scene, None, pattern="old-" + NAMES)
    old = str(tmp_path / ("old-" + NAMES))
    done = sweep(scene, tmp_path / "t.csv", reference=old.replace("{ambient}", "0.3"), flips=True)
    table = rows(tmp_path / "t.csv")
    assert [float(row["rmse"]) == 0 for row in table] == [False, True, False] * 2
    assert [row["psnr"] == "inf" for row in table] == [False, True, False] * 2
    assert [float(row["flip"]) == 0 for row in table] == [False, True, False] * 2
    assert re.search(r"RMSE from 0 \(exposure 0, ambient 0.3\) to 0\.\d+ \(exposure 1, amb", done.summary)


def test_the_pattern_may_name_images_of_the_same_sweep(scene, tmp_path):
    pattern = str(tmp_path / NAMES.replace("{ambient}", "0.4"))
    sweep(scene, tmp_path / "t.csv", reference=pattern)
    assert [float(row["rmse"]) == 0 for row in rows(tmp_path / "t.csv")] == [False, False, True] * 2
    again = sweep(scene, tmp_path / "t.csv", reference=pattern)
    assert again.kept == (tmp_path / "t.csv",)


def test_references_that_are_missing_are_told_at_once(scene, tmp_path):
    sweep(scene, None, pattern="old-" + NAMES)
    (tmp_path / "old-0-0.1.png").unlink()
    (tmp_path / "old-1-0.4.png").write_text("no picture")
    with pytest.raises(InputError) as caught:
        sweep(scene, tmp_path / "t.csv", reference=str(tmp_path / ("old-" + NAMES)))
    assert len(caught.value.problems) == 2
    assert "old-0-0.1.png: no such file" in caught.value.problems[0]
    assert not (tmp_path / "0-0.1.png").exists()


def test_rows_survive_an_interrupt_and_stay_in_the_resumed_table(scene, tmp_path):
    table, seen = tmp_path / "t.csv", []

    def interrupted(outcome):
        if len(seen) == 4:
            raise KeyboardInterrupt
        seen.append(outcome.number)

    with pytest.raises(KeyboardInterrupt):
        sweep(scene, table, interrupted, reference="2")
    half = rows(table)
    assert [row["state"] for row in half] == ["rendered"] * 4 + ["pending"] * 2
    assert [row["content"] == "incomplete" for row in half] == [False] * 4 + [True] * 2
    assert float(half[3]["rmse"]) > 0

    sweep(scene, table, reference="2")
    whole = rows(table)
    assert [row["state"] for row in whole] == ["rendered"] * 4 + ["kept", "rendered"]  # the fifth had no row
    for before, after in zip(half[1:4], whole[1:4], strict=True):
        assert before == after
    assert sweep(scene, table, reference="2").kept == (table,)


def test_an_unfinished_table_is_written_while_a_sweep_runs(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_table, "INTERVAL", 0.0)
    table, states = tmp_path / "t.csv", []

    def look(outcome):
        states.append([row["state"] for row in rows(table)] if table.exists() else [])

    sweep(scene, table, look, reference="3")
    assert states[0] == []
    assert states[1] == ["pending"] * 6  # the reference, variant 3, is not there yet
    assert states[4] == ["rendered"] * 4 + ["pending"] * 2

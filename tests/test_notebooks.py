"""The notebooks of docs/notebooks: they run anywhere without a warning, and hold what their cells show."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
LARGEST = 400_000
"""Of a file [bytes]; readers of the repository load it whole."""


def codes(notebook):
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def kinds_shown(cell):
    """What a cell shows; texts may come in several parts."""
    return {(each["output_type"], *sorted(each.get("data", ()))) for each in cell["outputs"]}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_holds_what_its_cells_show(path):
    text = path.read_text(encoding="utf-8")
    assert len(text) < LARGEST
    assert not re.search(r"/(tmp|home|root|work|usr)/|Traceback|Warning", text)
    assert re.search(r"with ([\d,]+) rays", text)[1] != "0", "the cache was not empty"
    cells = codes(json.loads(text))
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    kinds = [kind for cell in cells for output in cell["outputs"] for kind in output.get("data", ())]
    assert kinds.count("image/png") >= 3
    assert "text/html" in kinds


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_in_an_empty_folder(path, tmp_path, monkeypatch):
    for name in ("nbclient", "ipykernel", "matplotlib"):
        pytest.importorskip(name)
    make = runpy.run_path(str(ROOT / "docs" / "make_notebooks.py"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "matplotlib"))
    (tmp_path / "empty").mkdir()
    done = json.loads(make["text"](make["run"](path, tmp_path / "empty")))
    told = [
        output["text"] for cell in codes(done) for output in cell["outputs"] if output.get("name") == "stderr"
    ]
    assert told == []
    stored = json.loads(path.read_text(encoding="utf-8"))
    shown = [[kinds_shown(cell) for cell in codes(each)] for each in (done, stored)]
    assert shown[0] == shown[1], "run docs/make_notebooks.py"

"""The Python examples of the pages, run in their order."""

from __future__ import annotations

import re

import pytest

from test_docs import place_files


def test_the_examples_run(root, tmp_path, monkeypatch):
    (tmp_path / "scenes").symlink_to(root / "scenes")
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"```python\n(.*?)```", (root / "docs" / "python.md").read_text(), re.DOTALL)
    assert len(examples) == 7
    names: dict[str, object] = {}
    for example in examples:
        exec(example, names)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "ground.npz",
        "ground.ply",
        "rough.csv",
        "teapot.exr",
    ]


@pytest.mark.parametrize("page", ["README.md", "docs/getting-started.md"])
def test_the_examples_of_other_pages_run(page, root, tmp_path, monkeypatch):
    (tmp_path / "scenes").symlink_to(root / "scenes")
    monkeypatch.chdir(tmp_path)
    place_files(root / page, tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", (root / page).read_text(), re.DOTALL)
    exec(example, {})

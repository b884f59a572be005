"""The examples of docs/python.md, run in their order."""

from __future__ import annotations

import re


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

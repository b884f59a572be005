"""The Python examples of the pages, run in their order."""

from __future__ import annotations

import importlib
import pkgutil
import re

import pytest

from illumcli import api
from test_docs import place_files

INSIDE = {
    "illumcli.api.brdfs.Drawing",
    "illumcli.api.brdfs.PlotChoices",
    "illumcli.api.choices.BakeChoices",
    "illumcli.api.choices.RenderChoices",
    "illumcli.api.meshes.MeshLike",
}
"""Classes of the interface that its users do not meet by name."""


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


def test_the_reference_has_every_class_of_the_interface(root):
    modules = [
        importlib.import_module(f"{api.__name__}.{each.name}") for each in pkgutil.iter_modules(api.__path__)
    ]
    classes = {
        f"{module.__name__}.{name}"
        for module in modules
        for name, each in vars(module).items()
        if isinstance(each, type) and each.__module__ == module.__name__ and not name.startswith("_")
    }
    text = (root / "docs" / "python-reference.md").read_text()
    listed = set(re.findall(r"autoclass:: (illumcli\.api\.[\w.]+)", text))
    assert classes - listed == INSIDE

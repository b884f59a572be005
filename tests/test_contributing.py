"""CONTRIBUTING's example is complete: put where it says, it is a model that passes every test of models."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import textwrap


def test_the_example_of_a_model_passes_the_tests_of_models(root, tmp_path):
    text = (root / "CONTRIBUTING.md").read_text()
    for name in ("src/illumcli", "tests/models", "tests/conftest.py", "pyproject.toml"):
        copy = shutil.copytree if (root / name).is_dir() else shutil.copy
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        copy(root / name, tmp_path / name)
    blocks = [
        textwrap.dedent(each) for each in re.findall(r"^ +```python\n(.*?)^ +```", text, flags=re.M | re.S)
    ]
    files = re.findall(r"^\d\. Write `([^`]*)`", text, flags=re.M)
    assert len(blocks) == len(files) == 2
    for name, block in zip(files, blocks, strict=True):
        assert not (root / name).exists()
        (tmp_path / name).write_text(block)

    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "src")}
    for words in (
        ("ruff", "check", "--no-cache", *files),
        ("ruff", "format", "--no-cache", "--check", *files),
        ("pytest", "tests/models", "-k", "LunarLambert or test_lunar_lambert"),
        ("illumcli", "models", "lunar_lambert"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", *words],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        assert "passed" in done.stdout or words[0] != "pytest"

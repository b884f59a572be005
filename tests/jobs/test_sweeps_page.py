"""The commands of docs/sweeps.md run as they stand."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys

import pytest


@pytest.fixture
def shell(root, tmp_path, monkeypatch):
    """A folder with the scenes and an `illum` that renders them small."""
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    text = (root / "scenes" / "teapot.yaml").read_text()
    small = re.sub(
        r"film: \{width: \d+, height: \d+, samples: \d+", "film: {width: 32, height: 18, samples: 1", text
    )
    assert small != text
    (scenes / "teapot.yaml").write_text(small)
    command = tmp_path / "bin" / "illum"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m illumcli "$@"\n')
    command.chmod(command.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{command.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(root / "src"))
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "kept"))
    return tmp_path


def test_every_command_runs(root, shell):
    page = (root / "docs" / "sweeps.md").read_text()
    blocks = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 6
    for block in blocks:
        done = subprocess.run(["sh", "-e", "-c", block], cwd=shell, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert done.stdout
    assert len(list(shell.glob("loop-*.png"))) == 3
    assert len(list(shell.glob("teapot.0*.png"))) == 3
    assert (shell / "sheet.png").exists()

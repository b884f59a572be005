"""Fixtures that tests share, with the folder of real meshes if it exists."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from hypothesis import settings

from chromium import chromium as chromium
from illumcli.compiled import SWITCH

# No test asserts a time: a machine may be slow. A run repeats the examples of the one before, so that a
# change is judged by what it changed; `--hypothesis-profile explore` draws new ones.
settings.register_profile("explore", settings.default, deadline=None)
settings.register_profile("repeatable", settings.default, deadline=None, derandomize=True)
settings.load_profile("repeatable")

ROOT = Path(__file__).parents[1]
MESHES = ROOT.parent / "shared" / "meshes"


def needs_loop(loop, monkeypatch):
    """Skip a test where a loop in C is not compiled, unless it must be; it is not switched off."""
    monkeypatch.delenv(SWITCH, raising=False)
    if loop() is None:
        assert os.environ.get("ILLUM_REQUIRE_PACKETS") != "1"
        pytest.skip("no compiled loop")


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory):
    """Runs of tests keep their artifacts apart from the user's, in folders that no group can write to."""
    before = os.environ.get("ILLUM_CACHE")
    mask = os.umask(0o022)
    os.environ["ILLUM_CACHE"] = str(tmp_path_factory.mktemp("cache"))
    yield
    os.umask(mask)
    del os.environ["ILLUM_CACHE"]
    if before is not None:
        os.environ["ILLUM_CACHE"] = before


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def real_mesh():
    """Path of a real mesh by file name; the test is skipped if the meshes do not exist."""

    def find(name: str) -> Path:
        path = MESHES / name
        if not path.exists():
            pytest.skip(f"needs ../shared/meshes/{name}")
        return path

    return find


@pytest.fixture
def illum(illum_process):
    """Run the command: ``illum("render", "x.yaml")``."""
    return illum_process


@pytest.fixture
def illum_process(tmp_path):
    """Run the command in a fresh process and folder."""

    def run(*words: object, cwd: Path = tmp_path, **environment: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "illumcli", *map(str, words)]
        env = {**os.environ, **environment}
        return subprocess.run(
            command, cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=120
        )

    return run


@pytest.fixture
def illum_here(tmp_path, monkeypatch):
    """The same in this process, which starts at once, for tests of what the command does and says."""
    from illumcli.cli import _status

    def run(*words: object, cwd: Path = tmp_path, **environment: str) -> subprocess.CompletedProcess[str]:
        arguments = ["illum", *map(str, words)]
        with monkeypatch.context() as here:
            here.chdir(cwd)
            here.setattr(sys, "argv", arguments)
            for name, value in environment.items():
                here.setenv(name, value)
            with redirect_stdout(io.StringIO()) as stdout, redirect_stderr(io.StringIO()) as stderr:
                code = _status()
        return subprocess.CompletedProcess(arguments, code, stdout.getvalue(), stderr.getvalue())

    return run

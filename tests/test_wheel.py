"""Wheels with and without a C compiler: each has the right tag."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from importlib.util import find_spec

import pytest

from conftest import ROOT

COMPILERS = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang") if name and shutil.which(name)]
pytestmark = pytest.mark.skipif(
    not (ROOT / "hatch_build.py").exists() or find_spec("hatchling") is None, reason="needs hatchling"
)


@pytest.fixture
def project(tmp_path):
    """As much of the project as a wheel needs."""
    package = tmp_path / "src" / "illumcli"
    (package / "rays").mkdir(parents=True)
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", ".gitignore"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copy(ROOT / "src" / "illumcli" / "rays" / "packets.c", package / "rays")
    (package / "__init__.py").write_text("")
    return tmp_path


def build(project, **environment):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel"]
    return subprocess.run(
        command, cwd=project, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


def only_wheel(project):
    (path,) = (project / "dist").iterdir()
    with zipfile.ZipFile(path) as wheel:
        return path.name, {os.path.basename(name) for name in wheel.namelist()}


def test_without_a_compiler_the_wheel_is_pure(project):
    # a library of an earlier build is not taken for that of this source
    (project / "src" / "illumcli" / "rays" / "_packets.so").write_text("old")
    done = build(project, CC=str(project / "none"), ILLUM_REQUIRE_PACKETS="0")
    assert done.returncode == 0, done.stderr
    assert "single rays" in done.stderr
    name, files = only_wheel(project)
    assert name.endswith("-py3-none-any.whl")
    assert "packets.c" in files
    assert "_packets.so" not in files


@pytest.mark.skipif(os.name == "nt" or not COMPILERS, reason="needs a C compiler")
def test_with_a_compiler_the_wheel_is_of_its_platform(project):
    done = build(project, CC=COMPILERS[0])
    assert done.returncode == 0, done.stderr
    name, files = only_wheel(project)
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert name.endswith(f"-py3-none-{platform}.whl")
    assert "_packets.so" in files


def test_a_required_loop_that_cannot_be_compiled_stops_the_build(project):
    assert build(project, CC=str(project / "none"), ILLUM_REQUIRE_PACKETS="1").returncode != 0

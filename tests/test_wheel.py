"""Wheels with and without a C compiler, the archive of the source, and what they say of themselves."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
import yaml

import illumcli
from conftest import ROOT

COMPILERS = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang") if name and shutil.which(name)]
WITH_COMPILER = pytest.mark.skipif(os.name == "nt" or not COMPILERS, reason="needs a C compiler")


SOURCES = (
    "__init__.py",
    "compiled.h",
    "rays/packets.c",
    "rays/samples.c",
    "visibility/regression.c",
    "visibility/polynomials.h",
    "baking/cells.c",
)
LIBRARIES = {"_packets.so", "_samples.so", "_regression.so", "_cells.so"}


@pytest.fixture
def project(tmp_path):
    """As much of the project as a wheel needs."""
    package = tmp_path / "src" / "illumcli"
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", ".gitignore"):
        shutil.copy(ROOT / name, tmp_path)
    for name in SOURCES:
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "src" / "illumcli" / name, package / name)
    return tmp_path


def build(project, *words, **environment):
    command = [sys.executable, "-m", "hatchling", "build", *(words or ("-t", "wheel"))]
    return subprocess.run(
        command, cwd=project, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


def only_wheel(project):
    (path,) = (project / "dist").iterdir()
    with zipfile.ZipFile(path) as wheel:
        return path.name, {os.path.basename(name) for name in wheel.namelist()}


# ------------------------------------------------------------------ with and without the loop


@pytest.mark.parametrize(
    ("environment", "reason"), [({"CC": "/none/cc"}, "/none/cc"), ({"ILLUM_PACKETS": "0"}, "ILLUM_PACKETS=0")]
)
def test_without_a_compiler_or_by_request_the_wheel_is_pure(project, environment, reason):
    # a library of an earlier build is not taken for that of this source
    (project / "src" / "illumcli" / "rays" / "_packets.so").write_text("old")
    done = build(project, **{"ILLUM_REQUIRE_PACKETS": "0"} | environment)
    assert done.returncode == 0, done.stderr
    assert "loops in C are not compiled" in done.stderr
    assert reason in done.stderr
    name, files = only_wheel(project)
    assert name.endswith("-py3-none-any.whl")
    assert {"packets.c", "samples.c", "regression.c", "cells.c", "polynomials.h"} <= files
    assert not files & LIBRARIES


@WITH_COMPILER
def test_with_a_compiler_the_wheel_is_of_its_platform(project):
    done = build(project, CC=COMPILERS[0])
    assert done.returncode == 0, done.stderr
    name, files = only_wheel(project)
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert name.endswith(f"-py3-none-{platform}.whl")
    assert files >= LIBRARIES


def test_a_required_loop_that_cannot_be_compiled_stops_the_build(project):
    assert build(project, CC=str(project / "none"), ILLUM_REQUIRE_PACKETS="1").returncode != 0


# ------------------------------------------------------------------ what is published


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """Folder with the archive of this source, and the wheel that is built from the unpacked archive."""
    folder = tmp_path_factory.mktemp("published")
    done = build(ROOT, "-t", "sdist", "-d", str(folder))
    assert done.returncode == 0, done.stderr
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        files.extractall(folder, filter="data")
    source = folder / archive.name.removesuffix(".tar.gz")
    done = build(source, "-t", "wheel", "-d", str(folder))
    assert done.returncode == 0, done.stderr
    return folder


def test_the_source_archive_holds_all_that_is_tracked(published):
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    if not listed:
        pytest.skip("needs git and its folder")
    (archive,) = published.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        held = {name.partition("/")[2] for name in files.getnames()}
    assert set(listed.splitlines()) - held == set()


def test_a_second_build_elsewhere_has_the_same_bytes(published, tmp_path):
    (first,) = published.glob("*.whl")
    (source,) = (path for path in published.iterdir() if path.is_dir())
    elsewhere = shutil.copytree(source, tmp_path / "elsewhere", copy_function=shutil.copy)
    build(elsewhere, "-t", "wheel", "-d", str(tmp_path))
    assert (tmp_path / first.name).read_bytes() == first.read_bytes()


def test_the_wheel_holds_the_package_and_says_what_it_is(published):
    (path,) = published.glob("*.whl")
    with zipfile.ZipFile(path) as wheel:
        held = set(wheel.namelist())
        (about,) = (name for name in held if name.endswith(".dist-info/METADATA"))
        metadata = message_from_bytes(wheel.read(about))
    package = ROOT / "src"
    wanted = {
        str(each.relative_to(package))
        for each in package.rglob("*")
        if each.is_file() and "__pycache__" not in each.parts and each.suffix not in (".pyc", ".so", ".dll")
    }
    assert wanted - held == set()
    assert {name.split("/")[0] for name in held} == {"illumcli", Path(about).parts[0]}
    assert metadata["Version"] == illumcli.__version__
    assert metadata["License-Expression"] == "MIT"
    assert about.replace("METADATA", "licenses/LICENSE") in held


def test_citation_and_changelog_name_the_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == illumcli.__version__
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), flags=re.M)
    assert newest[1] == illumcli.__version__

"""Every command that the documentation shows is run, on small pictures."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
import urllib.request
from pathlib import Path

import pytest

import rgl_files
from illumcli.cli import COMMANDS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SMALL = "-D 'film={width: 48, height: 27, samples: 1}'"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0.2\nf 1 2 3\n"


def commands(page: Path) -> list[str]:
    """The `illum` lines of a page's shell blocks."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), flags=re.M | re.S)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith(("illum ", "for "))]


FILE = re.compile(r"^`([\w./-]+)`\n\n```(?:yaml|python|toml)\n(.*?)^```", re.M | re.S)
"""A file that a page shows in full, below its name."""


def place_files(page: Path, folder: Path) -> None:
    """Write the files that a page shows."""
    for name, text in FILE.findall(page.read_text()):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """The folder of the cache, for all pages."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def folder(tmp_path):
    """A folder as a reader of a page has it: the scenes, a mesh and a measurement of their own."""
    path = tmp_path / "reader"
    shutil.copytree(ROOT / "scenes", path / "scenes")
    (path / "bunny.obj").write_text(TRIANGLE)
    (path / "paint_rgb.bsdf").write_bytes(rgl_files.tensor_file(rgl_files.noise()))
    return path


def view_answers(line, folder, environment):
    """Run a command that serves a page, load the page, and interrupt it."""
    pytest.importorskip("websockets")
    words = [sys.executable, "-m", "illumcli", *shlex.split(line, comments=True)[1:], "--no-browser"]
    with subprocess.Popen(words, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            url = process.stdout.readline().strip()
            assert url.startswith("http://127.0.0.1:"), line
            with urllib.request.urlopen(url) as answer:
                assert b"illum view" in answer.read()
        finally:
            process.send_signal(signal.SIGINT)
    assert process.returncode == -signal.SIGINT, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_runs(page, folder, cache):
    place_files(page, folder)
    for line in commands(page):
        environment = {**os.environ, "ILLUM_CACHE": str(cache)}
        if line.startswith("illum view "):
            view_answers(line, folder, environment)
            continue
        small = re.sub(r"\billum (render|sweep)\b", rf"illum \1 {SMALL}", line)
        command = ["bash", "-ec", f'illum() {{ {shlex.quote(sys.executable)} -m illumcli "$@"; }}; {small}']
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        allowed = (0, 3) if line.startswith("illum compare") else (0,)
        assert done.returncode in allowed, (line, done.stderr)


def test_readmes_sample_of_mistakes_is_what_is_printed(folder):
    scene = folder / "scenes" / "teapot.yaml"
    right = scene.read_text()
    scene.write_text(right.replace("blinn_phong", "blinn_fong").replace("specular: 0.45", "specular: -0.45"))
    command = [sys.executable, "-m", "illumcli", "check", "scenes/teapot.yaml"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    scene.write_text(right)
    assert done.returncode == 2
    assert f"```text\n{done.stderr}```\n" in (ROOT / "README.md").read_text()
    assert len(done.stderr.splitlines()) == 2


def test_getting_started_shows_the_mistake_that_is_printed(folder):
    page = ROOT / "docs" / "getting-started.md"
    place_files(page, folder)
    scene = folder / "first.yaml"
    scene.write_text(scene.read_text().replace("oren_nayar", "oren_nayer"))
    command = [sys.executable, "-m", "illumcli", "check", "first.yaml"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert f"```text\n{done.stderr}```\n" in page.read_text()


def test_readme_names_every_command():
    text = (ROOT / "README.md").read_text()
    for name, what in COMMANDS.items():
        assert f"| `illum {name}` | {what} |\n" in text, name


def test_every_command_is_shown_on_a_page():
    text = "".join(page.read_text() for page in PAGES)
    for name in COMMANDS:
        assert re.search(rf"^illum {name}\b", text, flags=re.M), name


@pytest.mark.parametrize("scene", sorted((ROOT / "scenes").glob("*.yaml")), ids=lambda scene: scene.stem)
def test_every_scene_begins_with_its_title_and_its_idea(scene):
    """The gallery shows them."""
    assert re.match(r"# [^:\n]+: \S", scene.read_text()), scene.name


def test_ci_runs_the_readmes_two_commands():
    said = subprocess.run([ROOT / ".ci" / "readme"], capture_output=True, text=True, check=True).stdout
    first, second = said.splitlines()
    assert f"```sh\n{first}\n{second}\n```\n" in (ROOT / "README.md").read_text()
    assert first.startswith("python3 -m venv ")
    assert " -m pytest " in second


def test_ci_tries_the_lowest_versions_that_are_allowed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = {*project["dependencies"], *itertools.chain(*project["optional-dependencies"].values())}
    lowest = subprocess.run([ROOT / ".ci" / "lowest"], capture_output=True, text=True, check=True).stdout
    assert sorted(lowest.split()) == sorted(each.replace(">=", "==") for each in wanted)
    assert (ROOT / ".ci" / "lowest.txt").read_text() == lowest


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_of_the_repository(page):
    """Readers of the repository have no site."""
    linked = re.findall(r"\]\(([^)#\s:]+)[)#]", page.read_text())
    assert [name for name in linked if not (page.parent / name).exists()] == []

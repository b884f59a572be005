"""The examples of docs/own-models.md: its test passes, its claims hold, its package is installed and used."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from test_docs import ROOT, place_files


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files of the page."""
    path = tmp_path_factory.mktemp("own")
    place_files(ROOT / "docs" / "own-models.md", path)
    return path


def run(folder, *words, **environment):
    """The finished process of a module of Python."""
    known = {**os.environ, "ILLUM_CACHE": str(folder / "cache"), **environment}
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, env=known, capture_output=True, text=True, check=False
    )


def test_the_test_of_the_model_passes(folder):
    done = run(folder, "pytest", "-q", "-p", "no:cacheprovider", "my_models")
    assert "1 passed" in done.stdout, done.stdout + done.stderr


def test_the_claims_hold(folder):
    done = run(folder, "illumcli", "verify", "velvet.yaml")
    assert done.returncode == 0, done.stdout
    assert "5 claims" not in done.stderr
    assert {line.split()[1] for line in done.stdout.splitlines() if line.startswith("suede")} == {
        "light", "reciprocal", "isotropic", "conserving",
    }  # fmt: skip


def test_the_package_is_used_where_it_is_installed(folder):
    """As pip lays it out: the package, and its entry points in a folder of metadata."""
    site = folder / "site"
    info = site / "fuzzy-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "fuzzy").mkdir()
    (site / "fuzzy" / "__init__.py").touch()
    shutil.copy(folder / "my_models" / "fuzz.py", site / "fuzzy")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fuzzy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[illumcli.models]\nfuzz = fuzzy.fuzz\n")
    path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    film = ("-D", "film={width: 8, height: 6, samples: 1}")
    assert run(folder, "illumcli", "render", "fuzz.yaml", *film, "-o", "f.png").returncode == 2
    done = run(folder, "illumcli", "render", "fuzz.yaml", *film, "-o", "f.png", PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    assert "fuzz " in run(folder, "illumcli", "models", PYTHONPATH=path).stdout
    assert '"fuzz"' in run(folder, "illumcli", "schema", PYTHONPATH=path).stdout

    # Changed code makes other pictures, of the same version of the package too.
    again = run(folder, "illumcli", "render", "fuzz.yaml", *film, "-o", "f.png", PYTHONPATH=path)
    assert "kept" in again.stderr
    source = site / "fuzzy" / "fuzz.py"
    source.write_text(source.read_text().replace("n_l / np.pi", "n_l / 3"))
    changed = run(folder, "illumcli", "render", "fuzz.yaml", *film, "-o", "f.png", PYTHONPATH=path)
    assert "a different file is there" in changed.stderr

"""Members of families in folders of the user and in other packages: found, refused, identified."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from illumcli.cache.fingerprint import digest, fingerprint
from illumcli.errors import InputError
from illumcli.schema.docs import field_docs
from illumcli.schema.families import member, members, tag_of
from illumcli.schema.foreign import BrokenMember
from illumcli.schema.sources import entry_points, tags
from illumcli.visibility.falloffs import linear

MODELS = "illumcli.models"
FUZZ = '''"""Fuzz.

response = rim * n_l
"""

from typing import Literal

from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Share


class Fuzz(IlluminationModel):
    model: Literal["fuzz"] = "fuzz"
    rim: Varying[Share] = 0.3
    """The rim."""

    def diffuse_lobe(self, n_l):
        return tint((1.0, 1.0, 1.0), n_l * self.rim)
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder that ILLUM_MODELS names."""
    path = tmp_path / "own"
    path.mkdir()
    monkeypatch.setenv("ILLUM_MODELS", str(path))
    return path


def faults_of(folder):
    """Name of the file, and the rest of each problem."""
    with pytest.raises(InputError) as refused:
        members(MODELS)
    return [line.removeprefix(f"{folder}/") for line in refused.value.problems]


def test_a_file_of_the_folder_is_a_member(folder):
    (folder / "fuzz.py").write_text(FUZZ)
    assert "fuzz" in tags(MODELS)
    Fuzz = member(MODELS, "fuzz")
    assert Fuzz in members(MODELS)
    assert tag_of(Fuzz) == "fuzz"
    assert field_docs(Fuzz)["rim"] == "The rim."
    assert member(MODELS, "fuzz") is Fuzz
    assert [path.name for path in folder.iterdir()] == ["fuzz.py"]


def test_a_changed_file_is_another_class_with_another_fingerprint(folder):
    """In the same second and of the same length, which compiled files would not notice."""
    (folder / "fuzz.py").write_text(FUZZ)
    before = member(MODELS, "fuzz")()
    (folder / "fuzz.py").write_text(FUZZ.replace("n_l * self.rim)", "n_l / self.rim)"))
    after = member(MODELS, "fuzz")()
    assert type(before) is not type(after)
    assert digest(before) != digest(after)
    (folder / "fuzz.py").write_text(FUZZ)
    assert digest(member(MODELS, "fuzz")()) == digest(before)


def test_helpers_beside_it_are_imported_and_part_of_its_identity(folder):
    (folder / "_half.py").write_text("HALF = 0.5\n")
    (folder / "test_fuzz.py").write_text("1 / 0\n")
    (folder / "fuzz.py").write_text(
        FUZZ.replace("0.3", "HALF").replace("from typing", "from ._half import HALF\nfrom typing")
    )
    assert member(MODELS, "fuzz")().rim == 0.5
    before = digest(member(MODELS, "fuzz")())
    (folder / "_half.py").write_text("HALF = 0.25\n")
    assert member(MODELS, "fuzz")().rim == 0.25
    assert digest(member(MODELS, "fuzz")()) != before


def test_broken_files_are_refused_all_at_once_with_their_lines(folder):
    (folder / "syntax.py").write_text("x = 1\ndef f(:\n")
    (folder / "importing.py").write_text("\n\nimport no_such_module\n")
    (folder / "empty.py").write_text("x = 1\n")
    (folder / "double.py").write_text(FUZZ + "\nclass Other(IlluminationModel):\n    pass\n")
    (folder / "other.py").write_text(FUZZ)
    (folder / "lobeless.py").write_text(FUZZ.replace("fuzz", "lobeless").replace("diffuse_lobe", "response"))
    (folder / "foreign.py").write_text(
        FUZZ.replace("fuzz", "foreign").replace("(IlluminationModel)", "(IlluminationModel.__base__)")
    )
    (folder / "typo.py").write_text(FUZZ.replace("fuzz", "typo").replace("Varying[Share]", "Varyin[Share]"))
    (folder / "leaving.py").write_text("import sys\nsys.exit(3)\n")
    (folder / "untyped.py").write_text(FUZZ.replace("fuzz", "untyped").replace(": Varying[Share]", ""))
    told = faults_of(folder)
    assert len(told) == 10
    for start, fact in (
        ("syntax.py:2: ", ""),
        ("importing.py:3: ", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("empty.py: ", "must define one class"),
        ("double.py: ", "defines 2: Fuzz, Other"),
        ("other.py:14: ", 'needs the field model: Literal["other"]'),
        ("lobeless.py:14: ", "has no lobe; define diffuse_lobe or specular_lobe"),
        ("foreign.py:14: ", "must be a subclass of illumcli.models._base.IlluminationModel"),
        ("typo.py:16: ", "name 'Varyin' is not defined"),
        ("leaving.py:2: ", "SystemExit: 3"),
        ("untyped.py:14: ", "PydanticUserError: A non-annotated attribute was detected"),
    ):
        assert any(line.startswith(start) and fact in line for line in told), (start, told)
    assert not any("\n" in line for line in told)


def test_a_tag_of_this_package_or_of_another_folder_is_refused(folder, tmp_path, monkeypatch):
    (folder / "phong.py").write_text(FUZZ)
    with pytest.raises(InputError, match=r"own/phong.py: 'phong' is a member of .* already; rename"):
        member(MODELS, "lambert")
    (folder / "phong.py").rename(folder / "fuzz.py")
    other = tmp_path / "other"
    other.mkdir()
    (other / "fuzz.py").write_text(FUZZ)
    monkeypatch.setenv("ILLUM_MODELS", f"{folder}:{other}")
    with pytest.raises(InputError, match=r"other/fuzz.py: 'fuzz' is .*own/fuzz.py already; rename"):
        member(MODELS, "fuzz")
    monkeypatch.setenv("ILLUM_MODELS", str(tmp_path / "none"))
    with pytest.raises(InputError, match=r"ILLUM_MODELS: .*none: no such file or directory; name a folder"):
        member(MODELS, "lambert")


# --- entry points of other packages ------------------------------------------------------------------------


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Installs a package with modules and entry points, as pip would: name, version, group, tag, module."""
    monkeypatch.syspath_prepend(tmp_path)
    entry_points.cache_clear()

    def install(name, lines, **modules):
        info = tmp_path / f"{name}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
        for module, text in modules.items():
            (tmp_path / name / f"{module}.py").write_text(text)
        entry_points.cache_clear()

    yield install
    entry_points.cache_clear()
    for name in [each for each in sys.modules if each.startswith("acme_")]:
        del sys.modules[name]


def test_an_entry_point_is_a_member(package):
    package("acme_a", ["[illumcli.models]", "fuzz = acme_a.fuzz:Fuzz"], fuzz=FUZZ)
    assert "fuzz" in tags(MODELS)
    model = member(MODELS, "fuzz")()
    assert type(model).__module__ == "acme_a.fuzz"
    assert field_docs(type(model))["rim"] == "The rim."
    assert "sources of its class" in fingerprint(model)


def test_other_families_have_entry_points_too(package):
    text = Path(linear.__file__).read_text().replace('["linear"]', '["rise"]')
    package("acme_b", ["[illumcli.falloffs]", "rise = acme_b.rise"], rise=text)
    assert tag_of(member("illumcli.visibility.falloffs", "rise")) == "rise"


def test_entry_points_that_cannot_be_used_are_refused(package):
    package(
        "acme_c",
        ["[illumcli.models]", "fuzz = acme_c.hair", "gone = acme_c.gone", "bad = acme_c.bad"],
        hair=FUZZ,
        bad="import nothing_there\n",
    )
    for tag, fact in (
        ("fuzz", "the module must have the name of its tag, fuzz"),
        ("gone", "ModuleNotFoundError"),
        ("bad", "No module named 'nothing_there'"),
    ):
        with pytest.raises(BrokenMember) as refused:
            member(MODELS, tag)
        (line,) = refused.value.problems
        assert line.startswith(f"package acme_c 1.2: entry point {tag} of illumcli.models: ")
        assert fact in line


def test_an_entry_point_with_a_tag_of_this_package_is_refused(package):
    package("acme_d", ["[illumcli.models]", "phong = acme_d.phong"], phong=FUZZ)
    with pytest.raises(InputError, match=r"package acme_d 1.2: .* 'phong' is a member of .* already"):
        tags(MODELS)
    assert member(MODELS, "phong").__module__ == "illumcli.models.phong"


def test_entry_points_are_not_read_for_members_of_this_package(tmp_path):
    scene = tmp_path / "s.yaml"
    scene.write_text("version: 1\nobjects: [{mesh: {shape: box}, material: {model: phong}}]\n")
    code = f"""
import importlib.metadata
def refused(**named):
    assert named == {{"group": "pydantic"}}, named
    return ()
importlib.metadata.entry_points = refused
from illumcli.scene.load import load
load(__import__("pathlib").Path({str(scene)!r}))
"""
    subprocess.run([sys.executable, "-c", code], check=True)

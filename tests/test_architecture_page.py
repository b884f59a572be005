"""The page about the architecture names files that exist, and its picture agrees with the imports."""

from __future__ import annotations

import re
import runpy


def test_the_picture_is_up_to_date(root):
    drawn = runpy.run_path(str(root / "docs" / "make_architecture.py"))["svg"]()
    assert (root / "docs" / "architecture.svg").read_text() == drawn, "python docs/make_architecture.py"


def test_the_page_names_files_of_the_package(root):
    page = (root / "docs" / "architecture.md").read_text()
    named = re.findall(r"`([a-z_]+/[a-z_/]*(?:\.py)?)`", page)
    assert len(named) > 20
    for name in named:
        if not name.startswith(("docs/", "src/")):
            assert (root / "src" / "illumcli" / name).exists(), name


def test_the_page_tells_what_every_folder_holds(root):
    table = (root / "docs" / "architecture.md").read_text().partition("| folder | holds |")[2]
    named = set(
        re.findall(
            r"`(\w+)`", "".join(line.split(" | ")[0] for line in table.splitlines() if line[:1] == "|")
        )
    )
    assert {path.parent.name for path in (root / "src" / "illumcli").glob("*/__init__.py")} - named == set()

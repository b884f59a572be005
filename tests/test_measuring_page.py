"""measuring.md: its pictures are those that the script draws."""

from __future__ import annotations

import re


def test_every_picture_is_drawn_and_shown(root):
    page = (root / "docs" / "measuring.md").read_text()
    shown = re.findall(r"\(measuring/(\w+)\.png\)", page)
    pictures = list((root / "docs" / "measuring").glob("*.png"))
    assert {path.stem for path in pictures} == set(shown)
    assert sum(path.stat().st_size for path in pictures) < 800_000
    drawn = (root / "docs" / "make_measuring.py").read_text().partition("DRAWINGS: ")[2]
    assert re.findall(r'^    "(\w+)":', drawn, flags=re.M) == shown

"""The page of models agrees with the code, and its picture exists."""

from __future__ import annotations

import runpy

from illumcli.schema.sources import tags


def test_the_page_is_up_to_date(root):
    made = runpy.run_path(str(root / "docs" / "make_models.py"))["text"]()
    assert (root / "docs" / "models.md").read_text() == made, "write it anew: python docs/make_models.py"
    for name in tags("illumcli.models"):
        assert f"\n## {name}\n" in made


def test_the_gallery_is_small_enough_to_load(root):
    assert (root / "docs" / "gallery.png").stat().st_size < 600_000

"""Builds the site from this folder: python docs/make_site.py [FOLDER] [--draft], by default build/site.

It needs `pip install '.[site]'` and no network. What did not change since the last build is kept. A draft,
for tests, has small pictures.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sphinx.cmd.build import build_main

from sitepages import command_reference, gallery, model_pages, scene_reference, source
from sitepages.drawing import draw
from sitepages.examples import Examples


def main(folder: Path, draft: bool) -> int:
    """Write the pages that Sphinx reads, and build them; the exit code of Sphinx."""
    examples = Examples(source.scenes())
    pages = source.hand_written() | scene_reference.pages(examples) | model_pages.pages(examples)
    pages |= command_reference.pages()
    drawn = draw(model_pages.drawings(), folder / "drawn", draft)
    shown = gallery.pages(folder / "gallery", draft)
    source.write(
        folder / "source",
        pages | shown | source.pictures() | source.notebooks() | drawn | source.linked_files(pages),
    )
    # -a: Sphinx forgets the index entries of pages that it does not write again, and search needs them
    words = ["-a", "-c", source.DOCS, "-W", "--keep-going", "-q", "-j", "2", "-d", folder / "doctrees"]
    return build_main([str(word) for word in [*words, folder / "source", folder / "html"]])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Build the site.")
    parser.add_argument("folder", nargs="?", type=Path, default=source.ROOT / "build" / "site")
    parser.add_argument("--draft", action="store_true", help="small pictures")
    given = parser.parse_args()
    sys.exit(main(given.folder, given.draft))

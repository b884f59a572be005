"""Builds the site from this folder: python docs/make_site.py [FOLDER], by default build/site.

It needs `pip install '.[site]'` and no network. What did not change since the last build is kept.
"""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.cmd.build import build_main

from sitepages import source


def main(folder: Path) -> int:
    """Write the pages that Sphinx reads, and build them; the exit code of Sphinx."""
    pages = source.hand_written()
    source.write(folder / "source", pages | source.pictures() | source.linked_files(pages))
    words = ["-c", source.DOCS, "-W", "--keep-going", "-q", "-j", "2", "-d", folder / "doctrees"]
    return build_main([str(word) for word in [*words, folder / "source", folder / "html"]])


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else source.ROOT / "build" / "site")))

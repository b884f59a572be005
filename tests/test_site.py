"""The site builds without a warning, and its links lead somewhere."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urldefrag, urlsplit

import pytest


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    script = Path(__file__).parents[1] / "docs" / "make_site.py"
    done = subprocess.run([sys.executable, script, folder], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not done.stderr
    return folder / "html"


class Page(NamedTuple):
    """What a page names, and where it leads."""

    anchors: set[str]
    links: list[str]


def read(path: Path) -> Page:
    """The anchors of a page, and its links, pictures, scripts and styles."""
    page = Page(set(), [])

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
            for name, value in attributes:
                if name == "id" and value:
                    page.anchors.add(value)
                elif name in ("href", "src") and value:
                    page.links.append(value)

    Reader().feed(path.read_text())
    return page


def test_every_link_leads_somewhere(site):
    pages = {path: read(path) for path in site.rglob("*.html")}
    broken, count = [], 0
    for path, page in pages.items():
        for link in page.links:
            if urlsplit(link).scheme:
                continue
            file, anchor = urldefrag(link)
            target = (path.parent / unquote(urlsplit(file).path)).resolve() if file else path
            count += 1
            known = target in pages and (not anchor or unquote(anchor) in pages[target].anchors)
            if not (known or (target not in pages and target.is_file())):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert not broken
    print(len(pages), "pages,", count, "links")


def test_nothing_is_loaded_from_elsewhere(site):
    for path in site.rglob("*.html"):
        loaded = HTMLLoads()
        loaded.feed(path.read_text())
        assert not [url for url in loaded.urls if urlsplit(url).netloc], path.name


class HTMLLoads(HTMLParser):
    """URLs that a browser loads to show a page."""

    def __init__(self) -> None:
        super().__init__()
        self.urls: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        name = {"link": "href", "script": "src", "img": "src", "iframe": "src"}.get(tag)
        self.urls += [value for key, value in attributes if key == name and value]

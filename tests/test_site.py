"""The site builds without a warning, and its links lead somewhere."""

from __future__ import annotations

import fcntl
import os
import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote_plus, unquote, urldefrag, urlsplit

import jsonschema
import pytest
import yaml

from illumcli.commands.schema_generator import schema_of
from illumcli.scene.spec import Scene
from illumcli.schema.families import members
from illumcli.schema.sources import FAMILIES, tags


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The folder of the built site, which the processes of one run share."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "site"
    with open(folder.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            script = Path(__file__).parents[1] / "docs" / "make_site.py"
            words = [sys.executable, script, folder, "--draft"]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
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
    assert len(pages) > 100
    broken = []
    for path, page in pages.items():
        for link in page.links:
            if urlsplit(link).scheme:
                continue
            file, anchor = urldefrag(link)
            target = (path.parent / unquote(urlsplit(file).path)).resolve() if file else path
            known = target in pages and (not anchor or unquote(anchor) in pages[target].anchors)
            if not (known or (target not in pages and target.is_file())):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert not broken


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


def test_every_model_has_a_page_with_its_formula_and_plots(site):
    for tag in tags("illumcli.models"):
        text = (site / "models" / f"{tag}.html").read_text()
        assert "<math" in text or tag == "formula", tag
        assert text.count("<img") >= (tag not in ("merl", "rgl")), tag


def test_the_python_reference_says_what_each_part_is(site):
    text = (site / "python-reference.html").read_text()
    documented = re.findall(r'<dt class="sig[^>]*\bid="([^"]+)".*?<dd>(.*?)</dd>', text, re.DOTALL)
    assert len(documented) > 60
    assert not [name for name, words in documented if not words]
    assert ">Type<" not in text  # words before a colon, taken for a type


def test_formulas_are_read_as_they_are_meant(root, monkeypatch):
    monkeypatch.syspath_prepend(str(root / "docs"))
    from sitepages.formulas import FormulaError, mathml

    def plain(formula: str) -> str:
        text = re.sub(r"<(/?)(mfrac|msup|msqrt|msub)>", r" \1\2 ", mathml(formula))
        return " ".join(re.sub(r"<[^>]*>", " ", text).split())

    assert plain("r = kd / pi * n_l") == "r = mfrac msub k d /msub π /mfrac ( n ⋅ l )"
    assert plain("C = (e + 2) / (8 pi)") == "C = mfrac e + 2 8 π /mfrac"
    assert plain("x = 28 Rd / (23 pi) (1 - Rs)") == (
        "x = mfrac 28 msub R d /msub 23 π /mfrac ( 1 − msub R s /msub )"
    )
    assert plain("f = tan^2(theta) + n_h**(-e/2)") == (
        "f = msup tan 2 /msup ( θ ) + msup ( n ⋅ h ) − mfrac e 2 /mfrac /msup"
    )
    assert plain("q = <E> / |t x l|,  w = g(a, b)") == "q = mfrac ⟨ E ⟩ | t × l | /mfrac w = g ( a , b )"
    with pytest.raises(FormulaError):
        mathml("s = l + v is the vector. It is not of unit length")


def test_the_examples_of_keys_are_valid(root, monkeypatch):
    monkeypatch.syspath_prepend(str(root / "docs"))
    from sitepages import facts, source
    from sitepages.examples import Examples

    examples = Examples(source.scenes())
    for cls in [Scene, *(cls for family in FAMILIES for cls in members(family))]:
        whole = schema_of(cls)
        definitions = whole.pop("$defs", {})
        below = facts.parts_below(
            {**whole, "$defs": definitions}, lambda title, _: title not in facts.INTERNAL
        )
        for part in [facts.part_of(whole), *below.values()]:
            for fact in facts.facts(part, definitions):
                text = examples.of(part, fact)
                valid = {"$defs": definitions, **fact.schema}
                if not re.search(r"\bcurve:", text):
                    jsonschema.Draft202012Validator(valid).validate(yaml.safe_load(text))


@pytest.mark.parametrize(
    ("words", "pages"),
    [
        ("Ambient occlusion", {"obscurance"}),
        ("AO bake", {"obscurance"}),
        ("BRDF viewer", {"view", "figures"}),
        ("vertex colours", {"baking"}),
        ("oren_nayar", {"models/oren_nayar"}),
    ],
)
def test_words_lead_to_the_right_page(words, pages, site, chromium):
    """From disk, as a reader opens it, the search lists the page first."""
    chromium.get(f"{(site / 'search.html').as_uri()}?q={quote_plus(words)}")
    links = "return [...document.querySelectorAll('ul.search li a')].map(a => a.getAttribute('href'))"
    deadline = time.monotonic() + 20
    while not (found := chromium.execute_script(links)) and time.monotonic() < deadline:
        time.sleep(0.1)
    chromium.get("about:blank")
    chromium.get_log("browser")  # the search asks for excerpts of pages, which a browser refuses from disk
    assert found
    assert urldefrag(found[0])[0].removesuffix(".html") in pages, found[:5]

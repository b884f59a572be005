"""The folder of a report: what is kept, replaced, refused; that everything in it is escaped."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from illumcli.errors import InputError, OutputError
from illumcli.html_report.data import data_contents
from illumcli.html_report.folder import is_report_kept, write_report
from painted import HOSTILE, contents_of

CSS = "assets/report.css"


@pytest.fixture
def made(tmp_path):
    """A report of nine variants without faults: its folder, and what it says."""
    contents = contents_of(tmp_path, 7)
    write_report(tmp_path / "report", contents)
    return tmp_path / "report", contents


def hashes(contents):
    return [entry.content for entry in contents.entries]


def test_the_same_report_is_kept(made):
    folder, contents = made
    assert data_contents(folder / "data.js") == hashes(contents)
    assert is_report_kept(folder, hashes(contents), force=False)
    assert not is_report_kept(folder, hashes(contents), force=True)


@pytest.mark.parametrize("missing", ["index.html", CSS, "pictures/*.js", "pictures/*.jpg"])
def test_a_report_that_lacks_a_file_is_written_again(made, missing):
    folder, contents = made
    next(iter(sorted(folder.glob(missing)))).unlink()
    assert not is_report_kept(folder, hashes(contents), force=False)
    write_report(folder, contents)
    assert is_report_kept(folder, hashes(contents), force=False)


def test_another_report_is_not_replaced_without_force(made):
    folder, contents = made
    with pytest.raises(OutputError, match=r"data\.js: a different file is there; use --force"):
        is_report_kept(folder, ["0" * 32], force=False)
    data = folder / "data.js"
    data.write_text(data.read_text().replace("rendered", "Rendered"))
    with pytest.raises(OutputError, match="changed or damaged"):
        is_report_kept(folder, hashes(contents), force=False)


def test_an_incomplete_report_is_completed(made):
    folder, contents = made
    last = contents.entries[-1]
    failed = replace(last, content="incomplete", state="failed", error="no", pictures={})
    write_report(folder, replace(contents, entries=(*contents.entries[:-1], failed)))
    assert len(list(folder.glob("pictures/*"))) == 2 * 6  # those of the last variant are removed
    assert not is_report_kept(folder, hashes(contents), force=False)
    write_report(folder, contents)
    assert is_report_kept(folder, hashes(contents), force=False)


def test_pages_and_files_of_others_are_left_alone(tmp_path):
    (tmp_path / "index.html").write_text("<!doctype html><title>mine</title>")
    with pytest.raises(OutputError, match="a page of another program is there"):
        is_report_kept(tmp_path, ["a"], force=False)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file; give the name of a folder"):
        is_report_kept(tmp_path / "file", ["a"], force=False)
    (tmp_path / "other" / "pictures").mkdir(parents=True)
    theirs = tmp_path / "other" / "pictures" / "holiday.jpg"
    theirs.write_text("")
    write_report(tmp_path / "other", contents_of(tmp_path, 3))
    assert theirs.exists()


def test_without_jinja2_the_message_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(InputError, match=re.escape("pip install 'illumcli[html]'")):
        is_report_kept(tmp_path / "report", ["a"], force=False)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_vanished_is_told(tmp_path):
    contents = contents_of(tmp_path, 3)
    (tmp_path / "out" / "1.png").unlink()
    with pytest.raises(OutputError, match=r"1\.png: was written, but cannot be read any more"):
        write_report(tmp_path / "report", contents)
    assert not (tmp_path / "report" / "data.js").exists()


class Tags(HTMLParser):
    """Tags, attributes and text of a page."""

    def __init__(self):
        super().__init__()
        self.tags, self.attributes, self.text = [], [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [name for name, _ in attrs]

    def handle_data(self, data):
        self.text += data


def test_the_page_is_escaped(made):
    folder, _ = made
    tags = Tags()
    tags.feed((folder / "index.html").read_text())
    assert HOSTILE in tags.text
    assert "img" not in tags.tags
    assert not [name for name in tags.attributes if name.startswith("on")]
    assert (folder / "data.js").read_bytes().isascii()


def test_nothing_is_loaded_from_elsewhere(made):
    folder, _ = made
    forbidden = r"(https?:)?//[a-z]|@import|url\(|\bfetch\(|XMLHttpRequest|innerHTML|insertAdjacentHTML"
    for path in (folder / "index.html", *(folder / "assets").iterdir()):
        assert not re.search(forbidden, without_comments(path)), path


def without_comments(path):
    return re.sub(r"^\s*//.*$|/\*.*?\*/", "", path.read_text(), flags=re.M | re.S)


def luminance(color):
    """Of #rgb or #rrggbb, after WCAG 2."""
    digits = color[1:] if len(color) == 7 else "".join(2 * digit for digit in color[1:])
    shares = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return sum(weight * share for weight, share in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast(made, scheme):
    folder, _ = made
    light, dark = re.findall(r":root \{([^}]*)\}", (folder / CSS).read_text())
    found = dict(re.findall(r"--([\w-]+): (#\w+)", light))
    if scheme == "dark":
        found |= dict(re.findall(r"--([\w-]+): (#\w+)", dark))
    pairs = [(text, back) for text in ("text", "quiet", "fault") for back in ("page", "panel", "raised")]
    pairs += [("on-accent", "accent"), ("panel", "a"), ("panel", "b"), ("fault", "mat"), ("accent", "panel")]
    for text, back in pairs:
        high, low = sorted((luminance(found[text]), luminance(found[back])), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text, back)

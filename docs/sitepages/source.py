"""The folder that Sphinx reads: pages of `docs` and of the repository, with links that hold on the site."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SCENES = ROOT / "scenes"

MOVED = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "benchmarks/README.md": "benchmarks.md",
}
"""File of the repository outside of `docs` -> its page on the site."""
SEARCHED = {
    "obscurance.md": ("ambient occlusion", "AO", "AO bake", "bake ambient occlusion"),
    "baking.md": ("vertex colours", "vertex colors", "bent normals", "thickness"),
    "baking-faults.md": ("AO artifacts", "dark blobs", "seams"),
    "figures.md": ("BRDF viewer", "BRDF plot", "lobe plot"),
    "view.md": ("BRDF viewer", "interactive", "live view"),
    "textures.md": ("AO map", "AO texture", "lightmap"),
    "sweeps.md": ("parameter sweep", "batch rendering"),
}
"""Page -> words that people search it by, beside those of its text."""
COPIES = "files/"
"""Folder of the site for other files that pages link to."""
PICTURES = ("*.png", "*.svg")

LINK = re.compile(r"\[((?:[^][]|\[[^]]*\])*)\]\(([^)#\s]+)((?:#[^)\s]*)?)\)")
"""Text, file and anchor of a link or picture."""


def hand_written() -> dict[str, str]:
    """Name -> text of the pages that people write."""
    pages = {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.glob("*.md"))}
    pages |= {page: ROOT / file for file, page in MOVED.items()}
    written = {page: with_links(path.read_text(), path) for page, path in pages.items()}
    for page in written.keys() & SEARCHED.keys():
        words = SEARCHED[page]
        title, _, rest = written[page].partition("\n")
        written[page] = f"{title}\n\n```{{index}} {', '.join(f'! {each}' for each in words)}\n```\n{rest}"
    if unlisted := [page[:-3] for page in written if not _is_listed(page[:-3], written)]:
        written["index.md"] += "\n```{toctree}\n:hidden:\n\n" + "\n".join(unlisted) + "\n```\n"
    return written


def _is_listed(page: str, pages: Mapping[str, str]) -> bool:
    """Is a page in the table of contents of another?"""
    return page == "index" or any(re.search(rf"^{page}$", text, flags=re.M) for text in pages.values())


def notebooks() -> dict[str, bytes]:
    """Name -> content of the notebooks."""
    return {f"notebooks/{path.name}": path.read_bytes() for path in sorted(DOCS.glob("notebooks/*.ipynb"))}


def with_links(text: str, path: Path) -> str:
    """The text of a file, with links that hold on the site."""

    def link(match: re.Match[str]) -> str:
        words, file, anchor = match.groups()
        target = (path.parent / file).resolve()
        if ":" in file or not target.is_relative_to(ROOT):
            return match[0]
        if target.is_dir() and target != SCENES:
            return words
        page = place(target.relative_to(ROOT).as_posix())
        if page == "models.md" and anchor:
            page, anchor = f"models/{anchor[1:]}.md", ""
        return f"[{words}]({page}{anchor})"

    return LINK.sub(link, text)


def place(file: str) -> str:
    """Where a file of the repository is on the site: a page, a picture, or a copy to look at."""
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    if file == "scenes":
        return "gallery.md"
    if re.fullmatch(r"scenes/[\w-]+\.yaml", file):
        return f"gallery/{Path(file).stem}.md"
    return MOVED.get(file, COPIES + file)


def scenes() -> list[Path]:
    """The scenes of the repository."""
    return sorted(SCENES.glob("*.yaml"))


def pictures() -> dict[str, bytes]:
    """Name -> content of the pictures below `docs`."""
    paths = sorted(path for pattern in PICTURES for path in DOCS.rglob(pattern))
    return {path.relative_to(DOCS).as_posix(): path.read_bytes() for path in paths}


def linked_files(pages: Mapping[str, str]) -> dict[str, bytes]:
    """The files of the repository that pages link to."""
    linked = {match[2] for text in pages.values() for match in LINK.finditer(text)}
    files = sorted(name.removeprefix(COPIES) for name in linked if name.startswith(COPIES))
    return {COPIES + name: (ROOT / name).read_bytes() for name in files}


def write(folder: Path, pages: Mapping[str, str | bytes]) -> None:
    """Make a folder hold exactly these files; those that are equal are not touched."""
    for old in sorted(folder.rglob("*")):
        if old.is_file() and old.relative_to(folder).as_posix() not in pages:
            old.unlink()
    for name, content in pages.items():
        path = folder / name
        data = content.encode() if isinstance(content, str) else content
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

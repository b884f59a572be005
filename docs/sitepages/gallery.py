"""The gallery: every scene with its picture, its YAML, its command, seconds and error.

The renderer itself keeps a picture whose content would be the same, so that only changed scenes render again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import OpenImageIO

from illumcli.errors import OutputError
from illumcli.scene.load import load, read_frames, read_text
from sitepages.drawing import SOURCE, digest_of, run
from sitepages.source import ROOT, scenes

HEAD = """\
# Gallery

Scenes of the folder `scenes`, each of which shows one idea. Choose one for its file to copy, its command,
how long it took and how large its error is.

::::{grid} 2 3 3 3
:gutter: 2

"""
CARD = """\
:::{{grid-item-card}} {title}
:link: gallery/{name}
:link-type: doc
:img-top: gallery/{thumbnail}
:::
"""
PAGE = """\
# {title}

{idea}

{pictures}

{facts}

```sh
{command}
```

`scenes/{name}.yaml`

```yaml
{text}```
"""
THUMBNAIL = 480
"""Width [pixels]."""
DRAFT = "film={width: 48, height: 27, samples: 1}"


class Entry(NamedTuple):
    """A scene of the gallery, as it was rendered."""

    title: str
    idea: str
    command: str
    pictures: list[str]
    seconds: float
    threads: int
    rays: int
    error: float | None
    """Root mean square of the standard error of pixels; None if it is not known."""


def pages(folder: Path, draft: bool) -> dict[str, str | bytes]:
    """Name -> content of the pages and pictures of the gallery, which is kept below a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    sources = digest_of([*SOURCE.rglob("*.py"), *SOURCE.rglob("*.c")])
    files = [path for path in (ROOT / "scenes").rglob("*") if path.is_file() and path.suffix != ".yaml"]
    inputs = digest_of(files)
    written: dict[str, str | bytes] = {}
    head = HEAD
    for scene in scenes():
        key = f"{sources} {inputs} {digest_of(read_text(scene).files)} {draft}"
        entry = _remembered(scene, folder, key, draft)
        names = [Path(picture).name for picture in entry.pictures]
        written |= {f"gallery/{Path(each).name}": Path(each).read_bytes() for each in entry.pictures}
        thumbnail = f"{scene.stem}.thumbnail.jpg"
        written[f"gallery/{thumbnail}"] = (folder / thumbnail).read_bytes()
        written[f"gallery/{scene.stem}.md"] = _page(scene, entry, names)
        head += CARD.format(title=entry.title, name=scene.stem, thumbnail=thumbnail)
    names = "\n".join(f"gallery/{scene.stem}" for scene in scenes())
    written["gallery.md"] = f"{head}::::\n\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"
    return written


def _page(scene: Path, entry: Entry, names: Sequence[str]) -> str:
    facts = [f"Rendered in {entry.seconds:.1f} s by {entry.threads} threads"]
    if entry.rays:
        facts.append(f"{entry.rays:,} rays")
    if entry.error is not None:
        facts.append(f"standard error of a pixel {entry.error:.1g} (root mean square)")
    return PAGE.format(
        title=entry.title,
        idea=entry.idea,
        pictures="\n\n".join(f"![{entry.title}]({name})" for name in names),
        facts=", ".join(facts) + ".",
        command=entry.command,
        name=scene.stem,
        text=scene.read_text(),
    )


def _remembered(scene: Path, folder: Path, key: str, draft: bool) -> Entry:
    """A scene as it was rendered with equal sources, or rendered now."""
    memory = folder / f"{scene.stem}.entry.json"
    if memory.exists() and (known := json.loads(memory.read_text()))["key"] == key:
        return Entry(**known["entry"])
    entry = _entry(scene, folder, draft)
    picture = OpenImageIO.ImageBuf(entry.pictures[0])
    spec = picture.spec()
    width = min(THUMBNAIL, spec.width)
    size = OpenImageIO.ROI(0, width, 0, max(width * spec.height // spec.width, 1), 0, 1, 0, 3)
    OpenImageIO.ImageBufAlgo.resize(picture, roi=size).write(str(folder / f"{scene.stem}.thumbnail.jpg"))
    memory.write_text(json.dumps({"key": key, "entry": entry._asdict()}))
    return entry


def _entry(scene: Path, folder: Path, draft: bool) -> Entry:
    """A scene, rendered below a folder unless its pictures are kept."""
    title, _, idea = scene.read_text().partition("\n")[0].lstrip("# ").partition(": ")
    numbers = read_frames(scene)
    middle = 0 if numbers is None else numbers.last // 2
    frames = [] if numbers is None else ["--frames", f"{middle}:{middle}"]
    small = ["-D", DRAFT] if draft else []
    report = _render(scene, folder, "", [*frames, *small])
    return Entry(
        title=title,
        idea=idea[:1].upper() + idea[1:],
        command=" ".join(["illum render", f"scenes/{scene.name}", *frames]),
        pictures=[*report["written"], *report["kept"]],
        seconds=report["total_seconds"],
        threads=report["threads"],
        rays=sum(report["rays"].values()),
        error=None if draft else _error(scene, folder, frames),
    )


def _error(scene: Path, folder: Path, frames: Sequence[str]) -> float | None:
    """The error of a picture, from one of a quarter of its size, whose pixels have as many samples."""
    film = load(scene).scene.film
    small = [f"film.width={max(film.width // 4, 1)}", f"film.height={max(film.height // 4, 1)}"]
    words = [*frames, "--only", "beauty", "--only", "error", "-D", small[0], "-D", small[1]]
    report = _render(scene, folder, ".small", words)
    return max((error["rms"] for error in report["standard_error"].values()), default=None)


def _render(scene: Path, folder: Path, kind: str, words: Sequence[str]) -> dict[str, Any]:
    """The report of a render, which is the old one where pictures are kept; `kind` is part of file names."""
    pattern = folder / f"{{scene}}.{{camera}}.{{layer}}{kind}.png"
    report = folder / f"{scene.stem}{kind}.report.json"
    command = ["render", str(scene), "-o", str(pattern), "--report", str(report), *words]
    try:
        run(command)
    except OutputError:  # another picture of this name: the scene has changed
        run([*command, "--force"])
    return json.loads(report.read_text())

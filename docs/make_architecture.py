"""Draws architecture.svg, the folders of the package and who imports whom, from the imports themselves.

Run it after a change to the imports between folders; a test compares the picture with what this draws.
An arrow from A to B says that A imports B; arrows that follow from others are left out.
"""

from __future__ import annotations

import ast
import importlib
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

PICTURE = Path(__file__).with_name("architecture.svg")
SOURCE = Path(__file__).parents[1] / "src" / "illumcli"

BOX_WIDTH, BOX_HEIGHT, GAP_X, GAP_Y, MARGIN, PASSAGE = 124, 34, 16, 46, 16, 8  # [pixels]
Slot: TypeAlias = tuple[str, str]
"""A place in a row: a folder and "", or a passage of the arrow to the second."""
STYLE = """\
text { font: 14px system-ui, sans-serif; text-anchor: middle; fill: #1a1a1a }
rect { fill: #f2efe9; stroke: #8a8478 }
path { fill: none; stroke: #8a8478; marker-end: url(#tip) }
#tip path { fill: #8a8478; stroke: none; marker-end: none }
svg { background: #ffffff }"""


def folders() -> list[str]:
    """Names of the package's folders."""
    return sorted(path.parent.name for path in SOURCE.glob("*/__init__.py"))


def imported(folder: str) -> set[str]:
    """Other folders of the package that any file of `folder` imports from."""
    known, seen = set(folders()), set()
    for path in sorted((SOURCE / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("illumcli"):
                module = node.module.split(".")
                seen |= {module[1]} if len(module) > 1 else {alias.name for alias in node.names}
    return seen & known - {folder}


def reduced(arrows: dict[str, set[str]]) -> dict[str, set[str]]:
    """The arrows without those that a chain of others implies."""

    @cache
    def below(folder: str) -> set[str]:
        direct = arrows[folder]
        return direct.union(*(below(other) for other in direct))

    return {
        folder: {other for other in direct if not any(other in below(between) for between in direct)}
        for folder, direct in arrows.items()
    }


def depths(arrows: dict[str, set[str]]) -> dict[str, int]:
    """Row of each folder: directly below the lowest of those that import it."""

    @cache
    def depth(folder: str) -> int:
        return 1 + max((depth(other) for other in arrows if folder in arrows[other]), default=-1)

    return {folder: depth(folder) for folder in arrows}


def layout(arrows: dict[str, set[str]]) -> tuple[list[list[Slot]], list[list[Slot]]]:
    """Rows of slots from the top, and each arrow as the slots it passes.

    An arrow over several rows takes a slot of its own in each, so that no arrow runs behind a box. Slots are
    sorted by the mean place of their neighbours above and below (Sugiyama et al. 1981).
    """
    row_of = depths(arrows)
    rows: list[list[Slot]] = [[] for _ in range(max(row_of.values()) + 1)]
    for folder, number in row_of.items():
        rows[number].append((folder, ""))
    chains = []
    for folder, others in arrows.items():
        for other in sorted(others):
            between = [(f"{folder} {number}", other) for number in range(row_of[folder] + 1, row_of[other])]
            for number, slot in enumerate(between, row_of[folder] + 1):
                rows[number].append(slot)
            chains.append([(folder, ""), *between, (other, "")])
    links = [pair for chain in chains for pair in pairwise(chain)]
    place = {slot: (k + 0.5) / len(row) for row in rows for k, slot in enumerate(row)}

    def middle(slot: Slot) -> float:
        near = [place[b] for a, b in links if a == slot] + [place[a] for a, b in links if b == slot]
        return sum(near) / len(near)

    for _ in range(24):
        for row in rows:
            row.sort(key=lambda slot: (middle(slot), slot))
            place |= {slot: (k + 0.5) / len(row) for k, slot in enumerate(row)}
    return rows, chains


def svg() -> str:
    """The picture: a box per folder with its purpose as a tooltip, an arrow per import."""
    rows, chains = layout(reduced({folder: imported(folder) for folder in folders()}))

    # Slots: rows from the top, each centred; (x, y) is the middle of a slot's upper edge.
    def breadth(slot: Slot) -> int:
        return PASSAGE if slot[1] else BOX_WIDTH

    breadths = [sum(breadth(slot) + GAP_X for slot in row) - GAP_X for row in rows]
    width, height = 2 * MARGIN + max(breadths), 2 * MARGIN + len(rows) * (BOX_HEIGHT + GAP_Y) - GAP_Y
    place = {}
    for r, row in enumerate(rows):
        x = (width - breadths[r]) / 2
        for slot in row:
            place[slot] = (x + breadth(slot) / 2, MARGIN + r * (BOX_HEIGHT + GAP_Y))
            x += breadth(slot) + GAP_X

    # Arrows: curves from the lower edge of a slot to the upper edge of the next, straight through passages.
    paths = []
    for chain in chains:
        x, y = place[chain[0]]
        line = f"M{x:g} {y + BOX_HEIGHT:g}"
        for upper, lower in pairwise(chain):
            (x0, y0), (x1, y1) = place[upper], place[lower]
            top, bottom = y0 + BOX_HEIGHT, y1 - (0 if lower[1] else 3)
            line += f"C{x0:g} {top + GAP_Y / 2:g} {x1:g} {bottom - GAP_Y / 2:g} {x1:g} {bottom:g}"
            line += f"V{y1 + BOX_HEIGHT:g}" if lower[1] else ""
        paths.append(f'<path d="{line}"/>')
    boxes = []
    for slot, (x, y) in place.items():
        if not slot[1]:
            purpose = (importlib.import_module(f"illumcli.{slot[0]}").__doc__ or "").strip().split("\n")[0]
            boxes.append(
                f"<g><title>{purpose}</title>"
                f'<rect x="{x - BOX_WIDTH / 2:g}" y="{y:g}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" '
                'rx="5"/>'
                f'<text x="{x:g}" y="{y + BOX_HEIGHT / 2 + 5:g}">{slot[0]}</text></g>'
            )
    marker = (
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0L8 4L0 8Z"/></marker></defs>'
    )
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}">'
    return "\n".join([head, f"<style>{STYLE}</style>", marker, *paths, *boxes, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg())
    print(PICTURE, file=sys.stderr)

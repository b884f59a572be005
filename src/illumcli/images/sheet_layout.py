"""Layout of contact sheets: where pictures and texts stand."""

from __future__ import annotations

import math
from collections.abc import Sequence

from illumcli.records import Value

GAP = 8
"""Between pictures [pixels]."""
TEXT = 14
"""Size of letters [pixels]."""
LETTER = 8
"""Width that a letter is given [pixels]."""
LONGEST = 40
"""Letters of a text that its column is made wide enough for."""
MAX_SIDE = 16384
MAX_PIXELS = 1 << 26
"""Of a sheet: larger ones show all pictures reduced by the same factor."""


NEAR_ONE = 0.99
"""Factor of each further reduction: texts and gaps keep their size."""


class Sheet(Value):
    """What a contact sheet shows."""

    cells: tuple[tuple[int | None, ...], ...]
    """Rows of numbers of pictures, all of one length; None leaves a cell empty."""
    captions: tuple[str, ...] = ()
    """Text below each picture; none if the heads say it."""
    column_heads: tuple[str, ...] = ()
    row_heads: tuple[str, ...] = ()


class Text(Value):
    """A line of text."""

    x: int  # of its left end
    y: int  # of its baseline
    text: str


class Placed(Value):
    """A picture in its place."""

    picture: int
    x: int
    y: int
    width: int
    height: int


class Row(Value):
    """A band of the sheet over its whole width; places are relative to its top."""

    height: int
    pictures: tuple[Placed, ...]
    texts: tuple[Text, ...]


class Layout(Value):
    """The bands of a sheet, from the top."""

    width: int
    rows: tuple[Row, ...]

    @property
    def height(self) -> int:
        return sum(row.height for row in self.rows)


def laid_out(sheet: Sheet, sizes: Sequence[tuple[int, int]]) -> Layout:
    """The layout of a sheet whose pictures have these sizes.

    Pictures are as large as they are, or, where the sheet would be larger than `MAX_SIDE` or `MAX_PIXELS`,
    reduced by the same factor.

    Parameters
    ----------
    sizes : sequence of (int, int)
        Height and width of each picture [pixels].
    """
    layout, factor = _placed(sheet, sizes), 1.0
    while _is_large(layout) and any(max(size) * factor > 1 for size in sizes):
        share = min(MAX_SIDE / layout.width, MAX_SIDE / layout.height)
        factor *= min(share, math.sqrt(MAX_PIXELS / (layout.width * layout.height)), NEAR_ONE)
        layout = _placed(
            sheet, [(_reduced(height, factor), _reduced(width, factor)) for height, width in sizes]
        )
    return layout


def _is_large(layout: Layout) -> bool:
    return max(layout.width, layout.height) > MAX_SIDE or layout.width * layout.height > MAX_PIXELS


def _reduced(side: int, factor: float) -> int:
    return max(1, round(side * factor))


def _columns(sheet: Sheet, sizes: Sequence[tuple[int, int]]) -> list[int]:
    """Width of each column of pictures."""
    of_cells = zip(*sheet.cells, strict=True)
    columns = []
    for column, numbers in enumerate(of_cells):
        shown = [number for number in numbers if number is not None]
        texts = [sheet.captions[number] for number in shown] if sheet.captions else []
        texts += sheet.column_heads[column : column + 1]
        widest = max((sizes[number][1] for number in shown), default=0)
        columns.append(max([widest, *map(_text_width, texts)]) + GAP)
    return columns


def _rows(sheet: Sheet, sizes: Sequence[tuple[int, int]]) -> list[int]:
    """Height of each row of pictures."""
    below = 2 * GAP + TEXT if sheet.captions else GAP
    return [max([sizes[n][0] for n in row if n is not None] or [0]) + below for row in sheet.cells]


def _placed(sheet: Sheet, sizes: Sequence[tuple[int, int]]) -> Layout:
    columns, heights = _columns(sheet, sizes), _rows(sheet, sizes)
    left = max(map(_text_width, sheet.row_heads), default=0)
    starts = [left + GAP // 2 + sum(columns[:k]) for k in range(len(columns))]

    rows = []
    if sheet.column_heads:
        pairs = zip(starts, columns, sheet.column_heads, strict=True)
        heads = [Text(x, GAP // 2 + TEXT, _fitting(text, width)) for x, width, text in pairs]
        rows.append(Row(2 * GAP + TEXT, (), tuple(heads)))
    for number, (cells, height) in enumerate(zip(sheet.cells, heights, strict=True)):
        pictures, texts = [], []
        if sheet.row_heads:
            texts.append(Text(GAP // 2, GAP // 2 + TEXT, _fitting(sheet.row_heads[number], left)))
        for picture, x, width in zip(cells, starts, columns, strict=True):
            if picture is None:
                continue
            size = sizes[picture]
            pictures.append(Placed(picture, x, GAP // 2, size[1], size[0]))
            if sheet.captions:
                caption = _fitting(sheet.captions[picture], width)
                texts.append(Text(x, size[0] + GAP + TEXT, caption))
        rows.append(Row(height, tuple(pictures), tuple(texts)))
    return Layout(left + GAP + sum(columns), tuple(rows))


def _text_width(text: str) -> int:
    return LETTER * min(len(text), LONGEST) + GAP


def _fitting(text: str, width: int) -> str:
    """The text, or its beginning, so that it is not wider than `width` pixels."""
    letters = max(1, (width - GAP) // LETTER)
    return text if len(text) <= letters else f"{text[: letters - 1]}…"

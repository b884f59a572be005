"""Aligned text tables."""

from __future__ import annotations

from collections.abc import Container, Sequence


def aligned(rows: Sequence[Sequence[str]], right: Container[int] = ()) -> list[str]:
    """The rows as lines whose columns line up, two spaces apart.

    Parameters
    ----------
    rows : sequence of rows of equal length
        The first row has the titles.
    right
        Columns that are aligned to the right; the others are aligned to the left.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(_padded(row, widths, right)).rstrip() for row in rows]


def table(rows: Sequence[Sequence[str]], right: Container[int] = ()) -> str:
    """The rows as one text of aligned lines."""
    return "\n".join(aligned(rows, right))


def _padded(row: Sequence[str], widths: Sequence[int], right: Container[int]) -> list[str]:
    return [
        cell.rjust(width) if column in right else cell.ljust(width)
        for column, (cell, width) in enumerate(zip(row, widths, strict=True))
    ]

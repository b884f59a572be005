"""Tables that a notebook shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

SHOWN = 60
"""Rows of a longer table are left out in its middle."""


def html_table(records: Sequence[Mapping[str, Any]]) -> str:
    """Records of equal keys as a table of HTML."""
    names = list(records[0]) if records else []
    rows = [_row(range(len(names)), names, "th"), *(_row(names, record, "td") for record in records)]
    if len(records) > SHOWN:
        half = SHOWN // 2
        left_out = f"<tr><td colspan={len(names)}>… {len(records) - 2 * half} more …</td></tr>"
        rows = [*rows[: half + 1], left_out, *rows[-half:]]
    return "\n".join(["<table>", *rows, "</table>"])


def _row(keys: Sequence[Any], values: Any, tag: str) -> str:
    return "".join(["<tr>", *(f"<{tag}>{_cell(values[key])}</{tag}>" for key in keys), "</tr>"])


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))

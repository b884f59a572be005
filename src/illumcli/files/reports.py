"""Tables as CSV, reports as JSON, drawings as SVG or PDF: sealed with a hash, and their content hashes."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from illumcli.files.seal import BLANK, sealed_text

_SVG = re.compile(r"<dc:identifier>([^<]*)</dc:identifier>")
_PDF = re.compile(rb"/Subject \(([^()\\]*)\)")


def sealed_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as CSV with at least one row; its last column, `body`, has the hash in the first row."""
    import csv  # imported here, because few renders write a table

    out = io.StringIO()
    lines = csv.writer(out, lineterminator="\n")
    lines.writerow([*columns, "body"])
    for number, row in enumerate(rows):
        missing = [""] * (len(columns) - len(row))
        lines.writerow([*row, *missing, "" if number else BLANK])
    return sealed_text(out.getvalue())


def sealed_json(entries: Sequence[Mapping[str, object]], in_a_list: bool) -> str:
    """Entries, at least one, as JSON; the first has the hash as its `body`. A single one needs no list."""
    first, *others = entries
    body = {**first, "body": BLANK}
    return sealed_text(json.dumps([body, *others] if in_a_list else body, indent=1) + "\n")


def report_contents(path: Path) -> list[str]:
    """The content hashes of a table, report or drawing, row by row or entry by entry.

    Raises
    ------
    KeyError, TypeError, ValueError
        A file of another program.
    """
    match path.suffix.lower():
        case ".csv":
            import csv

            with path.open(newline="", encoding="utf-8") as file:
                return [row["content"] for row in csv.DictReader(file)]
        case ".json":
            document = json.loads(path.read_text(encoding="utf-8"))
            return [entry["content"] for entry in (document if isinstance(document, list) else [document])]
        case ".pdf":
            return [match.decode("ascii") for match in _PDF.findall(path.read_bytes())]
        case _:
            return _SVG.findall(path.read_text(encoding="utf-8"))

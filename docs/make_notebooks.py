"""Runs the notebooks of docs/notebooks anew, and stores what their cells show.

Run it after a change to what they show; a test runs them, too, elsewhere.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = sorted(Path(__file__).with_name("notebooks").glob("*.ipynb"))
SECONDS = 300
"""More than a cell may take on a busy machine."""


def run(path: Path, folder: Path) -> Any:
    """The notebook in `path` with the outputs of its cells, run in `folder` with an empty cache.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        A cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=SECONDS,
        resources={"metadata": {"path": str(folder)}},
        record_timing=False,
    )
    with tempfile.TemporaryDirectory() as cache:
        return client.execute(env={**os.environ, "ILLUM_CACHE": cache})


def text(notebook: Any) -> str:
    """The notebook as a file, without what differs from machine to machine."""
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for number, cell in enumerate(notebook.cells):
        cell.id, cell.metadata = f"cell-{number}", {}
    return nbformat.writes(notebook) + "\n"


if __name__ == "__main__":
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            path.write_text(text(run(path, Path(folder))), encoding="utf-8")

"""What the writer needs of a file format: rows in, a check of the closed file, and one kind of refusal."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray


class WriteError(Exception):
    """An image file cannot be written; the text says why."""


class ImageFile(Protocol):
    """An image file that is being written; `PngFile` and `ExrFile` are such."""

    def write(self, band: NDArray[Any]) -> None:
        """Append rows, (h, W, C) with the values the file will hold."""

    def close(self) -> None:
        """Finish the file."""

    def is_as_written(self) -> bool:
        """Does the closed file hold what it was given?"""
        ...

    def abandon(self) -> None:
        """Close the file as it is; what is in it is worth nothing."""

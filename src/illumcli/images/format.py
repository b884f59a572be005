"""The interface of file formats to the writer: append rows, check the closed file, one type of error."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray

RESERVED = " " * 96
"""Room for a text of the metadata that is known only after the pixels."""


class WriteError(Exception):
    """An image file cannot be written; the text says why."""


class ImageFile(Protocol):
    """An image file that is being written: a `PngFile` or an `ExrFile`."""

    def write(self, band: NDArray[Any]) -> None:
        """Append rows, (h, W, C) with the values of the file."""

    def set_text(self, name: str, text: str) -> None:
        """Set a text of the metadata whose room is `RESERVED`; in ASCII, not longer than that."""

    def close(self) -> None:
        """Finish the file."""

    def is_as_written(self) -> bool:
        """True if the closed file holds what was written."""
        ...

    def abandon(self) -> None:
        """Close the unfinished file."""

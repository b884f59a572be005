"""The interface of file formats to the writer: append rows, check the closed file, one type of error."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray


class WriteError(Exception):
    """An image file cannot be written; the text says why."""


class ImageFile(Protocol):
    """An image file that is being written: a `PngFile` or an `ExrFile`."""

    def write(self, band: NDArray[Any]) -> None:
        """Append rows, (h, W, C) with the values of the file."""

    def close(self) -> None:
        """Finish the file."""

    def is_as_written(self) -> bool:
        """True if the closed file holds what was written."""
        ...

    def abandon(self) -> None:
        """Close the unfinished file."""

"""Where the images of a render go: to files, or into memory for a caller in this process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self

from numpy.typing import NDArray

from illumcli.commands.file_metadata import metadata
from illumcli.files.outputs import is_kept
from illumcli.film.develop import Target
from illumcli.images.contents import image_contents
from illumcli.records import Value
from illumcli.render_space import RenderSpace

if TYPE_CHECKING:
    from illumcli.commands.work import Work


class Clamped(Protocol):
    """A finished image."""

    @property
    def clamped(self) -> int:
        """Values beyond the range of half that were written as its ends."""


class OpenImage(Protocol):
    """An image that takes its bands from top to bottom; finished when its block ends without an error."""

    def write_band(self, y0: int, band: NDArray[Any]) -> None: ...
    def set_text(self, name: str, text: str) -> None: ...
    def close(self) -> Clamped: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class ImageStore(Protocol):
    """Takes the images of a render."""

    @property
    def held(self) -> bool:
        """True if whole images are held in memory and none is written."""

    def due(self, targets: Sequence[Target], force: bool) -> list[Target]:
        """The images that have to be rendered."""

    def open(self, work: Work, target: Target, space: RenderSpace, texts: Mapping[str, str]) -> OpenImage:
        """A new image; `texts` are added to its metadata."""


class ImageFiles(Value):
    """Writes files; those that exist with the same content are kept."""

    held: bool = False

    def due(self, targets: Sequence[Target], force: bool) -> list[Target]:
        """The files to write.

        Raises
        ------
        OutputError
            A different file exists and `force` is not given.
        """
        return [each for each in targets if not is_kept(each.path, [each.content], image_contents, force)]

    def open(self, work: Work, target: Target, space: RenderSpace, texts: Mapping[str, str]) -> OpenImage:
        """A file that gets its name only when all of it is written."""
        from illumcli.images.writer import ImageWriter

        return ImageWriter(
            target.path,
            target.view.width,
            target.height,
            work.development.channels(target),
            {**metadata(work, target, space), **texts},
            srgb=target.layers[0].kind == "light",
        )

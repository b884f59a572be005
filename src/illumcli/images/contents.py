"""The content hash in the metadata of an image file; a PNG is read without loading OpenImageIO."""

from __future__ import annotations

from pathlib import Path

from illumcli.images import png


def image_contents(path: Path) -> list[str]:
    """The content hash in the metadata of a PNG or EXR.

    Raises
    ------
    InputError, KeyError, ValueError
        A file that illum did not write.
    """
    if path.suffix.lower() == ".png":
        return [png.read_texts(path)["illum:content"]]
    from illumcli.images.reader import read_metadata

    return [str(read_metadata(path)["illum:content"])]

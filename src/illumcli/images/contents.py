"""The content that an image file of ours names, without loading OpenImageIO for a PNG."""

from __future__ import annotations

from pathlib import Path

from illumcli.images import png


def image_contents(path: Path) -> list[str]:
    """The hash of what a PNG or EXR was made from, as its metadata say it.

    Raises
    ------
    InputError, KeyError, ValueError
        A file of others.
    """
    if path.suffix.lower() == ".png":
        return [png.read_texts(path)["illum:content"]]
    from illumcli.images.reader import read_metadata

    return [str(read_metadata(path)["illum:content"])]

"""The metadata that illum writes into image files; those of a PNG are read without loading OpenImageIO."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from illumcli.images import png


def image_contents(path: Path) -> list[str]:
    """The content hash in the metadata of a PNG or EXR.

    Raises
    ------
    InputError, KeyError, ValueError
        A file that illum did not write.
    """
    return [str(image_texts(path)["illum:content"])]


def image_texts(path: Path) -> Mapping[str, Any]:
    """The metadata of a PNG or EXR by name.

    Raises
    ------
    InputError, ValueError
        No such image.
    """
    if path.suffix.lower() == ".png":
        return png.read_texts(path)
    from illumcli.images.reader import read_metadata

    return read_metadata(path)

"""Files that contain their own hash, so that later damage and edits are detected.

The metadata of every image and baked mesh contain `illum-body:` and 32 hexadecimal digits, the BLAKE2b-128 of
the file with these digits set to 0. A PNG, whose chunks have checksums, has them in its last chunk before the
end, as the hash of everything before. A table has them in the column `body` of its first row, a report in the
key `body` of its first entry, an SVG or PDF among its keywords. The hash detects accidents and edits, not
forgery.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

_MARK, _DIGITS = b"illum-body:", 32
BLANK = (_MARK + b"0" * _DIGITS).decode()
"""The placeholder in the metadata until the file is sealed."""
_SEAL = re.compile(re.escape(_MARK) + rb"([0-9a-f]{%d})" % _DIGITS)
_PIECE = 1 << 20
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


def seal(path: Path) -> None:
    """Replace `BLANK` in the file by the file's hash.

    Raises
    ------
    OSError
    """
    with path.open("r+b") as file:
        mark = _body(file)
        if mark is None:
            raise ValueError(f"{path}: has no place for its hash")
        place, _, body = mark
        file.seek(place)
        file.write(body)


def seal_archive(path: Path) -> None:
    """Seal a ZIP archive without a comment; its hash becomes the comment.

    Raises
    ------
    OSError
    """
    with path.open("r+b") as file:
        # The archive ends in the length of its comment.
        file.seek(-2, os.SEEK_END)
        file.write(struct.pack("<H", len(BLANK)) + BLANK.encode())
    seal(path)


def is_sealed(path: Path) -> bool:
    """True if the file is unchanged since it was sealed.

    Raises
    ------
    OSError
    """
    with path.open("rb") as file:
        if path.suffix.lower() != ".png":
            mark = _body(file)
            return mark is not None and mark[1] == mark[2]
        digest = png_digest()
        left = path.stat().st_size - len(png_end(digest))
        while left > 0 and (piece := file.read(min(left, _PIECE))):
            digest.update(piece)
            left -= len(piece)
        return file.read() == png_end(digest)


def sealed_text(text: str) -> str:
    """`text`, to be written as UTF-8, with its hash in place of `BLANK`."""
    return sealed(text.encode()).decode()


def sealed(data: bytes) -> bytes:
    """The bytes of a file, with their hash in place of `BLANK`."""
    digest = hashlib.blake2b(data, digest_size=_DIGITS // 2)
    return data.replace(BLANK.encode(), _MARK + digest.hexdigest().encode(), 1)


def sealed_png(data: bytes) -> bytes:
    """A complete PNG with its hash."""
    data = data.removesuffix(_PNG_END)
    digest = png_digest()
    digest.update(data)
    return data + png_end(digest)


def png_digest() -> hashlib.blake2b:
    """The hash object for the bytes of a PNG up to its end."""
    return hashlib.blake2b(digest_size=_DIGITS // 2)


def png_end(digest: hashlib.blake2b) -> bytes:
    """The last two chunks of a PNG, with the hash of everything before them."""
    chunk = b"tEXtillum:body\0" + _MARK + digest.hexdigest().encode()
    return struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk)) + _PNG_END


def _body(file: BinaryIO) -> tuple[int, bytes, bytes] | None:
    """The offset of the digits, the digits, and the hash of the file with the digits set to 0; None if the
    file has no digits."""
    digest = hashlib.blake2b(digest_size=_DIGITS // 2)
    mark: tuple[int, bytes] | None = None
    at, rest = 0, b""
    while piece := file.read(_PIECE):
        data = rest + piece
        seal = _SEAL.search(data) if mark is None else None
        if seal is not None:
            mark = at + seal.start(1), seal[1]
            data = data[: seal.start(1)] + b"0" * _DIGITS + data[seal.end(1) :]
        # the mark may continue in the next piece
        done = len(data) if mark else max(0, len(data) - len(BLANK) + 1)
        digest.update(data[:done])
        at, rest = at + done, data[done:]
    return None if mark is None else (*mark, digest.hexdigest().encode())

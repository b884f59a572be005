"""Tensor files: named arrays in one file, the container of the RGL material database.

    "tensor_file", 0     12 bytes
    version              2 bytes, 1 and 0
    number of fields     32 bits
    fields               each: length of the name (16 bits), the name, dimensions (16 bits), type (8 bits),
                         offset from the beginning of the file (64 bits), the shape (64 bits each)
    arrays               at their offsets, the last axis contiguous

All numbers are little-endian and unsigned.

References
----------
Dupuy, J., Jakob, W. (2018). brdf-loader, the authors' own reader. https://github.com/rgl-epfl/brdf-loader
"""

from __future__ import annotations

import math
import os
import struct
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError

MAGIC = b"tensor_file\0"
VERSION = (1, 0)
TYPES = ("", "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8")
"""numpy's name of each type, by its number in the file; 0 is none."""
MOST_FIELDS = 256
_WHOLE = "fetch it again, it is not whole"


class Field(NamedTuple):
    """Where an array is in its file."""

    dtype: str
    """One of TYPES."""
    shape: tuple[int, ...]
    offset: int
    """Of its first byte."""


def fields(path: str) -> dict[str, Field]:
    """The arrays of a file by name; all lie within the file.

    Raises
    ------
    InputError
        The file cannot be opened, is no tensor file, or ends too early.
    """
    try:
        with open(path, "rb") as file:
            return _fields(path, file, os.fstat(file.fileno()).st_size)
    except OSError as error:
        raise InputError(f"{path}: cannot read the measurement: {error.strerror}") from None


def _fields(path: str, file: BinaryIO, size: int) -> dict[str, Field]:
    def numbers(form: str) -> tuple[int, ...]:
        return struct.unpack("<" + form, taken(struct.calcsize("<" + form)))

    def taken(count: int) -> bytes:
        content = file.read(count)
        if len(content) < count:
            raise InputError(f"{path}: ends within its header; {_WHOLE}")
        return content

    if file.read(len(MAGIC)) != MAGIC:
        raise InputError(f"{path}: does not begin with tensor_file; name a .bsdf file of the RGL database")
    if (version := numbers("BB")) != VERSION:
        raise InputError(
            f"{path}: is a tensor file of version {version[0]}.{version[1]}, and 1.0 is read; "
            "fetch it from the RGL database again"
        )
    (count,) = numbers("I")
    if count > MOST_FIELDS:
        raise InputError(f"{path}: claims to have {count} fields; {_WHOLE}")

    found = {}
    for _ in range(count):
        (length,) = numbers("H")
        name = taken(length).decode("utf-8", "replace")
        dimensions, kind, offset = numbers("HBQ")
        shape = numbers(f"{dimensions}Q")
        if not 0 < kind < len(TYPES):
            raise InputError(f"{path}: field {name!r} has the unknown type {kind}; {_WHOLE}")
        if offset + math.prod(shape) * np.dtype(TYPES[kind]).itemsize > size:
            raise InputError(f"{path}: field {name!r} ends beyond the end of the file; {_WHOLE}")
        found[name] = Field(TYPES[kind], shape, offset)
    return found


def load(path: str, field: Field) -> NDArray[np.generic]:
    """An array of a file.

    Raises
    ------
    InputError
        The file cannot be read any more.
    """
    count = math.prod(field.shape)
    dtype = np.dtype(field.dtype).newbyteorder("<")
    try:
        with open(path, "rb") as file:
            file.seek(field.offset)
            content = file.read(count * dtype.itemsize)
    except OSError as error:
        raise InputError(f"{path}: cannot read the measurement: {error.strerror}") from None
    if len(content) < count * dtype.itemsize:
        raise InputError(f"{path}: became shorter while it was read; {_WHOLE}")
    return np.frombuffer(content, dtype).reshape(field.shape)

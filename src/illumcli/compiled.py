"""Loops in C, each a shared library beside the module that calls it.

An installation compiles them if there is a C compiler (`hatch_build.py`). Without them, or with
ILLUM_PACKETS=0, others serve, whose results have the same bits.
"""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

SWITCH = "ILLUM_PACKETS"
"""Environment variable; 0 turns the compiled loops off."""


def are_switched_off() -> bool:
    """True if the environment turns the compiled loops off."""
    return os.environ.get(SWITCH) == "0"


class CVectors(ctypes.Structure):
    """(N, 3) numbers of 32 bits, of any strides, as the loops take them; the array must outlive it."""

    _fields_ = (("data", ctypes.c_void_p), ("stride", ctypes.c_int64), ("component", ctypes.c_int64))

    @classmethod
    def of(cls, array: NDArray[Any]) -> CVectors:
        """Those of an array."""
        assert array.itemsize == 4
        return cls(array.ctypes.data, *array.strides)


def compiled_library(module: str, name: str, interface: int) -> ctypes.CDLL | None:
    """The library `name` beside the file of a module; None if it is missing or has another interface."""
    path = Path(module).with_name(f"_{name}.dll" if os.name == "nt" else f"_{name}.so")
    try:
        library = ctypes.CDLL(str(path))
        return library if library.illum_interface() == interface else None
    except (OSError, AttributeError):
        return None

"""Loops in C, each a shared library beside the module that calls it.

An installation compiles them if there is a C compiler (`hatch_build.py`). Without them, or with
ILLUM_PACKETS=0, others serve, whose results have the same bits.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numpy.typing import NDArray

Loop = TypeVar("Loop")

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


def compiled_loop(kind: Callable[[ctypes.CDLL], Loop], module: str, name: str, interface: int) -> Loop | None:
    """What `kind` makes of a library, once a process; None without the library, or if loops are switched off.

    Parameters
    ----------
    module, name, interface
        As for `compiled_library`.
    """
    return None if are_switched_off() else cast("Loop | None", _loaded(kind, module, name, interface))


@cache
def _loaded(kind: Callable[[ctypes.CDLL], object], module: str, name: str, interface: int) -> object:
    library = compiled_library(module, name, interface)
    return None if library is None else kind(library)


def declare(library: ctypes.CDLL, **arguments: list[Any]) -> None:
    """Declare the types of the arguments of functions `illum_NAME` that return nothing."""
    for name, types in arguments.items():
        function = getattr(library, f"illum_{name}")
        function.argtypes, function.restype = types, None

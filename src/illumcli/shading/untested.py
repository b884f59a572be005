"""Lobes that no test of this package covers: formulas of a scene, and classes of somebody else.

Each of their values is checked. One that is negative or not finite becomes 0, and is counted.
"""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from illumcli.arrays import Vectors
from illumcli.errors import IllumError, InputError
from illumcli.schema.messages import suggestion


def is_tested(lobe: Callable[..., Any]) -> bool:
    """True for a method of one of the package's own models."""
    return type(getattr(lobe, "__self__", None)).__module__.startswith("illumcli.")


def unknown_term(lobe: Callable[..., Any], name: str, known: tuple[str, ...]) -> InputError:
    """The error about a lobe that asks for a term that does not exist."""
    return InputError(f"{_place(lobe)}: no term '{name}'; {suggestion(name, known)}")


def mended_values(
    lobe: Callable[..., Any], terms: Mapping[str, Any], like: Vectors, mended: Counter[str], name: str
) -> Vectors:
    """(N, 3) the values of a lobe in the precision of `like`; 0 for those that are negative or not finite.

    Parameters
    ----------
    like : (N, 3)
    mended : Counter
        The number of such values is added, by the lobe's name.

    Raises
    ------
    InputError
        The lobe fails, or returns something else.
    """
    try:
        with np.errstate(all="ignore"):
            values = np.asarray(lobe(**terms))
    except (IllumError, MemoryError):
        raise
    except Exception as error:
        raise InputError(f"{_failing_line(lobe, error)}: {type(error).__name__}: {error}") from error
    if values.shape != like.shape or values.dtype.kind != "f":
        fact = f"returns {values.dtype} of shape {values.shape}"
        raise InputError(f"{_place(lobe)}: {fact}; return one colour per point, of shape {like.shape}")
    with np.errstate(over="ignore"):
        values = values.astype(like.dtype, "F")
    wrong = ~((values >= 0) & (values < np.inf))
    if count := int(np.count_nonzero(wrong)):
        mended[name] += count
        values[wrong] = 0
    return values


def _place(lobe: Callable[..., Any]) -> str:
    """File and line where a lobe is defined."""
    code = getattr(lobe, "__code__", None)
    return f"{code.co_filename}:{code.co_firstlineno}" if code else getattr(lobe, "__name__", repr(lobe))


def _failing_line(lobe: Callable[..., Any], error: Exception) -> str:
    """The innermost line of the lobe's own folder that led to an error."""
    code = getattr(lobe, "__code__", None)
    folder = Path(code.co_filename).parent if code else Path()
    own = [
        frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).parent == folder
    ]
    return f"{own[-1].filename}:{own[-1].lineno}" if own else _place(lobe)

"""What the pixels of a process depend on: versions and the instruction class of the processor."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from illumcli import __version__
from illumcli.errors import InputError
from illumcli.versions import versions

CLASSES = {"AVX512_SKX": "AVX-512", "AVX2": "AVX2", "AVX": "AVX", "SSE42": "SSE4.2", "ASIMD": "NEON"}
"""Feature of a processor -> the class of instructions that Embree and numpy choose by it, widest first."""
ADVICE = (
    "install the same versions, and use processors of one class; or give --mixed-workers, and the last digits"
    " of pixels depend on who renders them"
)
WITHOUT_EFFECT = ("python", "pydantic")
"""Versions that no pixel depends on."""


def facts() -> dict[str, str]:
    """What the pixels of this process depend on, by name."""
    return {
        "illum": __version__,
        **{name: version for name, version in versions().items() if name not in WITHOUT_EFFECT},
        "instructions": instruction_class(),
    }


def instruction_class() -> str:
    """The widest class of instructions of this processor: Embree's kernels and numpy's differ by it."""
    features: Mapping[str, bool] = import_module("numpy._core._multiarray_umath").__cpu_features__
    return next((name for feature, name in CLASSES.items() if features.get(feature)), "scalar")


def refuse_differences(own: Mapping[str, str], others: Mapping[str, Mapping[str, str]]) -> None:
    """Raise InputError if a worker differs from this process.

    Parameters
    ----------
    others : mapping
        Address of a worker -> its facts.
    """
    problems = [
        f"worker {address}: has {name} {its.get(name, 'of no known version')}, this process {value}"
        for address, its in others.items()
        for name, value in own.items()
        if its.get(name) != value
    ]
    if problems:
        raise InputError([*problems, ADVICE])

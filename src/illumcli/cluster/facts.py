"""What the pixels of a process depend on: versions and the instruction class of the processor."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from illumcli import __version__
from illumcli.schema.sources import FAMILIES, entry_points
from illumcli.versions import versions

CLASSES = {"AVX512_SKX": "AVX-512", "AVX2": "AVX2", "AVX": "AVX", "SSE42": "SSE4.2", "ASIMD": "NEON"}
"""Feature of a processor -> the class of instructions that Embree and numpy choose by it, widest first."""
ADVICE = (
    "install the client's versions on all workers, and use processors of its class; or give --mixed-workers,"
    " and the last digits of pixels depend on who renders them"
)
WITHOUT_EFFECT = ("python", "pydantic")
"""Versions that no pixel depends on."""


def facts() -> dict[str, str]:
    """What the pixels of this process depend on, by name."""
    return {
        "illum": __version__,
        **{name: version for name, version in versions().items() if name not in WITHOUT_EFFECT},
        "instructions": instruction_class(),
        **{
            f"package {name}": version
            for family in FAMILIES
            for name, _, version in (point.package.partition(" ") for point in entry_points(family).values())
        },
    }


def instruction_class() -> str:
    """The widest class of instructions of this processor: Embree's kernels and numpy's differ by it."""
    features: Mapping[str, bool] = import_module("numpy._core._multiarray_umath").__cpu_features__
    return next((name for feature, name in CLASSES.items() if features.get(feature)), "scalar")


def differences(own: Mapping[str, str], wanted: Mapping[str, str]) -> tuple[str, ...]:
    """How the facts of a worker differ from those of the client."""
    return tuple(
        f"has {name} {own.get(name, 'of no known version')}, not {value}"
        for name, value in wanted.items()
        if own.get(name) != value
    )

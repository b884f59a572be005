"""Compiles the loops in C if there is a C compiler; without one, the installation goes on.

A wheel with the libraries is tagged py3-none-PLATFORM, as it does not depend on a version of Python. A wheel
without them is tagged py3-none-any: embreex traces single rays there, numpy fits polynomials, with the same
bits. An editable installation gets the libraries into `src`.

    python hatch_build.py                   compiles them into src, for a checkout on the path
    ILLUM_PACKETS=0 python -m build         makes a wheel without them, for every platform
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import sysconfig
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parent
PACKAGE = ROOT / "src" / "illumcli"
SOURCES = tuple(
    PACKAGE / name
    for name in ("rays/packets.c", "rays/samples.c", "visibility/regression.c", "baking/cells.c")
)
REQUIRED = "ILLUM_REQUIRE_PACKETS"
"""Environment variable; with 1, an installation without the libraries fails, and so do their tests."""


def library(source: Path) -> Path:
    """The shared library of a source, beside it."""
    return source.with_name(f"_{source.stem}.dll" if os.name == "nt" else f"_{source.stem}.so")


def compiled() -> bool:
    """Compile the sources unless ILLUM_PACKETS is 0; whether all libraries are made from them as they are."""
    if os.environ.get("ILLUM_PACKETS") == "0":
        print("the loops in C are not compiled, slower ones serve: ILLUM_PACKETS=0", file=sys.stderr)
        return False
    try:
        for source in SOURCES:
            _compile(source)
    except Exception as error:
        for source in SOURCES:
            library(source).unlink(missing_ok=True)
        reason = getattr(error, "stderr", None) or error
        print(f"the loops in C are not compiled, slower ones serve: {reason}", file=sys.stderr)
        if os.environ.get(REQUIRED) == "1":
            raise
        return False
    return True


def _compile(source: Path) -> None:
    """Make the library of a source, whole or not at all."""
    place = library(source)
    made = place.with_name(f"{place.stem}-{os.getpid()}{place.suffix}")
    try:
        (_with_msvc if os.name == "nt" else _with_cc)(source, made)
        os.replace(made, place)
    finally:
        made.unlink(missing_ok=True)


def _with_cc(source: Path, made: Path) -> None:
    """By the compiler that CC names, or the system's, with ARCHFLAGS as builds for macOS set them."""
    compiler = shlex.split(os.environ.get("CC") or "cc")
    flags = ["-O3", "-std=c99", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden"]
    more = shlex.split(os.environ.get("ARCHFLAGS", ""))
    command = [*compiler, *flags, *more, "-o", str(made), str(source), "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)


def _with_msvc(source: Path, made: Path) -> None:
    """By Microsoft's compiler, which setuptools can find."""
    import_module("setuptools")  # provides distutils
    from distutils.ccompiler import new_compiler

    compiler = new_compiler(compiler="msvc")
    with TemporaryDirectory() as folder:
        objects = compiler.compile([str(source)], output_dir=folder, extra_preargs=["/O2", "/fp:precise"])
        compiler.link_shared_object(objects, str(made))


def platform_tag() -> str:
    """The platform as wheels spell it; on macOS the one that the interpreter was told to build for."""
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


if __name__ == "__main__":
    sys.exit(0 if compiled() else 1)

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ModuleNotFoundError:
    pass
else:

    class PacketsHook(BuildHookInterface):  # type: ignore[type-arg]
        """Adds the libraries to the wheel, and says so in its tag."""

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            if compiled():
                build_data["pure_python"] = False
                build_data["tag"] = f"py3-none-{platform_tag()}"
                if version != "editable":
                    for path in map(library, SOURCES):
                        build_data["force_include"][str(path)] = str(path.relative_to(ROOT / "src"))

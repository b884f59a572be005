"""Compiles `src/illumcli/rays/packets.c` if there is a C compiler; without one, the installation goes on.

A wheel with the library is tagged py3-none-PLATFORM, as it does not depend on a version of Python. A wheel
without it is tagged py3-none-any and traces single rays by embreex, with the same bits. An editable
installation gets the library into `src`.

    python hatch_build.py                   compiles it into src, for a checkout on the path
    ILLUM_PACKETS=0 python -m build         makes a wheel without it, for every platform
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
SOURCE = ROOT / "src" / "illumcli" / "rays" / "packets.c"
LIBRARY = SOURCE.with_name("_packets.dll" if os.name == "nt" else "_packets.so")
REQUIRED = "ILLUM_REQUIRE_PACKETS"
"""Environment variable; with 1, an installation without the library fails, and so do its tests."""


def compiled() -> bool:
    """Compile the source unless ILLUM_PACKETS is 0; whether the library is made from the source as it is."""
    if os.environ.get("ILLUM_PACKETS") == "0":
        print("packets.c is not compiled, embreex will trace single rays: ILLUM_PACKETS=0", file=sys.stderr)
        return False
    made = LIBRARY.with_name(f"{LIBRARY.stem}-{os.getpid()}{LIBRARY.suffix}")
    try:
        (_with_msvc if os.name == "nt" else _with_cc)(made)
        os.replace(made, LIBRARY)
    except Exception as error:
        made.unlink(missing_ok=True)
        LIBRARY.unlink(missing_ok=True)
        reason = getattr(error, "stderr", None) or error
        print(f"packets.c is not compiled, embreex will trace single rays: {reason}", file=sys.stderr)
        if os.environ.get(REQUIRED) == "1":
            raise
        return False
    return True


def _with_cc(made: Path) -> None:
    """By the compiler that CC names, or the system's, with ARCHFLAGS as builds for macOS set them."""
    compiler = shlex.split(os.environ.get("CC") or "cc")
    flags = ["-O3", "-std=c99", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden"]
    more = shlex.split(os.environ.get("ARCHFLAGS", ""))
    command = [*compiler, *flags, *more, "-o", str(made), str(SOURCE)]
    subprocess.run(command, check=True, capture_output=True, text=True)


def _with_msvc(made: Path) -> None:
    """By Microsoft's compiler, which setuptools can find."""
    import_module("setuptools")  # provides distutils
    from distutils.ccompiler import new_compiler

    compiler = new_compiler(compiler="msvc")
    with TemporaryDirectory() as folder:
        objects = compiler.compile([str(SOURCE)], output_dir=folder, extra_preargs=["/O2", "/fp:precise"])
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
        """Adds the library to the wheel, and says so in its tag."""

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            if compiled():
                build_data["pure_python"] = False
                build_data["tag"] = f"py3-none-{platform_tag()}"
                if version != "editable":
                    build_data["force_include"][str(LIBRARY)] = f"illumcli/rays/{LIBRARY.name}"

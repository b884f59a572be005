"""Members of open families that are not in this package: loads, checks and identifies their classes.

A file of a folder becomes a module whose name has the hash of all Python files there: after a change it is
another module, in the same process too, and everything that is cached by its identity is computed anew.
"""

from __future__ import annotations

import hashlib
import sys
import traceback
from collections.abc import Iterable
from importlib import import_module, invalidate_caches
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any, get_args

from illumcli.errors import InputError
from illumcli.schema.description import Description
from illumcli.schema.sources import EntryPoint, source_files

PREFIX = "illum_models_"
DIGEST = "__illum_digest__"
"""Name of the hash of the sources, in the top module of a package that is not ours."""
_LOADING = RLock()


class BrokenMember(InputError):
    """A module that cannot be imported, or that does not define one member."""


def loaded(package: str, tag: str, source: Path | EntryPoint) -> type[Any]:
    """The class of a member.

    Raises
    ------
    BrokenMember
        With file and line.
    """
    with _LOADING:
        module = _from_file(source) if isinstance(source, Path) else _from_package(source)
    place = f"{source}: {module.__file__}" if isinstance(source, EntryPoint) else str(source)
    if module.__name__.rpartition(".")[2] != tag:
        raise BrokenMember(f"{place}: the module must have the name of its tag, {tag}")
    cls = class_in(module, place)
    if problems := list(_unfit(package, tag, cls)):
        raise BrokenMember(f"{place}:{_line(cls)}: {problem}" for problem in problems)
    return cls


def class_in(module: ModuleType, place: str) -> type[Any]:
    """The one class that a module defines.

    Raises
    ------
    BrokenMember
        There is none, or there are several.
    """
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__ and issubclass(value, Description)
    ]
    if len(classes) != 1:
        names = ", ".join(cls.__name__ for cls in classes) or "none"
        fact = f"must define one class that a scene can name, defines {len(classes)}: {names}"
        raise BrokenMember(f"{place}: {fact}; begin the names of helpers' files with _")
    return classes[0]


def source_digest(cls: type[Any]) -> str | None:
    """Hash of the sources that a class of another package or folder is made of; None for one of ours."""
    top = sys.modules.get(cls.__module__.partition(".")[0])
    digest: str | None = getattr(top, DIGEST, None)
    return digest


def _from_file(path: Path) -> ModuleType:
    """The module of a file, which may import others beside it: `from ._helpers import fuzz`."""
    folder = path.parent
    digest = _digest(source_files(folder))
    name = PREFIX + hashlib.blake2b(f"{folder}{digest}".encode(), digest_size=8).hexdigest()
    if name not in sys.modules:
        top = ModuleType(name)
        top.__path__ = [str(folder)]
        setattr(top, DIGEST, digest)
        sys.modules[name] = top
    full = f"{name}.{path.stem}"
    if full in sys.modules:
        return sys.modules[full]

    # Run the source itself: compiled files are compared by seconds, and none is left in the folder.
    spec = spec_from_file_location(full, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[full] = module
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    invalidate_caches()
    try:
        exec(compile(path.read_bytes(), path, "exec", dont_inherit=True), vars(module))
    except BaseException as error:
        del sys.modules[full]
        if not isinstance(error, Exception | SystemExit):
            raise
        raise BrokenMember(_fact(error, path, str(path))) from error
    finally:
        sys.dont_write_bytecode = before
    return module


def _from_package(point: EntryPoint) -> ModuleType:
    """The module of an entry point."""
    try:
        module = import_module(point.module)
    except (Exception, SystemExit) as error:
        raise BrokenMember(_fact(error, None, str(point))) from error
    top = sys.modules[point.module.partition(".")[0]]
    if not hasattr(top, DIGEST):
        folders = getattr(top, "__path__", None)
        sources = (
            [path for folder in folders for path in Path(folder).rglob("*.py")]
            if folders
            else [Path(str(top.__file__))]
        )
        setattr(top, DIGEST, _digest(sources))
    return module


def _digest(paths: Iterable[Path]) -> str:
    """Hash of the contents of files, wherever they are."""
    texts = sorted(
        hashlib.blake2b(path.read_bytes(), digest_size=16).digest() for path in paths if path.is_file()
    )
    return hashlib.blake2b(b"".join(texts), digest_size=16).hexdigest()


def _fact(error: Exception | SystemExit, path: Path | None, place: str) -> str:
    """Where a module fails and why."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    inside = [frame for frame in frames if path is None or Path(frame.filename).parent == path.parent]
    where = f"{inside[-1].filename}:{inside[-1].lineno}" if inside and path else place
    return ": ".join([where, type(error).__name__, *str(error).splitlines()[:1]])


def _unfit(package: str, tag: str, cls: type[Any]) -> Iterable[str]:
    """Why a class cannot be a member of a family."""
    base = class_in(import_module(f"{package}._base"), package)
    if not issubclass(cls, base):
        yield f"class {cls.__name__} must be a subclass of {base.__module__}.{base.__name__}"
        return
    try:
        cls.model_rebuild()
    except Exception as error:
        yield f"class {cls.__name__}: {str(error).splitlines()[0]}"
        return
    if not any(get_args(field.annotation) == (tag,) for field in cls.model_fields.values()):
        key = package.rpartition(".")[2].removesuffix("s")
        yield f'class {cls.__name__} needs the field {key}: Literal["{tag}"] = "{tag}", as its file\'s name'
    yield from cls.faults_of_class() if hasattr(cls, "faults_of_class") else ()


def _line(cls: type[Any]) -> int:
    """The line where a class begins; 1 if its source is not known."""
    import inspect

    try:
        return inspect.getsourcelines(cls)[1]
    except (OSError, TypeError):
        return 1

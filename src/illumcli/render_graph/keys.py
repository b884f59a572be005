"""What a buffer depends on, as one hash: its recipe, the values bound in it, and the keys of what it needs.

Nothing is listed by hand. A recipe binds only the parts of the scene that its function reads, so the wiring
itself says that a colour changes no hit, and that a lamp's place changes that lamp's shadow alone.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy

from illumcli.graph import Node

MAKERS = (
    "geometry",
    "mesh_files",
    "rays",
    "visibility",
    "lights",
    "shading",
    "render_graph",
    "models",
    "arrays.py",
    "render_space.py",
)
"""Sources that decide about the content of what is kept between runs."""


class Keys:
    """The key of every buffer in a book, 32 hexadecimal digits, found when asked for."""

    def __init__(self, book: Mapping[str, Node], view: Any, salt: str) -> None:
        self._book = book
        self._salt = salt
        self._known = {"tile": "tile", "view": repr(view)}

    def __call__(self, name: str) -> str:
        """The key of the buffer `name`, of all tiles together."""
        if name not in self._known:
            recipe = self._book[name]
            needs = [(parameter, self(need)) for parameter, need in recipe.needs.items()]
            self._known[name] = digest((self._salt, identity(recipe.function), needs))
        return self._known[name]


def digest(value: object) -> str:
    """32 hexadecimal digits that stand for the `repr` of a value."""
    return hashlib.blake2b(repr(value).encode(), digest_size=16).hexdigest()


def identity(function: Callable[..., Any]) -> str:
    """A function by name with the values bound in it; the same text in every process."""
    if isinstance(function, partial):
        return repr((identity(function.func), function.args, sorted(function.keywords.items())))
    return f"{function.__module__}.{function.__qualname__}"


def _installed(library: str) -> list[str]:
    """The version of a library by the name of its metadata folder: nothing is imported for it, and
    `importlib.metadata` takes longer than all the hashing."""
    spec = find_spec(library)
    places = spec.submodule_search_locations if spec else None
    return sorted(found.name for place in places or () for found in Path(place).parent.glob(f"{library}-*"))


@cache
def code() -> str:
    """Hash of the sources that make what is kept, and of the numpy, ray core and processor they run on.

    Processors differ in the instructions they have, and with them the last bits of their results.
    """
    features: dict[str, bool] = import_module("numpy._core._multiarray_umath").__cpu_features__
    digest = hashlib.blake2b(digest_size=16)
    root = os.path.dirname(os.path.dirname(__file__))
    for name in MAKERS:
        place = os.path.join(root, name)
        found = [os.path.join(folder, each) for folder, _, files in os.walk(place) for each in files]
        for path in sorted(found or [place]):
            if path.endswith(".py"):
                with open(path, "rb", buffering=0) as source:
                    digest.update(f"{path[len(root) :]}\0".encode() + source.read())
    libraries = [numpy.__version__, *_installed("embreex")]
    digest.update(repr((libraries, sorted(name for name, has in features.items() if has))).encode())
    return digest.hexdigest()

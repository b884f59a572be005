"""Cache keys: a buffer's key is the hash of its node, the values bound in it, and the keys of its inputs.

No dependency is listed by hand. A node binds only the parts of the scene that its function reads, so a change
of a colour changes the key of no hit, and a change of a light's position only that of the light's own shadow.
Nodes are identified by name, not by the module of their function: a function that moves keeps its keys.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy

from illumcli import __version__
from illumcli.cache.fingerprint import digest, fingerprint
from illumcli.film.view import View
from illumcli.graph import Node

SOURCES = (
    "arrays.py",
    "cache/codec.py",
    "color.py",
    "film",
    "formula.py",
    "geometry",
    "keyframes.py",
    "lights",
    "measured_files",
    "mesh_files",
    "models",
    "rays",
    "render_graph",
    "render_space.py",
    "shading",
    "visibility",
)
"""Source files and folders that determine the values of cached buffers. A test follows the imports of all
nodes' functions and fails if one leads elsewhere."""


class Keys:
    """The key of every buffer of a graph, 32 hexadecimal digits, computed when first needed."""

    def __init__(self, graph: Mapping[str, Node], view: View | None, salt: str) -> None:
        self._graph = graph
        self._salt = salt
        self._known = {"tile": "tile", "surrounding_pixels": "", "read_pixels": "", "view": fingerprint(view)}

    def __call__(self, name: str) -> str:
        """The key of the buffer `name`, the same for all tiles."""
        if name not in self._known:
            node = self._graph[name]
            inputs = [(parameter, self(buffer)) for parameter, buffer in node.inputs.items()]
            self._known[name] = digest((self._salt, node.name, function_digest(node.function), inputs))
        return self._known[name]


_OF_FUNCTIONS: WeakKeyDictionary[Callable[..., Any], str] = WeakKeyDictionary()
"""Digests of functions that live. A run forms keys of a graph several times, for files, memory and store."""


def function_digest(function: Callable[..., Any]) -> str:
    """Hash of a function and of the values that are bound in it, which never change."""
    known = _OF_FUNCTIONS.get(function)
    if known is None:
        known = _OF_FUNCTIONS[function] = digest(function)
    return known


def content_key(nodes: Mapping[str, Node], view: View, buffers: Iterable[str]) -> str:
    """Hash of everything that some buffers of a view depend on, and of this version."""
    keys = Keys(nodes, view, __version__)
    return digest([keys(name) for name in buffers])


def _installed(library: str) -> list[str]:
    """The version of a library, from the name of its metadata folder. Nothing is imported;
    `importlib.metadata` takes longer than all the hashing."""
    spec = find_spec(library)
    places = spec.submodule_search_locations if spec else None
    return sorted(path.name for place in places or () for path in Path(place).parent.glob(f"{library}-*"))


def source_files(root: str) -> list[str]:
    """The paths of all source files that `SOURCES` names below a package's folder."""
    paths = []
    for name in SOURCES:
        place = os.path.join(root, name)
        files = [os.path.join(folder, each) for folder, _, names in os.walk(place) for each in names]
        paths += [path for path in sorted(files or [place]) if path.endswith((".py", ".c"))]
    return paths


@cache
def code() -> str:
    """Hash of the sources that compute cached buffers, and of the numpy, embreex and processor they run on.

    The sources count by their text, not by their paths. Processors differ in their instruction sets, and thus
    in the last bits of results.
    """
    features: dict[str, bool] = import_module("numpy._core._multiarray_umath").__cpu_features__
    texts = []
    for path in source_files(os.path.dirname(os.path.dirname(__file__))):
        with open(path, "rb", buffering=0) as source:
            texts.append(hashlib.blake2b(source.read(), digest_size=16).digest())
    libraries = [numpy.__version__, *_installed("embreex")]
    return digest((sorted(texts), libraries, sorted(name for name, has in features.items() if has)))

"""Keys of buffers: they have names instead of modules, and every source that affects buffers is hashed."""

from __future__ import annotations

import ast
import inspect
import os
from functools import partial
from pathlib import Path

import pytest

import illumcli
from illumcli.graph import Node, short_name
from illumcli.render_graph import keys as module
from illumcli.render_graph.build import build
from illumcli.render_graph.keys import SOURCES, Keys, source_files
from illumcli.scene.load import load

PACKAGE = Path(illumcli.__file__).parent
SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
DECIDE_NOTHING = {
    "cache/": "finds and keeps what others compute",
    "errors.py": "texts",
    "files/": "where files are and whether they are whole",
    "graph.py": "runs functions, and names nodes in their keys",
    "images/": "textures, which are read anew in every run",
    "layers.py": "what goes into files",
    "memory.py": "refusals",
    "compiled.py": "which loop runs, whose bits are the same",
    "records.py": "fields",
    "scene/": "descriptions, whose values are bound in the nodes",
    "schema/": "checks of descriptions, whose values are bound in the nodes",
    "__init__.py": "the version, which keys hold where they outlive it",
}
"""Sources that functions of nodes import, and why they need not be hashed."""


def imported(path: Path) -> set[Path]:
    """The package's files that a file imports, at its top or within functions."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
    places = [PACKAGE.parent.joinpath(*name.split(".")) for name in names if name.startswith("illumcli")]
    files = [place.with_suffix(".py") for place in places] + [place / "__init__.py" for place in places]
    return {file for file in files if file.is_file()}


def unbound(function):
    """The function that a partial one binds."""
    while isinstance(function, partial):
        function = function.func
    return function


@pytest.fixture(scope="module")
def nodes() -> list[Node]:
    """The nodes of all scenes."""
    found = []
    for path in SCENES:
        loaded = load(path)
        found += build(loaded.scene, loaded).nodes.values()
    assert len(found) > 500
    return found


def test_sources_of_all_nodes_are_hashed(nodes):
    """What a node's function lives in and all it imports is in `SOURCES`, or decides nothing."""
    todo = {Path(str(inspect.getsourcefile(unbound(node.function)))) for node in nodes}
    reached: set[Path] = set()
    while todo:
        path = todo.pop()
        reached.add(path)
        inside = str(path.relative_to(PACKAGE))
        if not inside.startswith(tuple(DECIDE_NOTHING)):
            todo |= imported(path) - reached
    hashed = {Path(path) for path in source_files(str(PACKAGE))}
    missing = {str(path.relative_to(PACKAGE)) for path in reached - hashed}
    assert {path for path in missing if not path.startswith(tuple(DECIDE_NOTHING))} == set()
    assert {name for name in DECIDE_NOTHING if any(path.startswith(name) for path in missing)}


@pytest.mark.parametrize("name", [*SOURCES, *DECIDE_NOTHING])
def test_listed_sources_exist(name):
    assert (PACKAGE / name).exists()


def test_names_tell_functions_apart(nodes):
    """Two functions of one short name may not compute the same kind of buffer."""
    places: dict[str, set[str]] = {}
    for node in nodes:
        places.setdefault(node.name, set()).add(
            f"{unbound(node.function).__module__}.{short_name(node.function)}"
        )
    assert {name: where for name, where in places.items() if len(where) > 1} == {}
    assert [name for name in places if "<" in name] == []


def test_a_function_that_moves_keeps_its_keys(nodes, monkeypatch):
    def key() -> str:
        loaded = load(SCENES[0])
        return Keys(build(loaded.scene, loaded).nodes, None, "salt")("beauty")

    first = key()
    for node in nodes:
        function = unbound(node.function)
        if not isinstance(function, type):
            monkeypatch.setattr(function, "__module__", "illumcli.elsewhere")
    assert key() == first


def test_a_node_keeps_its_name_where_its_output_is_renamed():
    def shadow(hits):
        return hits

    assert Node.of(shadow, "shadow:key").name == Node.of(shadow, "shadow:rim").name
    assert Node("every", shadow, {}, "shadow").name == Node.of(shadow, "shadow").name
    assert Node.of(shadow, "shadow").name != Node.of(shadow, "light").name


@pytest.mark.parametrize("change", ["text", "name of a file", "place of a file"])
def test_the_hash_of_the_sources_is_that_of_their_texts(tmp_path, monkeypatch, change):
    package = tmp_path / "package"
    for name in SOURCES:
        path = package / name
        path = path if path.suffix else path / "a.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    monkeypatch.setattr(module, "__file__", str(package / "render_graph" / "keys.py"))
    first = module.code.__wrapped__()
    path = package / "rays" / "a.py"
    if change == "text":
        path.write_text("another text")
    elif change == "name of a file":
        path.rename(package / "rays" / "b.py")
    else:
        path.rename(package / "film" / "b.py")
    assert (module.code.__wrapped__() == first) == (change != "text")
    assert len(source_files(os.fspath(package))) == len(SOURCES)

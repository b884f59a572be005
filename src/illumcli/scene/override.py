"""Overrides: `-D PATH=VALUE` puts a value into a scene's tree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from illumcli.records import Value
from illumcli.scene import source
from illumcli.scene.source import MAX_DEPTH, Node, Place, Problem
from illumcli.schema.messages import describe, suggestion

NAMED = {
    "materials": "material",
    "meshes": "mesh",
    "cameras": "camera",
    "objects": "object",
    "lights": "light",
}
"""Parts of a scene that its author names, and what one of them is called."""


class Override(Value):
    """A value for the part of a scene at `steps`, which are keys, and numbers or names of list elements."""

    steps: tuple[str, ...]
    value: Node
    text: str
    """The path as given."""


class _NoSuchPart(Exception):
    """The path names no part of the scene; the text lists the parts."""


def parse(text: str, problems: list[Problem]) -> Override | None:
    """The override that `PATH=VALUE` describes; None if it is malformed, which is added to `problems`."""
    place = Place(f"-D {text}")
    path, equals, value = text.partition("=")
    steps = tuple(path.strip().split("."))
    if not equals or not all(steps) or len(steps) > MAX_DEPTH:
        problems.append(Problem(place, (), "write PATH=VALUE, as in -D film.samples=16"))
        return None
    if value.strip().startswith("#"):  # a colour; YAML would take it for a comment
        return Override(steps, Node(value.strip(), place), path.strip())
    node, node_problems = source.read(value.encode("utf-8", "surrogateescape"), "", place)
    problems += node_problems
    return None if node is None or node_problems else Override(steps, node, path.strip())


def assign(tree: Node, override: Override, problems: list[Problem]) -> Node | None:
    """`tree` with the override's value in it; None if the path does not exist (added to `problems`)."""
    try:
        return _put(tree, (), override.steps, override.value)
    except _NoSuchPart as fact:
        problems.append(Problem(override.value.place, (), str(fact)))
        return None


def _put(node: Node | None, path: tuple[str, ...], steps: tuple[str, ...], value: Node) -> Node | None:
    """The node at `path` with `value` at `steps` below it; None if that removes it."""
    if not steps:
        return None if value.value is None else value
    here = node.value if node else None
    if here is None:
        here = _new(path, steps)
    if isinstance(here, dict):
        return _put_in_mapping(here, node, path, steps, value)
    if node and isinstance(here, list):
        return _put_in_list(here, node, path, steps, value)
    name = ".".join(path)
    raise _NoSuchPart(f"{name} is {describe(here)} and has no parts; replace the whole, as -D {name}=...")


def _new(path: tuple[str, ...], steps: tuple[str, ...]) -> dict[str, Node]:
    """The empty mapping that is put at `path`, where the scene has nothing, to hold an override."""
    name = ".".join(path)
    if path in (("objects",), ("lights",)):
        raise _NoSuchPart(f"the scene has no {name}")
    if steps[0].isdigit():
        raise _NoSuchPart(f"the scene has no {name}; give the whole, as -D {name}=...")
    return {}


def _put_in_mapping(
    entries: dict[str, Node], node: Node | None, path: tuple[str, ...], steps: tuple[str, ...], value: Node
) -> Node:
    step, rest = steps[0], steps[1:]
    old = entries.get(step)
    if rest and old is None and len(path) == 1 and path[0] in NAMED:
        raise _NoSuchPart(_no(path[0], step, tuple(entries)))
    new = _put(old, (*path, step), rest, value)
    changed = {key: part for key, part in entries.items() if key != step}
    if new is not None:
        changed[step] = replace(new, key=old.key) if rest and old else new
    return replace(node, value=changed) if node and node.value is not None else Node(changed, value.place)


def _put_in_list(
    parts: list[Node], node: Node, path: tuple[str, ...], steps: tuple[str, ...], value: Node
) -> Node:
    index = _index(parts, path, steps[0])
    new = _put(parts[index], (*path, steps[0]), steps[1:], value)
    return replace(node, value=[*parts[:index], *([new] if new else []), *parts[index + 1 :]])


def _index(parts: list[Node], path: tuple[str, ...], step: str) -> int:
    """Index of the element of the list at `path` that a step names: by number, name or default name."""
    if step.isdigit() and step.isascii() and len(step) < 9:
        if int(step) < len(parts):
            return int(step)
        raise _NoSuchPart(f"{'.'.join(path)} has {len(parts)} parts, numbered from 0")
    names = _element_names(parts, path)
    if step not in names:
        raise _NoSuchPart(_no(path[-1], step, names))
    return names.index(step)


def _element_names(parts: list[Node], path: tuple[str, ...]) -> tuple[str, ...]:
    """The names of objects or lights, default names included; elements of other lists have none."""
    if path not in (("objects",), ("lights",)):
        return ()

    def text_of(part: Node, key: str) -> Any:
        node = part.find((key,))
        return node.value if node else None

    def name(part: Node, number: int) -> str:
        kind = "object" if path == ("objects",) else text_of(part, "light")
        return str(text_of(part, "name") or f"{kind}{number}")

    return tuple(name(part, i + 1) for i, part in enumerate(parts))


def _no(group: str, name: str, known: tuple[str, ...]) -> str:
    if group not in NAMED:
        return f"no part '{name}' in {group}; number its parts from 0"
    advice = suggestion(name, known) if known else f"the scene has no {group}"
    return f"no {NAMED[group]} '{name}'; {advice}"

"""Finds the override that causes a fault: the last one without which the scene does not have it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from illumcli.scene import source
from illumcli.scene.override import NAMED, Override
from illumcli.scene.source import Node, Place, Problem

_PLAIN = re.compile(r"[A-Za-z_][\w./-]*")


class PlacedFault(NamedTuple):
    """A fault of a tree and where a reader looks for it."""

    place: Place
    path: source.Path
    fact: str


class Applied(NamedTuple):
    """An override, and the scene's tree before it."""

    change: Override
    before: Node


def blamed(
    tree_faults: Sequence[PlacedFault],
    tree: Node,
    applied: Sequence[Applied],
    faults_of: Callable[[Node], Sequence[PlacedFault]],
) -> Iterator[Problem | PlacedFault]:
    """Each fault of `tree` that stands in a file, but comes from an override, as a problem of that; the
    others as they are.

    `faults_of` gives the faults of a tree. A fault is the same in two trees where its place and its fact are.
    """
    written = [fault for fault in tree_faults if fault.place.line]
    known = (
        [{(each.place, each.fact) for each in faults_of(step.before)} for step in applied] if written else []
    )
    left_over: dict[int, list[PlacedFault]] = {}
    for fault in tree_faults:
        new = [k for k, faults in enumerate(known) if (fault.place, fault.fact) not in faults]
        if not fault.place.line or not new:
            yield fault
        elif _is_left_over(fault, applied[new[-1]].change, tree):
            left_over.setdefault(new[-1], []).append(fault)
        else:
            yield Problem(applied[new[-1]].change.value.place, fault.path, fault.fact)
    for k, faults in left_over.items():
        change = applied[k].change
        yield Problem(change.value.place, (), _left_over(change, [fault.path for fault in faults], tree))


def _is_left_over(fault: PlacedFault, change: Override, tree: Node) -> bool:
    """Is it a key that does not suit its neighbour, which the override changed?"""
    if len(fault.path) != len(change.steps) or not fault.fact.startswith("unknown key "):
        return False
    neighbour = tree.find((*fault.path[:-1], change.steps[-1]))
    return neighbour is not None and neighbour.place == change.value.place


def _left_over(change: Override, paths: Sequence[source.Path], tree: Node) -> str:
    """What an override left behind that says what its part is, and how to replace the whole part."""
    *above, key = change.steps
    kind = NAMED[above[0]] if len(above) == 2 and above[0] in NAMED else above[-1]
    part = tree.find(paths[0][:-1])
    assert part is not None
    names = [str(path[-1]) for path in paths]
    values = part.plain()
    kept = {key: values[key]} | {name: value for name, value in values.items() if name not in names}
    listed = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    return (
        f"leaves {listed}, which {kept[key]} does not have; replace the whole {kind}, as "
        f"-D '{'.'.join(above)}={flow(kept)}'"
    )


def flow(value: Any) -> str:
    """A value as YAML on one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name}: {flow(part)}' for name, part in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(flow, value))}]"
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.lower() not in ("true", "false", "null"):
        return value
    return json.dumps(value, ensure_ascii=False)

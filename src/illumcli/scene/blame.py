"""Attributes faults of a scene to the overrides that cause them.

An override causes a fault if the scene did not have the fault before it was applied. So if a scene has
faults, its trees before each override are validated, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from illumcli.scene import source
from illumcli.scene.override import NAMED, Override
from illumcli.scene.source import Node, Place, Problem
from illumcli.scene.yaml_text import flow


class PlacedFault(NamedTuple):
    """A fault of a scene's tree, with its place in a file or override."""

    place: Place
    path: source.Path
    fact: str


class Applied(NamedTuple):
    """An override, and the scene's tree before it was applied."""

    change: Override
    before: Node


def blamed(
    tree_faults: Sequence[PlacedFault],
    tree: Node,
    applied: Sequence[Applied],
    faults_of: Callable[[Node], Sequence[PlacedFault]],
) -> Iterator[Problem | PlacedFault]:
    """The faults of `tree`; those in a file that an override causes become problems at the override.

    Parameters
    ----------
    tree_faults : sequence of PlacedFault
        The faults of `tree`, which has all overrides.
    applied : sequence of Applied
        The overrides in order.
    faults_of : callable
        The faults of a tree. Faults of two trees are the same if place and text are.
    """
    # The faults before each override; a fault whose place is an override needs no search.
    in_files = [fault for fault in tree_faults if fault.place.line]
    before = (
        [{(each.place, each.fact) for each in faults_of(step.before)} for step in applied] if in_files else []
    )

    # The last override before which the scene did not have the fault causes it.
    unsuited: dict[int, list[PlacedFault]] = {}
    for fault in tree_faults:
        without = [k for k, faults in enumerate(before) if (fault.place, fault.fact) not in faults]
        if not fault.place.line or not without:
            yield fault
        elif _is_unsuited(fault, applied[without[-1]].change, tree):
            unsuited.setdefault(without[-1], []).append(fault)
        else:
            yield Problem(applied[without[-1]].change.value.place, fault.path, fault.fact)

    # One problem for all keys that an override of a tag (`model: phong`) makes unknown.
    for k, faults in unsuited.items():
        change = applied[k].change
        yield Problem(change.value.place, (), _unsuited_keys(change, [fault.path for fault in faults], tree))


def _is_unsuited(fault: PlacedFault, change: Override, tree: Node) -> bool:
    """True if the fault is a key that became unknown because the override changed the tag beside it."""
    if len(fault.path) != len(change.steps) or not fault.fact.startswith("unknown key "):
        return False
    tag = tree.find((*fault.path[:-1], change.steps[-1]))
    return tag is not None and tag.place == change.value.place


def _unsuited_keys(change: Override, paths: Sequence[source.Path], tree: Node) -> str:
    """Message for an override of a tag: the keys that no longer suit it, and how to replace the part."""
    # The part without those keys.
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

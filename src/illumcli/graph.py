"""Nodes of a graph of named functions, and the order in which those run that some outputs need."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields
from functools import cache, partial
from typing import Any, TypeAlias

from illumcli.records import Value

Buffers: TypeAlias = Mapping[str, Any]
"""Buffers by name, each of the type that its node's function returns."""


class Node(Value):
    """A function, the buffer it computes, and the buffer that each of its parameters takes."""

    output: str
    function: Callable[..., Any]
    inputs: Mapping[str, str]  # parameter -> buffer
    kind: str = ""
    """What the output is, where its name before a colon does not say it: keeps the name of a renamed node."""

    @classmethod
    def of(cls, function: Callable[..., Any], output: str | None = None, **renamed: str) -> Node:
        """A node whose inputs are the function's own parameter names, `renamed` where given.

        A parameter with a default is an input only when `renamed` names its buffer.
        """
        name = output or str(getattr(function, "__name__", ""))
        inputs = {p: renamed.pop(p, p) for p in required(function)}
        return cls(name, function, {**inputs, **renamed})

    @property
    def name(self) -> str:
        """What a cache knows the node by, beside the values bound in its function: the kind of its output and
        the function's short name. It does not say in which module the function lives."""
        return f"{self.kind or self.output.partition(':')[0]}={short_name(self.function)}"

    def run(self, buffers: Buffers) -> Any:
        """Call the function with the buffers of its inputs."""
        return self.function(**{parameter: buffers[name] for parameter, name in self.inputs.items()})


def short_name(function: Callable[..., Any]) -> str:
    """The name of a function within its module; of a partial one, the name of the function it binds."""
    while isinstance(function, partial):
        function = function.func
    return str(function.__qualname__)


def required(function: Callable[..., Any]) -> tuple[str, ...]:
    """Names of the parameters that have no default and are not bound yet; of a record with `needs`, these."""
    if isinstance(function, Value):
        needs: tuple[str, ...] = function.needs
        return needs
    if isinstance(function, partial):
        bound, inner = set(function.keywords), required(function.func)
        return tuple(name for name in inner[len(function.args) :] if name not in bound)
    if inspect.ismethod(function):  # remembered by its function: the cache must not keep the object alive
        return _parameters(function.__func__)[1:]
    return _parameters(function)


@cache
def _parameters(function: Callable[..., Any]) -> tuple[str, ...]:
    if isinstance(function, type) and issubclass(function, Value):  # a record: its fields
        return tuple(
            part.name
            for part in fields(function)
            if part.default is MISSING and part.default_factory is MISSING
        )
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.default is p.empty)


def topological_order(
    nodes: Mapping[str, Node], outputs: Iterable[str], given: Iterable[str] = ()
) -> list[Node]:
    """The nodes that `outputs` need, each after its inputs; `given` buffers need no node.

    Raises
    ------
    KeyError
        A buffer that no node computes.
    ValueError
        Nodes that need each other in a circle.
    """
    done, ordered = set(given), []  # type: set[str], list[Node]
    for name in outputs:
        _visit(name, nodes, done, [], ordered)
    return ordered


def _visit(
    name: str, nodes: Mapping[str, Node], done: set[str], path: list[str], ordered: list[Node]
) -> None:
    """Add the node of `name` after its inputs; `path` led here.

    Not a function inside `topological_order`: one that calls itself there is a reference cycle, and keeps the
    nodes and every array bound in them until the garbage collector runs.
    """
    if name in done:
        return
    if name in path:
        raise ValueError(" -> ".join([*path[path.index(name) :], name]))
    node = nodes[name]
    for need in node.inputs.values():
        _visit(need, nodes, done, [*path, name], ordered)
    done.add(name)
    ordered.append(node)

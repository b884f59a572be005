"""Which named functions must run to make what is asked for, and in what order."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from typing import Any

from illumcli.records import Value


class Node(Value):
    """A function, the buffer it makes, and the buffer behind each of its parameters."""

    makes: str
    function: Callable[..., Any]
    needs: Mapping[str, str]  # parameter -> buffer

    @classmethod
    def of(cls, function: Callable[..., Any], makes: str | None = None, **renamed: str) -> Node:
        """A recipe whose needs are the function's own parameter names, `renamed` where given.

        A parameter with a default is needed only when `renamed` names its buffer.
        """
        name = makes or str(getattr(function, "__name__", ""))
        needs = {p: renamed.pop(p, p) for p in required(function)}
        return cls(name, function, {**needs, **renamed})

    def make(self, buffers: Mapping[str, Any]) -> Any:
        """Run the function on the buffers it needs."""
        return self.function(**{parameter: buffers[name] for parameter, name in self.needs.items()})


def required(function: Callable[..., Any]) -> tuple[str, ...]:
    """Names of the parameters that have no default and are not bound yet."""
    if isinstance(function, partial):
        bound, inner = set(function.keywords), required(function.func)
        return tuple(name for name in inner[len(function.args) :] if name not in bound)
    if inspect.ismethod(function):  # remembered by its function: the cache must not keep the object alive
        return _parameters(function.__func__)[1:]
    return _parameters(function)


@cache
def _parameters(function: Callable[..., Any]) -> tuple[str, ...]:
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.default is p.empty)


def order(book: Mapping[str, Node], outputs: Iterable[str], given: Iterable[str] = ()) -> list[Node]:
    """The recipes that `outputs` reach, each after all it needs; `given` buffers need no recipe.

    Raises
    ------
    KeyError
        A buffer that no recipe makes.
    ValueError
        Nodes that need each other in a circle.
    """
    done, steps = set(given), []  # type: set[str], list[Node]
    for name in outputs:
        _visit(name, book, done, [], steps)
    return steps


def _visit(name: str, book: Mapping[str, Node], done: set[str], path: list[str], steps: list[Node]) -> None:
    """Add the recipe of `name` behind all it needs; `path` led here.

    Not a function inside `order`: one that calls itself there is a reference cycle, and keeps the book and
    every array that its recipes hold until the garbage collector comes by.
    """
    if name in done:
        return
    if name in path:
        raise ValueError(" -> ".join([*path[path.index(name) :], name]))
    recipe = book[name]
    for need in recipe.needs.values():
        _visit(need, book, done, [*path, name], steps)
    done.add(name)
    steps.append(recipe)

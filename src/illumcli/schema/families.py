"""Open families: one module holds one member, and the module's name is its tag.

A scene names the tag; only the module of that name is imported then, so a family of thirty members costs
a run what its scene uses. Nothing is registered and no list is kept.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from typing import Any, get_args

from pydantic_core import (
    CoreSchema,
    InitErrorDetails,
    PydanticCustomError,
    ValidationError,
    core_schema,
)

from illumcli.records import Value
from illumcli.schema.description import Description


@cache
def tags(package: str) -> tuple[str, ...]:
    """The tags of a family, sorted: its modules, without the helpers that begin with an underscore."""
    return modules(import_module(package).__path__)


def modules(folders: Iterable[str]) -> tuple[str, ...]:
    """The names of the modules and packages in folders, sorted, without those that begin with an underscore.

    `pkgutil` would call a folder empty where the system refuses to list it.

    Raises
    ------
    OSError
        Such a refusal.
    """
    names = {
        entry.name.partition(".")[0]
        for folder in folders
        for entry in os.scandir(folder)
        if entry.name.endswith(".py") or entry.is_dir()
    }
    return tuple(sorted(name for name in names if not name.startswith("_")))


@cache
def member(package: str, tag: str) -> type[Any]:
    """The one class that the module of this name defines.

    Raises
    ------
    LookupError
        No such module; the text suggests the nearest tag.
    """
    if tag not in tags(package):
        raise LookupError(suggestion(tag, tags(package)))
    module = import_module(f"{package}.{tag}")
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__ and issubclass(value, Description)
    ]
    if len(classes) != 1:
        raise TypeError(f"{module.__name__} must define one class, defines {len(classes)}")
    return classes[0]


def members(package: str) -> tuple[type[Any], ...]:
    """Every class of a family, by tag."""
    return tuple(member(package, tag) for tag in tags(package))


def suggestion(word: str, known: tuple[str, ...]) -> str:
    """The way out of a misspelling: the nearest known word, or all of them where none is near."""
    import difflib

    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(known)}"


class Tagged(Value):
    """Annotation of a field that takes any member of a family, told apart by its key `tag`."""

    package: str
    tag: str

    def schema(self, of: Any) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._validated, metadata={"family": self})

    def _validated(self, value: Any, info: Any) -> Any:
        if isinstance(value, Description):
            return value
        if not isinstance(value, dict):
            raise PydanticCustomError("mapping", "must be a mapping with the key '{tag}'", {"tag": self.tag})
        name = value.get(self.tag)
        if not isinstance(name, str):
            known = ", ".join(tags(self.package))
            raise PydanticCustomError(
                "tag_missing", "must name its {tag}: {known}", {"tag": self.tag, "known": known}
            )
        try:
            chosen = member(self.package, name)
        except LookupError as error:
            facts = {"tag": self.tag, "name": name, "way": str(error)}
            unknown = PydanticCustomError("tag_unknown", "no {tag} '{name}'; {way}", facts)
            details = [InitErrorDetails(type=unknown, loc=(self.tag,), input=name)]
            details += self._other_faults(value, name, info.context)
            raise ValidationError.from_exception_data(self.tag, details) from None
        return chosen.validated(value, info.context)

    def _other_faults(self, value: dict[Any, Any], name: str, context: Any) -> list[InitErrorDetails]:
        """What else is wrong with a mapping whose tag is misspelt: by the member that is meant.

        Where none is near, a key that every member that has it refuses.
        """
        import difflib

        near = difflib.get_close_matches(name, tags(self.package), n=1)
        if near:
            meant = member(self.package, near[0])
            if context is not None:
                context[id(value)] = meant
            return self._faults_as(near[0], value, context)
        refused: dict[str, list[list[InitErrorDetails]]] = {key: [] for key in value if key != self.tag}
        for tag, each in zip(tags(self.package), members(self.package), strict=True):
            faults = self._faults_as(tag, value, None)
            for key in refused.keys() & each.fields():
                refused[key].append([fault for fault in faults if fault["loc"][:1] == (key,)])
        return [
            fault for by_member in refused.values() if by_member and all(by_member) for fault in by_member[0]
        ]

    def _faults_as(self, tag: str, value: dict[Any, Any], context: Any) -> list[InitErrorDetails]:
        """What is wrong with a mapping as the member of this tag."""
        try:
            member(self.package, tag).validated({**value, self.tag: tag}, context)
        except ValidationError as error:
            return [_details(fault) for fault in error.errors(include_url=False)]
        return []


def _details(fault: Any) -> InitErrorDetails:
    """A fault, to be raised again."""
    kind: str | PydanticCustomError = fault["type"]
    if kind not in get_args(core_schema.ErrorType):
        kind = PydanticCustomError(fault["type"], fault["msg"], fault.get("ctx"))
    return InitErrorDetails(type=kind, loc=fault["loc"], input=fault["input"], ctx=fault.get("ctx", {}))

"""Open families: each module defines one member, and the module's name is its tag.

A scene names tags, and only the modules of these names are imported: the start-up time does not depend on the
size of a family. Members are not registered in any list: they are modules of this package, files in folders
that the user names, and entry points of other packages (`sources`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, reduce
from importlib import import_module
from operator import or_
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, PlainValidator, TypeAdapter, ValidationError

from illumcli.errors import InputError
from illumcli.schema.description import Description
from illumcli.schema.foreign import BrokenMember, class_in, loaded
from illumcli.schema.messages import nearest, suggestion
from illumcli.schema.sources import entry_points, own_tags, tags
from illumcli.schema.sources import files as source_files


@cache
def _own_member(package: str, tag: str) -> type[Any]:
    module = import_module(f"{package}.{tag}")
    return class_in(module, module.__name__)


def member(package: str, tag: str) -> type[Any]:
    """The one class that the module of this name defines.

    Raises
    ------
    LookupError
        No such module; the text suggests the nearest tag.
    InputError
        A folder that the user names has a member with the tag of another.
    BrokenMember
        The module is not ours, and cannot be used.
    """
    files = source_files(package)
    if tag in own_tags(package):
        return _own_member(package, tag)
    source = files.get(tag) or entry_points(package).get(tag)
    if source is None:
        raise LookupError(suggestion(tag, tags(package)))
    return loaded(package, tag, source)


def tag_of(cls: type[Any]) -> str:
    """The tag of a member: the name of its module."""
    return cls.__module__.rpartition(".")[2]


def members(package: str) -> tuple[type[Any], ...]:
    """Every class of a family, by tag.

    Raises
    ------
    InputError
        What is wrong with all modules that cannot be used.
    """
    found: list[type[Any]] = []
    problems: list[str] = []
    for tag in tags(package):
        try:
            found.append(member(package, tag))
        except BrokenMember as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return tuple(found)


@dataclass(frozen=True)
class Family:
    """Annotation of a field that takes any member of a family; the field's key `tag` names the member."""

    package: str
    tag: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Members are unknown until a scene names them, so each value is validated by its own class."""
        return PlainValidator(self._validated).__get_pydantic_core_schema__(Any, handler)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        every: Any = reduce(or_, members(self.package))
        choices = handler(TypeAdapter(every).core_schema)["anyOf"]
        return {"oneOf": choices, "discriminator": {"propertyName": self.tag}}

    def _validated(self, value: Any) -> Description:
        if isinstance(value, Description):
            return value
        if not isinstance(value, dict):
            raise ValueError(f"must be a mapping with the key '{self.tag}'")
        name = value.get(self.tag)
        if not isinstance(name, str):
            raise ValueError(f"must name its {self.tag}: {', '.join(tags(self.package))}")
        try:
            chosen = member(self.package, name)
        except BrokenMember as error:
            raise ValueError("; ".join(error.problems)) from error
        except LookupError as error:
            unknown = UnknownMember(f"no {self.tag} '{name}'; {error}", self)
            raise ValidationError.from_exception_data(
                self.tag,
                [{"type": "value_error", "loc": (self.tag,), "input": name, "ctx": {"error": unknown}}],
            ) from None
        return chosen.model_validate(value)

    def meant(self, value: Any) -> type[Description] | None:
        """The member that a mapping names or most likely means; None if there is none."""
        name = value.get(self.tag) if isinstance(value, dict) else None
        near = nearest(name, tags(self.package)) if isinstance(name, str) else None
        try:
            return member(self.package, near) if near else None
        except BrokenMember:
            return None


class UnknownMember(ValueError):
    """A mapping names no member of a family."""

    def __init__(self, text: str, family: Family) -> None:
        super().__init__(text)
        self.family = family

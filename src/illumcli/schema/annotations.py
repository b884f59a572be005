"""Reads the annotations of descriptions: the class, choices and range of a part of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import Discriminator, Tag
from pydantic.fields import FieldInfo

from illumcli.schema.description import Description, owner_of
from illumcli.schema.families import Family


class Range(NamedTuple):
    """The range of a number, or of each number of a list."""

    ge: float | None
    gt: float | None
    le: float | None
    lt: float | None
    width: int
    """3 for a colour, 1 for a number."""


def field_annotation(cls: type[Description], name: str) -> Any:
    """The annotation of a field with its metadata."""
    info = cls.model_fields[name]
    return Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation


def annotation_at(description: Description, path: str) -> Any:
    """The annotation of the value at a path, such as `distribution.m`."""
    owner, name = owner_of(description, path)
    if isinstance(owner, Description):
        return field_annotation(type(owner), name)
    whole, name = owner_of(description, path.rpartition(".")[0])
    # a mapping, whose values share an annotation
    return get_args(split(field_annotation(type(whole), name))[0])[1]


def split(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """An annotation without `None`, and its metadata from the inside out."""
    marks: tuple[Any, ...] = ()
    while True:
        parts = get_args(annotation)
        if get_origin(annotation) is Annotated:
            annotation, marks = parts[0], (*parts[1:], *marks)
        elif get_origin(annotation) in (Union, UnionType) and len(parts) == 2 and NoneType in parts:
            annotation = next(part for part in parts if part is not NoneType)
        else:
            return annotation, marks


def inside(annotation: Any, value: Any, step: str | int) -> tuple[Any, bool]:
    """The annotation one step further along an error's location; and whether the step is a key or an index.

    Other steps name the choice of a union, which is not in the scene's text.

    Parameters
    ----------
    annotation
        Of the part where the step begins; None if it is unknown. The result may be None, too.
    value
        The value of that part in the scene.
    step : str or int
    """
    plain, marks = split(annotation)
    for mark in marks:
        if isinstance(mark, Discriminator):
            tagged = dict(choices(annotation))
            return tagged.get(step), step not in tagged
        if isinstance(mark, Family):
            plain = mark.meant(value)
    parts = get_args(plain)
    if isinstance(plain, type) and issubclass(plain, Description):
        return (field_annotation(plain, str(step)) if step in plain.model_fields else None), True
    if get_origin(plain) is dict:
        return parts[1], True
    if get_origin(plain) is tuple and isinstance(step, int):
        return parts[0 if parts[-1] is ... else min(step, len(parts) - 1)], True
    return None, True


def choices(annotation: Any) -> Iterator[tuple[Any, Any]]:
    """Name and annotation of each choice: of literals, or of a union with tags."""
    plain, marks = split(annotation)
    if get_origin(plain) is Literal:
        yield from ((value, value) for value in get_args(plain))
    key = next((mark.discriminator for mark in marks if isinstance(mark, Discriminator)), None)
    for part in get_args(plain) if key else ():
        if isinstance(key, str):
            (tag,) = get_args(part.model_fields[key].annotation)
        else:
            tag = next(mark.tag for mark in part.__metadata__ if isinstance(mark, Tag))
        yield tag, part


def is_tag(cls: type[Description], name: str) -> bool:
    """True if a field has one possible value, which tells the class from others."""
    return len(list(choices(field_annotation(cls, name)))) == 1


def number_range(annotation: Any) -> Range:
    """The range of a number or colour; for a parameter that may vary over the surface, of a constant value.

    Raises
    ------
    LookupError
        The annotation holds no number.
    """
    plain, marks = split(annotation)
    if any(isinstance(mark, Discriminator) for mark in marks):
        return number_range(dict(choices(annotation))["value"])
    if get_origin(plain) is tuple:
        return number_range(get_args(plain)[0])._replace(width=3)
    if plain is not float:
        raise LookupError(f"{annotation} holds no number")
    rules = [rule for mark in marks for rule in (mark.metadata if isinstance(mark, FieldInfo) else [mark])]

    def limit(name: str) -> float | None:
        return next((getattr(rule, name) for rule in rules if hasattr(rule, name)), None)

    return Range(limit("ge"), limit("gt"), limit("le"), limit("lt"), 1)

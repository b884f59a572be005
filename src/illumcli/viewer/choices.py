"""Fields that hold one of several descriptions: an open family, or a union whose members have a tag."""

from __future__ import annotations

from typing import Any

from illumcli.schema.annotations import choices, field_annotation, is_tag, split
from illumcli.schema.description import Description
from illumcli.schema.families import Family, member
from illumcli.schema.sources import tags


def tag_value(cls: type[Description]) -> dict[str, str]:
    """The tag of a class, as in `{"model": "phong"}`; empty if it has none."""
    names = [name for name in cls.model_fields if is_tag(cls, name)]
    return {name: str(value) for name in names for value, _ in choices(field_annotation(cls, name))}


def tags_in(annotation: Any) -> tuple[str, ...]:
    """The tags of the descriptions that a field may hold; empty if it holds no choice of them."""
    family = _family(annotation)
    if family is not None:
        return tags(family.package)
    classes = dict(choices(annotation))
    return tuple(classes) if classes and all(map(_is_description, classes.values())) else ()


def class_of(annotation: Any, tag: str) -> type[Description]:
    """The class of a tag.

    Raises
    ------
    LookupError
        There is none; the text suggests the nearest tag.
    BrokenMember
        It is not ours, and cannot be used.
    """
    family = _family(annotation)
    if family is not None:
        return member(family.package, tag)
    classes = dict(choices(annotation))
    if tag not in classes:
        raise LookupError(f"there are: {', '.join(classes)}")
    cls: type[Description] = split(classes[tag])[0]
    return cls


def holds_descriptions(annotation: Any) -> bool:
    """True if a field holds a description and nothing else."""
    return _is_description(annotation) or bool(tags_in(annotation))


def _family(annotation: Any) -> Family | None:
    return next((mark for mark in split(annotation)[1] if isinstance(mark, Family)), None)


def _is_description(annotation: Any) -> bool:
    plain = split(annotation)[0]
    return isinstance(plain, type) and issubclass(plain, Description)

"""Translates pydantic's errors into faults of a scene: the path of a part, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from pydantic import Discriminator, ValidationError

from illumcli.errors import InputError
from illumcli.scene.source import Path
from illumcli.schema.annotations import choices, inside, split
from illumcli.schema.description import Description
from illumcli.schema.families import Family, UnknownMember, member, tag_of
from illumcli.schema.foreign import BrokenMember
from illumcli.schema.messages import no_choice, sentence, short, suggestion, wrong_length
from illumcli.schema.sources import tags

D = TypeVar("D", bound=Description)
Fault = tuple[Path, str]  # path of the part, what is wrong with it


def validated(cls: type[D], tree: Any) -> D:
    """The description in `tree`: dicts, lists and scalars.

    Raises
    ------
    InputError
        Every fault, with the path of its part.
    """
    try:
        return cls.model_validate(tree)
    except ValidationError as error:
        facts = faults(error, cls, tree)
        raise InputError(f"{'.'.join(map(str, path))}: {fact}" for path, fact in facts) from None


def faults(error: ValidationError, cls: type[Description], tree: Any) -> Iterator[Fault]:
    """Each fault once, in the order of the fields.

    Parameters
    ----------
    error : ValidationError
    cls : type of Description
        The class that refused `tree`.
    tree
        What was validated: dicts, lists and scalars.
    """
    return iter(dict.fromkeys(_faults(error, cls, tree)))


def _faults(error: ValidationError, cls: type[Description], tree: Any) -> Iterator[Fault]:
    lengths = _short_lists(error)
    for fault in error.errors(include_url=False):
        kind, loc, value, context = fault["type"], fault["loc"], fault["input"], fault.get("ctx", {})
        path, annotation = _located(loc, cls, tree)
        match kind:
            case "missing" if isinstance(loc[-1], int):  # a vector with too few components
                yield path, wrong_length(part_at(path, tree), lengths[loc[:-1]])
            case "missing":
                yield path, f"missing key '{loc[-1]}'"
            case "too_long":
                yield path, wrong_length(value, context["max_length"])
            case "too_short":
                if len(value) < context["min_length"]:  # faulty parts are not counted
                    yield path, f"must have at least {context['min_length']} part, has {len(value)}"
            case "extra_forbidden":
                known = tuple(_class_at(loc[:-1], cls, tree).model_fields)
                name = str(loc[-1])
                yield path, f"unknown key '{short(name)}'; {suggestion(name, known)}"
            case "literal_error":
                yield path, no_choice(value, [choice for choice, _ in choices(annotation)])
            case "union_tag_invalid":
                tag, known = str(context["tag"]), tuple(choice for choice, _ in choices(annotation))
                yield path, f"no {_key(annotation)} '{short(tag)}'; {suggestion(tag, known)}"
            case "union_tag_not_found":
                yield path, f"missing key '{_key(annotation)}'"
            case _:  # errors that validators of this package raise already have their message
                yield path, sentence(kind, context, value) or fault["msg"]
        # With an unknown tag pydantic stops: the other keys are validated as those of a likely member.
        if isinstance(unknown := context.get("error"), UnknownMember):
            mapping = part_at(path[:-1], tree)
            for inner, fact in _other_faults(unknown.family, mapping):
                yield (*path[:-1], *inner), fact


def _located(loc: tuple[str | int, ...], cls: type[Description], tree: Any) -> tuple[Path, Any]:
    """The steps of an error's location that are in the file, and the annotation of the part.

    Other steps name a choice of a union, or are in the long form of a value that the file has in short form.
    """
    path: list[str | int] = []
    annotation: Any = cls
    for step in loc:
        annotation, is_part = inside(annotation, tree, step)
        if is_part and (part := part_at((step,), tree)) is not _NOTHING:
            path.append(step)
            tree = part
    return tuple(path), annotation


def _class_at(loc: tuple[str | int, ...], cls: type[Description], tree: Any) -> type[Description]:
    """The class of the description that has an unknown key."""
    path, annotation = _located(loc, cls, tree)
    plain, marks = split(annotation)
    family = next((mark for mark in marks if isinstance(mark, Family)), None)
    meant: type[Description] | None = family.meant(part_at(path, tree)) if family else plain
    assert meant is not None
    return meant


def _key(annotation: Any) -> Any:
    """The key that tells the choices of a union apart."""
    return next(mark.discriminator for mark in split(annotation)[1] if isinstance(mark, Discriminator))


def part_at(path: Path, tree: Any) -> Any:
    """The part of `tree` at `path`; `_NOTHING` if there is none."""
    for step in path:
        is_inside = step in tree if isinstance(tree, dict) else isinstance(step, int) and step < _count(tree)
        if not is_inside:
            return _NOTHING
        tree = tree[step]
    return tree


def _count(tree: Any) -> int:
    return len(tree) if isinstance(tree, list | tuple) else 0


_NOTHING = object()


def _short_lists(error: ValidationError) -> dict[tuple[str | int, ...], int]:
    """Lists with too few elements, and how many they need; pydantic reports each missing one."""
    lengths: dict[tuple[str | int, ...], int] = {}
    for fault in error.errors(include_url=False, include_context=False, include_input=False):
        *above, last = fault["loc"] or ("",)
        if fault["type"] == "missing" and isinstance(last, int):
            lengths[tuple(above)] = max(last + 1, lengths.get(tuple(above), 0))
    return lengths


def _other_faults(family: Family, mapping: Mapping[str, Any]) -> Iterator[Fault]:
    """Other faults of a mapping whose tag is misspelt, according to the member with the nearest tag.

    If no tag is near: the faults of each key that all members with this key refuse.
    """
    if meant := family.meant(mapping):
        yield from _faults_as(meant, family.tag, mapping)
        return
    refused: dict[str, list[list[Fault]]] = {key: [] for key in mapping if key != family.tag}
    for tag in tags(family.package):
        try:
            each = member(family.package, tag)
        except BrokenMember:
            continue
        as_this = list(_faults_as(each, family.tag, mapping))
        for key in refused.keys() & each.model_fields:
            refused[key].append([fault for fault in as_this if fault[0][:1] == (key,)])
    for by_member in refused.values():
        if by_member and all(by_member):
            yield from by_member[0]


def _faults_as(cls: type[Description], tag: str, mapping: Mapping[str, Any]) -> Iterator[Fault]:
    """The faults of a mapping as a member of a family, whatever its tag is."""
    as_member = {**mapping, tag: tag_of(cls)}
    try:
        cls.model_validate(as_member)
    except ValidationError as error:
        yield from faults(error, cls, as_member)

"""Frozen records that functions hand to each other.

They behave like frozen data classes of the standard library. Those compile six methods per class, which takes
0.6 ms, and a render imports about a hundred classes; here all classes share their methods.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, ClassVar, dataclass_transform


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Value:
    """Immutable fields, given in order or by name; equal if class and fields are equal.

    `dataclasses.replace` and `dataclasses.fields` work on it.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    _known: ClassVar[tuple[Field[Any], ...]]
    """`dataclasses.fields` of the class."""

    def __init_subclass__(cls) -> None:
        dataclass(init=False, repr=False, eq=False)(cls)
        cls._known = fields(cls)

    def __init__(self, *values: Any, **named: Any) -> None:
        cls, known = type(self), self._known
        if len(values) > len(known):
            raise TypeError(f"{cls.__name__} takes {', '.join(part.name for part in known)}")
        values_by_name = vars(self)
        for part, value in zip(known, values, strict=False):
            values_by_name[part.name] = value
        for part in known[len(values) :]:
            if part.name in named:
                values_by_name[part.name] = named.pop(part.name)
            elif part.default is not MISSING:
                values_by_name[part.name] = part.default
            elif part.default_factory is not MISSING:
                values_by_name[part.name] = part.default_factory()
            else:
                raise TypeError(f"{cls.__name__}: missing field {part.name}")
        if named:
            raise TypeError(f"{cls.__name__} takes {', '.join(part.name for part in known)}")
        self.__post_init__()

    def __post_init__(self) -> None:
        """Called when all fields are set, to check or prepare them."""

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen: {name} cannot be changed")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen: {name} cannot be deleted")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((type(self), *vars(self).values()))

    def __repr__(self) -> str:
        shown = [f"{part.name}={getattr(self, part.name)!r}" for part in self._known if part.repr]
        return f"{type(self).__name__}({', '.join(shown)})"


class Record(Value):
    """A value with arrays among its fields: equal to itself alone."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__

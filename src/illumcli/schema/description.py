"""What a scene is made of: frozen descriptions of fields."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any, ClassVar, NamedTuple, Self, dataclass_transform, get_origin, get_type_hints

from pydantic_core import CoreConfig, CoreSchema, SchemaValidator, ValidationError, core_schema

from illumcli.records import Frozen
from illumcli.schema.fields import schema_of

REQUIRED: Any = object()
"""The default of a field that has none."""


class Field(NamedTuple):
    """What a description's field may hold, as an annotation, and what it holds where nothing is said."""

    kind: Any
    default: Any


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Description(Frozen):
    """A frozen part of a scene; unknown keys are refused, text is never read as a number.

    Its fields are the annotated names of its class and of those it stands on.
    """

    def __init__(self, **said: Any) -> None:
        vars(self).update(vars(self.validated(said)))

    @classmethod
    def validated(cls, value: Any, classes: dict[int, type[Description]] | None = None) -> Self:
        """The description that a mapping writes.

        Parameters
        ----------
        value
            As a scene has it: dicts, lists and scalars; or descriptions.
        classes : dict, optional
            Gets the class that refused each faulty mapping, by `id`: messages name its keys.

        Raises
        ------
        ValidationError
            Every fault.
        """
        made: Self = cls._validator().validate_python(value, context=classes)
        return made

    @classmethod
    @cache
    def fields(cls) -> dict[str, Field]:
        """The fields by name, those of the classes that this one stands on first."""
        found = {}
        for name, kind in get_type_hints(cls, include_extras=True).items():
            if get_origin(kind) is not ClassVar:
                own = next(each for each in cls.__mro__ if name in vars(each).get("__annotations__", ()))
                found[name] = Field(kind, vars(own).get(name, REQUIRED))
        return found

    @classmethod
    @cache
    def core_schema(cls) -> CoreSchema:
        """The schema of pydantic's core that makes this description of a mapping."""
        parts = {}
        for name, (kind, default) in cls.fields().items():
            part = schema_of(kind)
            for check in _checks_of(cls, name):
                part = core_schema.with_info_after_validator_function(partial(_checked, check), part)
            if default is not REQUIRED:
                part = core_schema.with_default_schema(part, default=default, validate_default=True)
            parts[name] = core_schema.typed_dict_field(part, required=default is REQUIRED)
        strict = CoreConfig(strict=True, extra_fields_behavior="forbid")
        said = core_schema.typed_dict_schema(parts, cls=cls, config=strict)
        return core_schema.with_info_wrap_validator_function(cls._made, said)

    @classmethod
    @cache
    def _validator(cls) -> SchemaValidator:
        return SchemaValidator(cls.core_schema())

    @classmethod
    def _made(cls, value: Any, handler: Callable[[Any], dict[str, Any]], info: Any) -> Self:
        """The description that `value` writes, or `value` where it is one."""
        if isinstance(value, cls):
            return value
        try:
            made = object.__new__(cls)
            vars(made).update(handler(value))
            made.check()
        except ValidationError:
            if info.context is not None:
                info.context[id(value)] = cls
            raise
        return made

    def check(self) -> None:
        """Raise ValueError where fields that are valid each do not go together."""

    def replaced(self, **values: Any) -> Self:
        """This description with other values of some fields; nothing is validated again."""
        made = object.__new__(type(self))
        vars(made).update(vars(self), **values)
        return made

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        return iter(vars(self).items())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self)})"


def written(value: Any) -> Any:
    """A default as a scene writes it; what it describes is made when it is needed."""
    return value


def checks(*names: str) -> Callable[[Callable[[Any, Mapping[str, Any]], None]], Any]:
    """Mark a function in a class that looks at the fields of these names.

    It is given a valid value and the valid fields before it, and raises ValueError where these do not go
    together.
    """

    def mark(function: Callable[[Any, Mapping[str, Any]], None]) -> Any:
        vars(function)["checks"] = names
        return staticmethod(function)

    return mark


def _checks_of(of: type[Description], name: str) -> Iterator[Callable[[Any, Mapping[str, Any]], None]]:
    for each in reversed(of.__mro__):
        for value in vars(each).values():
            if isinstance(value, staticmethod) and name in getattr(value.__func__, "checks", ()):
                yield value.__func__


def _checked(function: Callable[[Any, Mapping[str, Any]], None], value: Any, info: Any) -> Any:
    function(value, info.data)
    return value

"""Formula: computed from `frame` and `time` [s] with + - * / **, sin, cos, sqrt, min, max, mod and others."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Tag

from illumcli.scene.curves._base import Curve, ReadFile, rounded
from illumcli.scene.curves._formula import FrameFormula, formula_at
from illumcli.scene.frames import Moment
from illumcli.schema.fields import ListOf, Number


def _kind(value: Any) -> str:
    return "list" if isinstance(value, list | tuple) else "formula" if isinstance(value, str) else "number"


NumberOrFormula: TypeAlias = Annotated[
    Annotated[FrameFormula, Tag("formula")] | Annotated[Number, Tag("number")],
    Discriminator(lambda value: "formula" if isinstance(value, str) else "number"),
]
FormulaValue: TypeAlias = Annotated[
    Annotated[FrameFormula, Tag("formula")]
    | Annotated[Number, Tag("number")]
    | Annotated[ListOf[NumberOrFormula], Tag("list")],
    Discriminator(_kind),
]


class FormulaCurve(Curve):
    curve: Literal["formula"]
    value: FormulaValue
    """A formula as text, or a list of formulas and numbers; `time` is frame / fps."""

    def value_at(self, moment: Moment, read: ReadFile) -> Any:
        def at(value: Any) -> Any:
            if isinstance(value, tuple):
                return [at(part) for part in value]
            return formula_at(value, moment) if isinstance(value, str) else rounded(value)

        return at(self.value)

"""Formula: computed from `frame` and `time` [s] with + - * / **, sin, cos, sqrt, min, max, mod and others."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Tag

from illumcli.scene.curves._base import Over, ReadFile, rounded
from illumcli.scene.curves._formula import FrameFormula, formula_at
from illumcli.scene.curves._mapped import MappedCurve
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


class FormulaCurve(MappedCurve):
    curve: Literal["formula"]
    value: FormulaValue
    """A formula as text, or a list of formulas and numbers; `time` is frame / fps."""
    over: Over = "frame"
    """What `rate` and `delay` are applied to. `frame`: frames. `time`: seconds."""

    def axis(self, read: ReadFile) -> Over:
        return self.over

    def phi_at(self, moment: Moment, read: ReadFile) -> Any:
        def at(value: Any) -> Any:
            if isinstance(value, tuple):
                return [at(part) for part in value]
            return formula_at(value, moment) if isinstance(value, str) else rounded(value)

        return at(self.value)

    def phi(self, moment: Moment, read: ReadFile) -> dict[str, Any]:
        parts = self.value if isinstance(self.value, tuple) else (self.value,)
        if len(parts) not in (1, 3):
            raise ValueError("must be one or three formulas, to vary over the surface")
        texts = [part if isinstance(part, str) else repr(part) for part in parts]
        return {"formulas": texts, "over": self.over, "fps": moment.fps}

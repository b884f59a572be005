"""Formula: a model of your own, as an expression over cosines, sines and parameters that you name.

response = the value of `response`, of each colour channel by itself, plus that of `specular`

The formula is evaluated in double precision, whatever the precision of the terms. Values that are negative or
not finite become 0, and the report counts them. Ambient light is reflected by the parameter `diffuse`, if
there is one, or by `ambient`.

Terms, each clipped to its range. n is the normal, l the direction to the light, v to the eye, h the unit
vector half way between them, s = l + v, r the mirrored l, t the tangent along the grain, b = n x t:

    n_l, n_v        0 to 1    cosine at the light; at the eye
    n_h, v_h        0 to 1    cosine between normal and h; between eye and h, or light and h
    l_v             -1 to 1   cosine between light and eye
    gap_nh, gap_rv  0 to 2    1 - n.h and 1 - r.v, accurate where the cosine is near 1: Phong's lobe is
                              max(0, 1 - gap_rv)**exponent
    sin_l, sin_v    0 to 1    sine at the light; at the eye
    sin2_h          0 to 1    squared sine between normal and h: tan^2 is sin2_h / n_h**2
    sin_theta_d     0 to 1    sine between light and h
    cos_phi         -1 to 1   cosine of the azimuth between light and eye
    n_s, s_s        0 to 2, 0 to 4    n.s = n_l + n_v, and s.s
    t_l, t_v, b_l, b_v        -1 to 1   components of l and v along and across the grain
    t_s, b_s        -2 to 2   components of s: (t.h) / (n.h) is t_s / n_s
    sin_tl, sin_tv  0 to 1    sine between tangent and light; and eye

Operators are + - * / ** and parentheses; functions are sin, cos, tan, sinh, cosh, tanh, exp, log, sqrt, abs,
atan2, mod, min and max; constants are pi and e. A formula has at most 1000 characters.

References
----------
Cook, R. L. (1984). Shade trees. SIGGRAPH '84: expressions over such terms, given with the scene.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from keyword import iskeyword
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator

from illumcli.arrays import Floats, Vectors
from illumcli.formula import CONSTANTS, FUNCTIONS, MAX_LENGTH, Formula, parse
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._parameters import Varying
from illumcli.records import Value
from illumcli.schema.description import DEFAULTS
from illumcli.schema.fields import SRGB, ListOf, Number, Shorthand, Triple, color
from illumcli.schema.messages import short, suggestion

SCALARS: dict[str, tuple[float, float]] = {
    "n_l": (0, 1),
    "n_v": (0, 1),
    "n_h": (0, 1),
    "v_h": (0, 1),
    "l_v": (-1, 1),
    "gap_nh": (0, 2),
    "gap_rv": (0, 2),
    "sin_l": (0, 1),
    "sin_v": (0, 1),
    "sin2_h": (0, 1),
    "sin_theta_d": (0, 1),
    "cos_phi": (-1, 1),
    "n_s": (0, 2),
    "s_s": (0, 4),
    "t_l": (-1, 1),
    "t_v": (-1, 1),
    "b_l": (-1, 1),
    "b_v": (-1, 1),
    "t_s": (-2, 2),
    "b_s": (-2, 2),
    "sin_tl": (0, 1),
    "sin_tv": (0, 1),
}
"""The terms of `shading.terms` that are numbers, and their ranges, which rounding leaves by some bits."""
OF_GRAIN = frozenset({"t_l", "t_v", "b_l", "b_v", "t_s", "b_s", "sin_tl", "sin_tv"})
"""The terms that depend on the tangent."""

Quantity: TypeAlias = Annotated[Triple[Number], Shorthand(color, SRGB)]
"""A number or a colour: three numbers, equal ones for a number."""
Text: TypeAlias = Annotated[str, Field(max_length=MAX_LENGTH)]


def _identifier(text: str) -> str:
    if not re.fullmatch(IDENTIFIER, text):
        raise ValueError(f"'{short(text)}' is no name in a formula; use letters, digits and _")
    if iskeyword(text):
        raise ValueError(f"'{text}' is a reserved word; choose another name, such as {text}_")
    if text in SCALARS or text in CONSTANTS or text in FUNCTIONS:
        raise ValueError(f"'{text}' is a term, constant or function of formulas; choose another name")
    return text


IDENTIFIER = r"^[A-Za-z_][A-Za-z0-9_]*$"
Identifier: TypeAlias = Annotated[
    str, AfterValidator(_identifier), Field(json_schema_extra={"pattern": IDENTIFIER})
]


class FormulaLobe(Value):
    """A lobe whose value is that of a formula; `needs` are the terms that it is called with."""

    formula: Formula
    parameters: Mapping[str, Any]
    """Name -> a colour, or (N, 3) colours if it varies."""

    @property
    def __name__(self) -> str:
        return self.formula.text

    @property
    def needs(self) -> tuple[str, ...]:
        """The terms of the formula, and n_l, whose length and precision are those of the result."""
        return tuple(dict.fromkeys(["n_l", *(name for name in self.formula.names if name in SCALARS)]))

    def __call__(self, **terms: Floats) -> Vectors:
        """(N, 3) the value of each channel in the precision of the terms; it may be any number, or none."""
        like = terms["n_l"]
        names = self.formula.names
        values = [self._value(name, terms) if name in names else 0.0 for name in self.formula.variables]
        with np.errstate(over="ignore"):
            channels = np.broadcast_to(self.formula.value(*values), (3, len(like))).astype(like.dtype, "C")
        return channels.T

    def _value(self, name: str, terms: Mapping[str, Floats]) -> NDArray[Any]:
        """(N,) a term; or a parameter: one number for equal channels, (3, 1), or (3, N) if it varies."""
        if name not in self.parameters:
            return np.clip(terms[name], *SCALARS[name])
        values = np.asarray(self.parameters[name], np.float64)
        if values.ndim == 2:
            return values.T
        return values[0] if len(set(values.tolist())) == 1 else values[:, None]


@lru_cache(256)
def _parsed(text: str, names: tuple[str, ...]) -> Formula:
    return parse(text, (*names, *SCALARS))


class FormulaModel(IlluminationModel):
    model: Literal["formula"] = "formula"
    parameters: dict[Identifier, Varying[Quantity]] = DEFAULTS
    """Numbers, colours, textures and vertex attributes by names of your own; a number is three equal ones."""
    response: Text
    """Light towards the eye per unit of irradiance facing the light, its cosine n_l included. The layer
    `diffuse` has it."""
    specular: Text | None = None
    """A second formula, which is added; the layer `specular` has it."""
    claims: ListOf[Literal["reciprocal", "conserving"]] = ()
    """What `illum verify SCENE` checks at random directions. `reciprocal`: light and eye may change places.
    `conserving`: no more light leaves than arrives."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {}
    isotropic: ClassVar[bool] = False

    @field_validator("response", "specular")
    @classmethod
    def _is_formula(cls, text: str | None, info: ValidationInfo) -> str | None:
        if text is not None and "parameters" in info.data:
            _parsed(text, tuple(info.data["parameters"]))
        return text

    @model_validator(mode="after")
    def _has_no_idle_parameter(self) -> Self:
        used = {name for formula in self._formulas().values() for name in formula.names}
        idle = [name for name in self.parameters if name not in used and name != "diffuse"]
        if idle:
            others = tuple(name for name in self.parameters if name in used)
            advice = f"; {suggestion(idle[0], others)}" if others else ""
            faults = [ValueError(f"is in no formula{advice}") for _ in idle]
            raise ValidationError.from_exception_data(
                "formula",
                [
                    {
                        "type": "value_error",
                        "loc": ("parameters", name),
                        "input": None,
                        "ctx": {"error": fault},
                    }
                    for name, fault in zip(idle, faults, strict=True)
                ],
            )
        return self

    def _formulas(self) -> dict[str, Formula]:
        names, texts = tuple(self.parameters), {"diffuse": self.response, "specular": self.specular}
        return {lobe: _parsed(text, names) for lobe, text in texts.items() if text is not None}

    def lobes(self) -> dict[str, Lobe]:
        """The formulas, `response` as `diffuse`."""
        return {name: FormulaLobe(formula, self.parameters) for name, formula in self._formulas().items()}

    def has_grain(self) -> bool:
        """True if a formula has a term of the tangent."""
        return any(OF_GRAIN.intersection(formula.names) for formula in self._formulas().values())

    def claimed(self) -> frozenset[str]:
        """The claims of the scene; isotropic without a term of the tangent."""
        return frozenset((*self.claims, *(() if self.has_grain() else ("isotropic",))))

    def diffuse_color(self) -> Any:
        """The parameter `diffuse`; black if there is none."""
        return self.parameters.get("diffuse", (0.0, 0.0, 0.0))

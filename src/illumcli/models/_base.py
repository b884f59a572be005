"""What every illumination model is: frozen parameters, lobes as functions of named terms, claims."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from illumcli.models._parameters import Texture, Varying, VertexValues
from illumcli.schema.description import Description
from illumcli.schema.fields import Color

Lobe = Callable[..., Any]
D = TypeVar("D", bound=Description)


class IlluminationModel(Description):
    """Parameters of a local illumination model and its response to one light.

    A model has up to two lobes, the methods `diffuse_lobe` and `specular_lobe`. Their parameter names are
    the terms they need (`shading.terms`); each returns the light leaving towards the eye per unit of
    irradiance facing the light, the cosine included, as (N, 3) in the precision of the lanes. Lanes that
    face away from the light never reach a model. A field read inside a lobe is a number or a colour, or,
    where the parameter varies over the surface, one value per lane: (N,) or (N, 3), put there by `at`.

    Claims hold for every value of the numbers, at the default of each choice (a word, a flag, an option
    left out); the shared tests check every claim.
    """

    emission: Varying[Color] = (0.0, 0.0, 0.0)
    """L_e, light the surface emits by itself [W/(m^2 sr)]."""
    ambient: Varying[Color] | None = None
    """k_a, the share of ambient light that leaves towards the eye; by default what the model reflects
    diffusely."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {
        "diffuse_lobe": ("diffuse",),
        "specular_lobe": ("specular",),
    }
    """Per lobe, the parameters of which a single zero makes the lobe vanish: it is skipped then."""
    reciprocal: ClassVar[bool] = False
    """Claim: response / n_l keeps its value when light and eye change places."""
    conserving: ClassVar[bool] = False
    """Claim: with every parameter in range, no more light leaves than arrives."""
    isotropic: ClassVar[bool] = True
    """Claim: turning the surface about its normal changes nothing."""
    physical: ClassVar[bool] = False
    """True where the response is a BRDF times the cosine; False for the intensity models of the
    texts, whose numbers have no radiometric unit."""

    def lobes(self) -> dict[str, Lobe]:
        """The lobes that are not black by their parameters, by name (`diffuse`, `specular`)."""
        return {
            method.removesuffix("_lobe"): getattr(self, method)
            for method in ("diffuse_lobe", "specular_lobe")
            if hasattr(self, method) and not any(self._is_zero(name) for name in self.scales.get(method, ()))
        }

    def ambient_color(self) -> Any:
        """k_a: the field `ambient`, or what the model reflects diffusely."""
        return self.diffuse_color() if self.ambient is None else self.ambient

    def has_grain(self) -> bool:
        """Does turning the surface about its normal change anything, with these parameters?"""
        return not self.isotropic

    def diffuse_color(self) -> Any:
        """The diffuse albedo; a model whose parameter is not called `diffuse` says what it is."""
        return getattr(self, "diffuse", (0.0, 0.0, 0.0))

    def varying(self) -> dict[str, Texture | VertexValues]:
        """The parameters that vary over the surface, by path: `specular`, or `distribution.m`."""
        return dict(_varying(self))

    def at(self, values: Mapping[str, Any]) -> Self:
        """This model with arrays in place of parameters, by path; nothing is validated again.

        Parameters
        ----------
        values : mapping
            Path, as `varying` names it -> (N,) numbers or (N, 3) colours, one per lane.
        """
        return _replace_parameters(self, values)

    def _is_zero(self, name: str) -> bool:
        value = getattr(self, name)
        return value is not None and not isinstance(value, Texture | VertexValues) and not np.any(value)


def _varying(part: Description, prefix: str = "") -> Iterator[tuple[str, Texture | VertexValues]]:
    for name, value in part:
        if isinstance(value, Texture | VertexValues):
            yield prefix + name, value
        elif isinstance(value, Description):
            yield from _varying(value, f"{prefix}{name}.")


def _replace_parameters(part: D, values: Mapping[str, Any]) -> D:
    changes = {path: value for path, value in values.items() if "." not in path}
    for name in {path.partition(".")[0] for path in values if "." in path}:
        inner = {
            path.removeprefix(f"{name}."): v for path, v in values.items() if path.startswith(f"{name}.")
        }
        changes[name] = _replace_parameters(getattr(part, name), inner)
    return part.model_copy(update=changes)

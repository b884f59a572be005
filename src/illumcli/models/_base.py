"""Base of all illumination models: frozen parameters, lobes as functions of named terms, tested claims."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError, model_validator

from illumcli.models._parameters import CurveOverSurface, OverSurface, Varying
from illumcli.schema.annotations import annotation_at, number_range
from illumcli.schema.description import Description, nested, parts_of
from illumcli.schema.fields import Color

Lobe = Callable[..., Any]
CLAIMS = {
    "physical": "a BRDF times the cosine",
    "reciprocal": "light and eye may change places",
    "conserving": "no more light leaves than arrives",
    "isotropic": "turning the surface about its normal changes nothing",
}
"""What models may claim, and what it means."""
LOBES = ("diffuse_lobe", "specular_lobe")
"""The methods that are lobes."""


class IlluminationModel(Description):
    """Parameters of a local illumination model and its response to one light.

    A model has up to two lobes, the methods `diffuse_lobe` and `specular_lobe`. Their parameter names are the
    terms that they need (`shading.terms`), arrays over N points. Each returns the radiance towards the eye
    per unit of irradiance on a surface that faces the light, the cosine included, (N, 3) in the precision of
    the terms. Models are never evaluated at points that face away from the light. A field that a lobe reads
    is a number or a colour, or, if the parameter varies over the surface, one value per point, (N,) or (N,
    3), which `at` puts there.

    Claims hold for all values of the numeric parameters, with each choice (a word, a flag, an optional
    parameter) at its default; the shared tests check every claim.
    """

    emission: Varying[Color] = (0.0, 0.0, 0.0)
    """L_e, radiance that the surface emits [W/(m^2 sr)]."""
    ambient: Varying[Color] | None = None
    """k_a, the share of ambient light that is reflected towards the eye; by default the diffuse albedo."""

    surface_color: ClassVar[str] = "diffuse"
    """The parameter that is the surface's colour, which a mesh's vertex colours take the place of."""
    scales: ClassVar[dict[str, tuple[str, ...]]] = {
        "diffuse_lobe": ("diffuse",),
        "specular_lobe": ("specular",),
    }
    """For each lobe, the parameters that are its factors, if the model has them: if one is 0, the lobe is not
    evaluated."""
    reciprocal: ClassVar[bool] = False
    """Claim: response / n_l does not change if light and eye are exchanged."""
    conserving: ClassVar[bool] = False
    """Claim: with all parameters in range, no more light is reflected than is incident."""
    isotropic: ClassVar[bool] = True
    """Claim: rotating the surface about its normal changes nothing."""
    physical: ClassVar[bool] = False
    """True if the response is a BRDF times the cosine; False for intensity models, which have no
    radiometric units."""

    @classmethod
    def faults_of_class(cls) -> list[str]:
        """What keeps a class of somebody else from being a model."""
        scales = [name for names in vars(cls).get("scales", {}).values() for name in names]
        faults = [
            f"class {cls.__name__}: scales name '{name}', which is no parameter"
            for name in scales
            if name not in cls.model_fields
        ]
        if cls.lobes is IlluminationModel.lobes and not any(hasattr(cls, method) for method in LOBES):
            faults.append(f"class {cls.__name__} has no lobe; define {' or '.join(LOBES)}")
        return faults

    @model_validator(mode="after")
    def _curves_fit(self) -> Self:
        """Refuse curves of colours for parameters that are numbers."""
        for path, value in self.varying().items():
            if not isinstance(value, CurveOverSurface):
                continue
            wide = number_range(annotation_at(self, path)).width
            if value.phi.width not in (1, wide):
                error = ValueError(f"must be one number, its curve has {value.phi.width}")
                fault: Any = {"type": "value_error", "loc": tuple(path.split(".")), "input": value}
                raise ValidationError.from_exception_data(path, [fault | {"ctx": {"error": error}}])
        return self

    def lobes(self) -> dict[str, Lobe]:
        """The lobes by name (`diffuse`, `specular`), without those that a parameter makes black."""
        return {
            method.removesuffix("_lobe"): getattr(self, method)
            for method in LOBES
            if hasattr(self, method)
            and not any(self._is_always(name, 0) for name in self.scales.get(method, ()))
        }

    def claimed(self) -> frozenset[str]:
        """The claims that hold for this material."""
        return frozenset(name for name in CLAIMS if getattr(self, name))

    def ambient_color(self) -> Any:
        """k_a: the field `ambient`, or what the model reflects diffusely."""
        return self.diffuse_color() if self.ambient is None else self.ambient

    def has_grain(self) -> bool:
        """True if, with these parameters, rotating the surface about its normal changes its look."""
        return not self.isotropic

    def diffuse_color(self) -> Any:
        """What reflects ambient light: the surface colour, unless a model defines it otherwise."""
        return getattr(self, self.surface_color, (0.0, 0.0, 0.0))

    def varying(self) -> dict[str, OverSurface]:
        """The parameters that vary over the surface, by path: `specular`, or `distribution.m`."""
        return {path: value for path, value in _parts(self) if isinstance(value, OverSurface)}

    def files(self) -> dict[str, str]:
        """The files that lobes read, by the path of the parameter that names each: `distribution.file`."""
        return {
            path: value
            for path, value in _parts(self)
            if path.split(".")[-1] == "file" and isinstance(value, str)
        }

    def prepared(self, read: Callable[[str], NDArray[np.float32]]) -> Self:
        """This model with what its lobes need beforehand, as tables; by default the model itself.

        Parameters
        ----------
        read : callable
            Path of an image -> (H, W, 3) its numbers as stored, the top row first; black where transparent.

        Raises
        ------
        InputError
            A file that cannot be used.
        """
        return self

    def repairs(self) -> dict[str, int]:
        """What was put right or is uncertain in the files of a prepared model: kind -> how often."""
        return {}

    def at(self, values: Mapping[str, Any]) -> Self:
        """This model with arrays in place of parameters, by path, without validation.

        Parameters
        ----------
        values : mapping
            Path, as in `varying` -> (N,) numbers or (N, 3) colours, one per point.
        """
        replaced: Self = _replace_parameters(self, values)
        return replaced

    def _is_always(self, name: str, number: float) -> bool:
        """True if a parameter has this value everywhere, in all channels; False if the model has none."""
        return is_always(getattr(self, name, None), number)


def is_always(value: Any, number: float) -> bool:
    """True for this number, or a colour of it in all channels; False for what varies and what is left out."""
    return value is not None and not isinstance(value, Description) and bool(np.all(np.equal(value, number)))


def _parts(part: Description | Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """All parameters and the parameters of their descriptions, by path."""
    for name, value in parts_of(part):
        inner = {} if isinstance(value, OverSurface) else nested(value)
        if not inner:
            yield prefix + name, value
        for step, each in inner.items():
            yield from _parts(each, f"{prefix}{name}{step}.")


def _replace_parameters(part: Any, values: Mapping[str, Any]) -> Any:
    changes = {path: value for path, value in values.items() if "." not in path}
    for name in {path.partition(".")[0] for path in values if "." in path}:
        whole = getattr(part, name)
        inner = {
            step: _replace_parameters(each, _below(f"{name}{step}.", values))
            for step, each in nested(whole).items()
        }
        changes[name] = inner[""] if "" in inner else tuple(inner.values())
    return {**part, **changes} if isinstance(part, Mapping) else part.model_copy(update=changes)


def _below(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """The values whose path begins with `prefix`, by the rest of it."""
    return {path.removeprefix(prefix): value for path, value in values.items() if path.startswith(prefix)}

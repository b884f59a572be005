"""Base of all falloffs: mu(d), 0 for an occluder at contact, 1 for one out of reach."""

from __future__ import annotations

import re
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import AfterValidator, Discriminator, Field, Tag

from illumcli.arrays import Floats
from illumcli.schema.description import Description
from illumcli.schema.fields import LARGEST, Positive


def _radii(text: str) -> str:
    share = re.fullmatch(RADII, text)
    if not share or not 0 < float(share[1]) <= LARGEST:
        raise ValueError(
            f"must be a distance above 0, or a share of the radius such as '0.5r', is text {text!r}"
        )
    return text


RADII = r"([0-9]+\.?[0-9]*(?:[eE][-+]?[0-9]{1,3})?)r"
Radii: TypeAlias = Annotated[str, AfterValidator(_radii), Field(json_schema_extra={"pattern": f"^{RADII}$"})]
Distance: TypeAlias = Annotated[
    Annotated[Positive, Tag("units")] | Annotated[Radii, Tag("radii")],
    Discriminator(lambda value: "radii" if isinstance(value, str) else "units"),
]


class Falloff(Description):
    """mu(d) in [0, 1], not decreasing, mu(0) = 0 and mu(d) = 1 from `reach` on."""

    max_distance: Distance | None = None
    """d_max, from which an occluder no longer counts: scene units, or `0.5r` for half the scene's radius;
    by default any distance counts."""

    step: ClassVar[bool] = False
    """True if mu is a step function: an occlusion query is enough, the distance is not needed."""

    def reach(self, radius: float) -> float:
        """d_max in scene units; inf without a limit."""
        limit = self.max_distance
        if limit is None:
            return float("inf")
        return float(limit[:-1]) * radius if isinstance(limit, str) else limit

    def weight(self, distance: Floats, reach: float, radius: float) -> Any:
        """(N,) mu at `distance` [scene units], which is inf where nothing was hit."""
        raise NotImplementedError

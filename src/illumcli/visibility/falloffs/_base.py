"""What every falloff is: the weight mu of an occluder by its distance, 0 at contact, 1 out of reach."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from illumcli.arrays import Lanes
from illumcli.description import Description, Positive

Distance = Positive | Annotated[str, Field(pattern=r"^[0-9.]+([eE][-+]?[0-9]+)?r$")]


class Falloff(Description):
    """mu(d) in [0, 1], not decreasing, mu(0) = 0 and mu(d) = 1 from `reach` on."""

    max_distance: Distance | None = None
    """d_max, from which an occluder no longer counts: scene units, or `0.5r` for half the scene's radius;
    by default any distance counts."""

    step: ClassVar[bool] = False
    """True where mu is a step: an any-hit query answers, the distance is not needed."""

    def reach(self, radius: float) -> float:
        """d_max in scene units; inf without a limit."""
        limit = self.max_distance
        if limit is None:
            return float("inf")
        return float(limit[:-1]) * radius if isinstance(limit, str) else limit

    def weight(self, distance: Lanes, reach: float, radius: float) -> Any:
        """(N,) mu at `distance` [scene units], which is inf where nothing was hit."""
        raise NotImplementedError

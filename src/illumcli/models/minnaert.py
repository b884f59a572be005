"""Minnaert: diffuse reflection with limb darkening or brightening, devised for the Moon.

response = n_l * rho * (k + 1) / (2 pi) * (n_l n_v)^(k - 1)

A BRDF times the cosine, reciprocal. k = 1 is Lambert; below 1 the limb is brighter and the model unbounded at
grazing, above 1 it is darker. The albedo is exactly rho for an eye on the normal, and differs elsewhere.

References
----------
Minnaert, M. (1941). The reciprocity principle in lunar photometry. Astrophysical Journal 93.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo


class Minnaert(IlluminationModel):
    model: Literal["minnaert"] = "minnaert"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo seen from the normal."""
    k: Varying[Annotated[float, Field(ge=0, le=10)]] = 0.7
    """k, limb darkening: 0.5 the flat disc of the full Moon, 1 Lambert, 2 a dark rim."""

    reciprocal: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats, n_v: Floats) -> Vectors:
        """(N, 3) rho (k + 1) / (2 pi) n_l^k n_v^(k - 1)."""
        (k,) = as_dtype_of(n_l, self.k)
        shape = np.exp(k * np.log(n_l) + (k - 1) * np.log(n_v))
        return tint(self.diffuse, shape * ((k + 1) / (2 * np.pi)))

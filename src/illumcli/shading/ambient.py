"""Light that needs no lamp: emission, and the ambient light weighed by obscurance."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import F, Floats, Vectors


def ambient_light(
    ambient_color: Vectors, light: tuple[float, float, float], obscurance: Floats | None
) -> Vectors:
    """(M, 3) k_a I_a w; w is 1 where no obscurance is asked for."""
    out = ambient_color * np.asarray(light, F)
    return out if obscurance is None else out * obscurance[:, None]


def coupled(
    ambient_color: Vectors, light: tuple[float, float, float], direct: Vectors, irradiance: Vectors, w: Floats
) -> Vectors:
    """(M, 3) (k_a I_a + direct) w + I_d, as one text prints it (Theoharis et al. 2008, eq. 12.75).

    `direct` is the material's response to all lights, `irradiance` (I_d) the light that arrives, its cosine
    included; direct light counts twice, once with and once without the material.
    """
    return (ambient_color * np.asarray(light, F) + direct) * w[:, None] + irradiance

"""Light that no lamp of the scene sends: emission, and ambient light times obscurance."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import F, Floats, Vectors
from illumcli.shading.rates import ShadingPoints
from illumcli.shading.textures import PointMaterials


def ambient_color(materials: PointMaterials, points: ShadingPoints) -> Vectors:
    """(M, 3) k_a at the samples."""
    return points.to_samples(materials.colors(lambda model: model.ambient_color()))


def emission(materials: PointMaterials, points: ShadingPoints) -> Vectors:
    """(M, 3) L_e at the samples."""
    return points.to_samples(materials.colors(lambda model: model.emission))


def ambient(
    color: tuple[float, float, float], ambient_color: Vectors, obscurance: Floats | None = None
) -> Vectors:
    """(M, 3) k_a I_a w; w is 1 if no obscurance is given."""
    out = ambient_color * np.asarray(color, F)
    return out if obscurance is None else out * obscurance[:, None]


def coupled(
    color: tuple[float, float, float],
    ambient_color: Vectors,
    direct: Vectors,
    irradiance: Vectors,
    obscurance: Floats | None = None,
) -> Vectors:
    """(M, 3) (k_a I_a + direct) w + I_d, as printed by Theoharis et al. (2008), eq. 12.75.

    `direct` is the material's response to all lights, `irradiance` (I_d) that of all lights on the surface.
    Direct light therefore counts twice, once with and once without the material.
    """
    out = ambient_color * np.asarray(color, F) + direct
    return (out if obscurance is None else out * obscurance[:, None]) + irradiance

"""Reflectance of mirror facets by the words of the command line."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import Floats
from illumcli.errors import InputError
from illumcli.gonioreflectometer.mirrors import Fresnel
from illumcli.models._fresnel import MATERIALS, dielectric, schlick


def fresnel_of(word: str | None) -> Fresnel:
    """The reflectance of a material by name (Schlick's curve), or of a dielectric by its index; 1 without.

    Raises
    ------
    InputError
        Neither.
    """
    if word is None:
        return lambda c: np.ones((3, *c.shape))
    if word in MATERIALS:
        f0 = np.array(MATERIALS[word])[:, None]
        return lambda c: schlick(c, f0)
    try:
        index = float(word)
    except ValueError:
        index = 0.0
    if not 1 <= index <= 100:
        known = ", ".join(MATERIALS)
        raise InputError(f"--fresnel {word}: is no material; write an index from 1 to 100, or one of {known}")

    def of_index(c: Floats) -> Floats:
        return np.broadcast_to(dielectric(c, np.array(index)), (3, *c.shape))

    return of_index

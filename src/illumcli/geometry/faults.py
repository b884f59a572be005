"""What is wrong with a mesh and can be lived with, counted per class, and where each class occurs first.

Indices that name no vertex and coordinates that are not finite never get here: the readers refuse them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.normals import area_vectors
from illumcli.records import Value


class Fault(Value):
    """One class of faults of one mesh."""

    what: str
    count: int
    first: str | None
    """Where it occurs first, numbered from 1; None where the reader did not say."""


def faults(mesh: Mesh) -> list[Fault]:
    """What readers put right, then what rendering lives with.

    Faces without area are never hit, zero normals are replaced by computed ones, unused vertices count for
    nothing, not even for the scene's size.
    """
    used = np.zeros(len(mesh.vertices), np.bool_)
    used[mesh.corners] = True
    vectors = area_vectors(mesh)
    found = [
        *(Fault(what, count, None) for what, count in mesh.repairs.items()),
        _fault("unused vertices", "vertex", ~used),
        _fault("faces without area", "face", ~np.any(vectors, axis=1)),
    ]
    if mesh.normals is not None:
        sound = np.isfinite(mesh.normals).all(axis=1) & np.any(mesh.normals, axis=1)
        found.append(_fault("normals not finite or of no length", "normal", ~sound))
    by_class = {
        fault.what: fault for fault in found if fault.count
    }  # one that a reader counted too counts once
    return list(by_class.values())


def _fault(what: str, part: str, wrong: NDArray[np.bool_]) -> Fault:
    count = int(np.count_nonzero(wrong))
    return Fault(what, count, f"{part} {int(np.argmax(wrong)) + 1}" if count else None)

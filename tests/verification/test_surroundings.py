"""The geometry of the obscurance cases against their closed forms, by a ray caster of its own in float64."""

from __future__ import annotations

import json
import lzma

import numpy as np
import pytest

from illumcli.verification import PACKAGED
from illumcli.verification.inputs import Inputs
from illumcli.verification.obscurance import exponential
from illumcli.verification.surroundings import GEOMETRIES, surroundings
from illumcli.visibility.falloffs.step import Step

ENTRIES = json.loads(lzma.decompress((PACKAGED / "textbook.json.xz").read_bytes()))
RAYS = 600


def directions(count):
    """Cosine-weighted directions about +z: a golden-angle spiral on the disc."""
    i = np.arange(count)
    r2, angle = (i + 0.5) / count, 2 * np.pi * ((i * 0.6180339887498949) % 1)
    return np.stack([np.sqrt(r2) * np.cos(angle), np.sqrt(r2) * np.sin(angle), np.sqrt(1 - r2)], axis=1)


def distances(around, rays):
    """Distance from the receiver to the nearest triangle along each ray (Moeller and Trumbore 1997)."""
    v0, v1, v2 = (around.vertices[around.triangles[:, k]] for k in range(3))
    e1, e2, start = v1 - v0, v2 - v0, [0, 0, 1e-9 * around.size] - v0
    q = np.cross(start, e1)
    out = np.full(len(rays), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, d in enumerate(rays):
            p = np.cross(d, e2)
            det = np.einsum("ij,ij->i", e1, p)
            u, v = np.einsum("ij,ij->i", start, p) / det, q @ d / det
            far = np.einsum("ij,ij->i", e2, q) / det
            hit = (u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12) & (far > 0)
            out[k] = far[hit].min(initial=np.inf)
    return out


def cases():
    """One case of every geometry and kind of falloff, half open if possible."""
    taken = {}
    for entry in ENTRIES:
        if entry["model"] in ("ao_visible", "ao_dmax", "obscurance"):
            kind = (entry["model"], entry["inputs"]["geometry"], entry["inputs"].get("d_max") is None)
            taken.setdefault(kind, []).append(entry)
    return [min(group, key=lambda entry: abs(entry["expected"] - 0.5)) for group in taken.values()]


@pytest.mark.parametrize("entry", cases(), ids=lambda entry: entry["id"])
def test_geometry_has_the_obscurance_of_its_closed_form(entry):
    inputs = Inputs("here", entry["id"], entry["inputs"])
    falloffs = {
        "ao_visible": lambda: Step(),
        "ao_dmax": lambda: Step(max_distance=inputs.number("d_max")),
        "obscurance": lambda: exponential(inputs),
    }
    falloff = falloffs[entry["model"]]()
    around = surroundings(inputs)
    rays = directions(RAYS if len(around.triangles) < 2000 else RAYS // 3)
    w = falloff.weight(distances(around, rays), falloff.reach(1.0), 1.0).mean()
    # a spiral of N rays resolves a hard edge to about 1 / N^0.75
    assert abs(w - entry["expected"]) < 2 * len(rays) ** -0.75


def test_every_geometry_is_covered():
    assert {entry["inputs"]["geometry"] for entry in cases()} == set(GEOMETRIES)

"""Evaluators of the obscurance cases: falloffs, and the Monte Carlo estimator against closed forms.

A closed form is built as real geometry and estimated at its receiver by the same code that shades pixels. The
estimate is compared by its own standard error, from independent turns of the sample pattern.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from illumcli.arrays import F, Floats, column_major
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes
from illumcli.rays.embree import tracer
from illumcli.rays.offsets import offset_ray_origins
from illumcli.rays.sampling import hashed, stream, unit_interval
from illumcli.verification.inputs import Inputs
from illumcli.verification.outcome import Estimate
from illumcli.verification.surroundings import Surroundings, surroundings
from illumcli.visibility.falloffs._base import Falloff
from illumcli.visibility.falloffs.exponential import Exponential
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.obscurance import Method, estimates

PATTERNS = 128
RAYS = 256
"""Rays per pattern."""
RESOLUTION = 1 / (64 * RAYS)
"""Least standard error of an estimate, since the 16 phases of a pattern resolve r^2 to 1 / (32 RAYS)."""


def exponential(inputs: Inputs) -> Exponential:
    """mu of a case, with or without a range limit."""
    return Exponential(
        falloff="exponential", tau=inputs.number("tau"), max_distance=inputs.number_or_none("d_max")
    )


def mu(inputs: Inputs) -> Floats:
    falloff = exponential(inputs)
    return falloff.weight(inputs.scalars("x"), falloff.reach(1.0), 1.0)


def ao_visible(inputs: Inputs) -> Estimate:
    """All hits occlude."""
    return estimate(surroundings(inputs), Step(), inputs.id)


def ao_dmax(inputs: Inputs) -> Estimate:
    """Hits nearer than d_max occlude."""
    return estimate(surroundings(inputs), Step(max_distance=inputs.number("d_max")), inputs.id)


def obscured(inputs: Inputs) -> Estimate:
    """Hits are weighted by distance."""
    return estimate(surroundings(inputs), exponential(inputs), inputs.id)


def estimate(around: Surroundings, falloff: Falloff, purpose: str) -> Estimate:
    """w at the receiver, the mean over many rotations and phases of the pattern, and its standard error."""
    # A receiver for each pattern, all at the origin of the scene.
    geometry = place_meshes([Mesh.of_triangles(around.vertices, around.triangles)], [np.eye(4)])
    ng = column_major(np.tile([0.0, 0.0, 1.0], (PATTERNS, 1)), F)
    here = np.tile(geometry.render_space.from_world(np.zeros(3)), (PATTERNS, 1))
    corners = around.vertices[around.triangles[0]]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max() / geometry.render_space.radius
    origins = offset_ray_origins(here, ng, np.full(PATTERNS, edge))

    # A random rotation and phase for each pattern.
    number = np.arange(PATTERNS, dtype=np.uint32)
    draws = np.stack(
        [unit_interval(hashed(stream(0, f"{purpose} {what}"), number)) for what in ("turn", "phase")]
    )
    core = tracer(geometry)
    method = Method(RAYS, falloff, geometry.render_space.radius)
    w = estimates(core, Hemispheres(ng, origins), draws, method, errors=False).w.astype(np.float64)
    standard_error = float(w.std(ddof=1)) / np.sqrt(PATTERNS)
    return Estimate(float(w.mean()), float(np.hypot(standard_error, RESOLUTION)))


CAST: dict[str, Callable[[Inputs], Estimate]] = {
    "ao_visible": ao_visible,
    "ao_dmax": ao_dmax,
    "obscurance": obscured,
}
CASES: dict[str, Callable[[Inputs], Floats | Estimate]] = {"mu": mu, **CAST}

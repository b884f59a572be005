"""Obscurance w(p) by Monte Carlo; with a step falloff it is ambient occlusion.

Pixels, vertices and texels share this code. Standard errors are in `obscurance_error`, sample patterns in
`hemisphere`.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, repeat_rows, take_rows
from illumcli.geometry.instances import Instances
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.embree import Tracer
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.records import Record
from illumcli.render_space import RenderSpace
from illumcli.visibility.falloffs._base import Falloff
from illumcli.visibility.hemisphere import Hemispheres, hemisphere_rays
from illumcli.visibility.obscurance_error import Estimates
from illumcli.visibility.samplers import SAMPLERS

Faces: TypeAlias = Literal["count", "ignore", "one_sided"]

RAYS_AT_ONCE = 1 << 19
"""Rays per batch: so many that the arrays with a row per point cost little beside them."""
BEYOND = 1 + 2.0**-20
"""Length of rays whose distance counts, as a share of the reach: the weight of a miss is exactly 1."""
MAX_BACK_FACES = 64
"""Back faces in a row that a ray passes through if back faces are ignored."""


class Method(Record):
    """How w is estimated."""

    samples: int
    falloff: Falloff
    radius: float  # of the scene [scene units]
    sampler: str = "spiral"
    faces: Faces = "count"
    triangle_normals: Vectors | None = None  # (T, 3) float32; None if every face counts
    instances: Instances | None = None

    @property
    def any_hit(self) -> bool:
        """True if an occlusion query is enough and the distance is not needed."""
        return self.falloff.step and self.faces == "count"


class ObscuranceSettings(Protocol):
    """The part of a scene's obscurance settings that is used here (`scene.spec.Obscurance`)."""

    @property
    def samples(self) -> int: ...
    @property
    def falloff(self) -> Falloff: ...
    @property
    def sampler(self) -> str: ...
    @property
    def faces(self) -> Faces: ...


def obscurance_method(
    settings: ObscuranceSettings,
    render_space: RenderSpace,
    triangle_normals: Vectors | None = None,
    geometry: SceneGeometry | None = None,
) -> Method:
    """How a render estimates w; the last two inputs are given unless every face counts."""
    return Method(
        settings.samples,
        settings.falloff,
        render_space.radius,
        settings.sampler,
        settings.faces,
        triangle_normals,
        None if geometry is None else geometry.instances,
    )


def obscurance(
    tracer: Tracer,
    hemispheres: Hemispheres,
    obscurance_draws: NDArray[np.float64],
    obscurance_method: Method,
    baked_obscurance: Floats | None = None,
) -> NDArray[np.float32]:
    """(M,) w of every hit: baked values on meshes that have them, ray-traced estimates on the others.

    Parameters
    ----------
    obscurance_draws : (2, M) float64
        See `draws` of `estimates`.
    baked_obscurance : (M,) float32, optional
        NaN on meshes that have no baked values.
    """
    if baked_obscurance is None:
        return estimates(tracer, hemispheres, obscurance_draws, obscurance_method, errors=False).w
    w = baked_obscurance.astype(F)
    traced = np.flatnonzero(np.isnan(w))
    draws = obscurance_draws[:, traced]
    w[traced] = estimates(tracer, hemispheres.take(traced), draws, obscurance_method, errors=False).w
    return w


def baked_or_open(baked_obscurance: Floats) -> Floats:
    """(M,) baked w; 1 on meshes that have no baked values."""
    return np.where(np.isnan(baked_obscurance), F(1), baked_obscurance)


def estimates(
    tracer: Tracer,
    over: Hemispheres,
    draws: NDArray[np.float64],
    method: Method,
    bent: bool = False,
    errors: bool = True,
) -> Estimates:
    """w = 1/pi * integral of mu(d) cos(theta) over the hemisphere about the shading normal: 1 where open.

    A direction that points below the triangle it leaves is mirrored at that triangle's plane, so that no
    triangle occludes itself.

    The default sampler is a golden-angle spiral on the disc, with a random rotation and phase per point:
    unbiased for any count, and within 6 to 16 % of the least error that any point set can have on visibility.
    Every estimate depends on its own point alone.

    Parameters
    ----------
    draws : (2, M) float64
        In [0, 1): rotation and phase of each point's spiral, or the scramble of another sampler.
    bent : bool
        Also compute the bent normal, the mean unoccluded direction.
    errors : bool
        Also compute the variation between neighbouring rays, which `Errors` needs; otherwise it is 0.
    """
    count = len(over.n)
    w, variation = np.ones(count, F), np.zeros(count, F)
    bent_normal = np.array(over.n, F, order="F") if bent else None

    # Points that are known to be open cast no rays.
    unknown = None
    if over.known_open is not None and over.known_open.any():
        unknown = np.flatnonzero(~over.known_open)
    casting = count if unknown is None else len(unknown)

    at_once = max(1, RAYS_AT_ONCE // method.samples)
    for first in range(0, casting, at_once):
        # Trace the rays of a batch of points, and average over each point's rays.
        end = min(first + at_once, casting)
        points = slice(first, end) if unknown is None else unknown[first:end]
        batch = over.between(first, end) if unknown is None else over.take(unknown[first:end])
        rays = hemisphere_rays(batch, draws[:, points], method.samples, method.sampler)
        traced = openness(tracer, rays, method, each_ray=errors or bent, directions=bent)
        w[points] = traced.w
        if errors and traced.mu is not None:
            variation[points] = SAMPLERS[method.sampler].variation(traced.mu)
        if bent_normal is not None and traced.mu is not None and traced.directions is not None:
            bent_normal[points] = mean_open_direction(traced.directions, traced.mu, batch.n)
    return Estimates(w, variation, bent_normal, count - casting)


class Openness(Record):
    """What the rays of M points, N each, say about them."""

    w: NDArray[np.float32]  # (M,) mean of mu; exactly 1 where no ray is occluded
    mu: NDArray[Any] | None = None  # (M, N) bool for a step falloff, float32 for others
    directions: NDArray[np.float32] | None = None  # (3, M, N)


def openness(tracer: Tracer, rays: PatternRays, method: Method, each_ray: bool, directions: bool) -> Openness:
    """Trace the rays of some points.

    Parameters
    ----------
    each_ray, directions : bool
        What is needed beside w: mu and the direction of each ray. Otherwise it may be None.
    """
    reach = method.falloff.reach(method.radius)
    limit = np.inf if reach == np.inf else reach / method.radius
    wanted = ["directions"] if directions else []
    if method.any_hit:
        results = PatternResults.room(rays.shape, *wanted, *(["is_open"] if each_ray else []))
        tracer.trace_patterns(rays, limit, results)
        w = results.open.astype(F) / F(method.samples)  # exact: counts are below 2^24
        return Openness(w, results.is_open, results.directions)

    # The weight of what each ray meets first.
    if method.faces == "count":
        results = PatternResults.room(rays.shape, *wanted, "distance")
        tracer.trace_patterns(rays, limit * BEYOND, results)
        distance, d = results.distance, results.directions
    else:
        d = rays.directions()
        distance, d = front_face_distance(tracer, rays.starts(), d, method), d.T.reshape(3, *rays.shape)
    assert distance is not None
    weight = method.falloff.weight(distance.ravel() * np.float64(method.radius), reach, method.radius)
    mu = (weight > 0.5 if method.falloff.step else weight.astype(F)).reshape(rays.shape)
    return Openness(mu.mean(axis=1, dtype=np.float64).astype(F), mu, d)


def mean_open_direction(directions: NDArray[np.float32], mu: NDArray[Any], n: Vectors) -> Vectors:
    """(M, 3) float32 unit mean of (3, M, N) directions, weighted by mu, (M, N); `n` if all are occluded."""
    total = np.matmul(directions.transpose(1, 0, 2), mu.astype(F)[:, :, None])[:, :, 0]
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, size, out=np.array(n, F), where=size > 0)


def front_face_distance(tracer: Tracer, o: Vectors, d: Vectors, method: Method) -> Floats:
    """(R,) float32 distance to the first face that counts [radii], inf where there is none.

    `one_sided`: a ray that first meets the back of a face ends there, unoccluded. `ignore`: it goes on.
    """
    assert method.triangle_normals is not None
    rays_per_origin = len(d) // max(len(o), 1)
    start = o if rays_per_origin <= 1 else repeat_rows(o, rays_per_origin)
    distance = np.full(len(d), np.inf, F)
    ray, travelled = np.arange(len(d)), np.zeros(len(d), F)
    for _ in range(MAX_BACK_FACES):
        # Rays that hit a front face, or nothing, are done.
        closest = tracer.closest(start, d[ray])
        hit = closest.triangle >= 0
        normal = take_rows(method.triangle_normals, np.maximum(closest.triangle, 0))
        if method.instances is not None:
            normal = method.instances.normals(closest.instance, normal)
        is_back = hit & (dot(normal, d[ray]) > 0)
        is_front = hit & ~is_back
        distance[ray[is_front]] = travelled[is_front] + closest.distance[is_front]
        if method.faces == "one_sided" or not is_back.any():
            break

        # The others continue behind the back face, by a few ulp of coordinates of about 1.
        step = closest.distance[is_back] + F(4 * 2.0**-23)
        ray, travelled = ray[is_back], travelled[is_back] + step
        start = column_major(start[is_back] + step[:, None] * d[ray], F)
    return distance

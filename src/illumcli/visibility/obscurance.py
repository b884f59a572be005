"""Obscurance w(p) by Monte Carlo; with a step falloff it is ambient occlusion.

Pixels, vertices and texels share this code. Standard errors are in `obscurance_error`, sample patterns in
`hemisphere`.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, repeat_rows, take_rows
from illumcli.rays.embree import Tracer
from illumcli.records import Record
from illumcli.render_space import RenderSpace
from illumcli.visibility.falloffs._base import Falloff
from illumcli.visibility.hemisphere import Hemispheres, directions, mirror_below, sample_frames
from illumcli.visibility.obscurance_error import Estimates
from illumcli.visibility.samplers import SAMPLERS

Faces: TypeAlias = Literal["count", "ignore", "one_sided"]

RAYS_AT_ONCE = 1 << 17
"""Rays per batch: a tenth faster than 2^14, with two threads a fifth, although the arrays of 2^14 rays would
fit into the processor's cache. In long batches Embree's own data stay there."""
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
    settings: ObscuranceSettings, render_space: RenderSpace, triangle_normals: Vectors | None = None
) -> Method:
    """How a render estimates w; `triangle_normals`, (T, 3), are given unless every face counts."""
    return Method(
        settings.samples,
        settings.falloff,
        render_space.radius,
        settings.sampler,
        settings.faces,
        triangle_normals,
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

    frames = sample_frames(over.n, draws, method.sampler)
    at_once = max(1, RAYS_AT_ONCE // method.samples)
    for first in range(0, casting, at_once):
        # Directions and origins of the rays of a batch of points.
        end = min(first + at_once, casting)
        points = slice(first, end) if unknown is None else unknown[first:end]
        batch = over.between(first, end) if unknown is None else over.take(unknown[first:end])
        d = directions(frames[points], draws[:, points], method.samples, method.sampler)
        if batch.ng is not None:
            mirror_below(d, batch, method.samples, method.sampler)
        origins = batch.origins
        if batch.origins_per_point > 1:
            origins = take_rows(origins, batch.origin_of_rays(method.samples))

        # Trace them, and average over each point's rays.
        mu = occluder_weights(tracer, origins, d, method).reshape(-1, method.samples)
        w[points] = mean_openness(mu)
        if errors:
            variation[points] = SAMPLERS[method.sampler].variation(mu)
        if bent_normal is not None:
            bent_normal[points] = mean_open_direction(d, mu)
    return Estimates(w, variation, bent_normal, count - casting)


def mean_openness(mu: NDArray[Any]) -> NDArray[np.float32]:
    """(M,) float32 mean of each row of mu, (M, samples); exactly 1 where no ray is occluded."""
    if mu.dtype == np.bool_:  # exact: counts are below 2^24
        return (mu.astype(F) @ np.ones(mu.shape[1], F)) / F(mu.shape[1])
    return mu.mean(axis=1, dtype=np.float64).astype(F)


def mean_open_direction(d: Vectors, mu: NDArray[Any]) -> NDArray[np.float32]:
    """(M, 3) float32 unit mean of the directions, (M * samples, 3), weighted by mu, (M, samples); 0 if all
    are occluded."""
    per_point = d.T.reshape(3, len(mu), -1).transpose(1, 0, 2)
    total = np.matmul(per_point, mu.astype(F)[:, :, None])[:, :, 0]
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, size, out=np.zeros_like(total), where=size > 0)


def occluder_weights(tracer: Tracer, origins: Vectors, d: Vectors, method: Method) -> NDArray[Any]:
    """(M * samples,) mu along each direction: bool for a step falloff, float32 for others.

    `origins` has a row for every ray, or one for all rays of each point.
    """
    reach = method.falloff.reach(method.radius)
    if method.any_hit:
        return ~tracer.occluded(origins, d, np.inf if reach == np.inf else reach / method.radius)
    if method.faces == "count":
        distance = tracer.distance(origins, d)
    else:
        rays_per_origin = len(d) // max(len(origins), 1)
        per_ray = origins if rays_per_origin == 1 else repeat_rows(origins, rays_per_origin)
        distance = front_face_distance(tracer, per_ray, d, method)
    weight = method.falloff.weight(distance.astype(np.float64) * method.radius, reach, method.radius)
    return weight > 0.5 if method.falloff.step else weight.astype(F)


def front_face_distance(tracer: Tracer, o: Vectors, d: Vectors, method: Method) -> Floats:
    """(R,) float32 distance to the first face that counts [radii], inf where there is none.

    `one_sided`: a ray that first meets the back of a face ends there, unoccluded. `ignore`: it goes on.
    """
    assert method.triangle_normals is not None
    distance = np.full(len(o), np.inf, F)
    ray, start, travelled = np.arange(len(o)), o, np.zeros(len(o), F)
    for _ in range(MAX_BACK_FACES):
        # Rays that hit a front face, or nothing, are done.
        closest = tracer.closest(start, d[ray])
        hit = closest.triangle >= 0
        normal = take_rows(method.triangle_normals, np.maximum(closest.triangle, 0))
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

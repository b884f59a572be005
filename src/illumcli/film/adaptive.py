"""Adaptive antialiasing: which pixels one sample is not enough for.

Every pixel gets one sample at its centre. The value there misses the mean over the pixel by about
s^2 f'' / 2, where s is the deviation of the pixel filter: where light is straight from centre to centre, all
other samples would tell the same. So a pixel gets all samples where around it

- the centres, or the first hits of some samples (`Probes`), see different objects,
- surfaces turn, or leap in depth,
- light bends from centre to centre, or a texture has more texels than there are pixels.

A refined pixel is the same as without it. What lies between centres and probes, such as the shadow of a wire,
is missed: adaptive pictures are biased, towards smoothness.

References
----------
Whitted, T. (1980). An improved illumination model for shaded display. CACM 23(6): more samples where the
corners of a pixel differ.
Mitchell, D. P. (1987). Generating antialiased images at low sampling densities. SIGGRAPH '87: contrast
relative to the brightness around.
Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91: why keeping the
samples that decided is biased.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, dot
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.camera import Rays, axes
from illumcli.rays.embree import Tracer
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.records import Record
from illumcli.render_space import RenderSpace

TURN = 0.3
"""Components of unit normals that lie farther apart differ: directions 17 degrees apart or more."""
LEAP = 2.0
"""Depth leaps where it departs from a plane by more than so many widths of a pixel."""
DARK = 0.05
"""Light below this counts as this much when differences are weighed."""


class Probes(Record):
    """What the first hits of some samples of every pixel lie on, nothing else of which is computed."""

    lowest: NDArray[np.int32]  # (P,) least number of an object among them, from 1, 0 where one hits nothing
    highest: NDArray[np.int32]  # (P,)
    farthest: NDArray[np.float64]  # (P,) least `nearness` among them, 0 where one hits nothing
    nearest: NDArray[np.float64]  # (P,)


def probe_view(view: View) -> View:
    """The view with the samples whose first hits are probes."""
    return view.probing()


def probes(
    tracer: Tracer, geometry: SceneGeometry, render_space: RenderSpace, probe_view: View, probe_rays: Rays
) -> Probes:
    """First hits of some samples of every pixel."""
    closest = tracer.closest(probe_rays.origins, probe_rays.directions)
    hit = closest.triangle >= 0
    number = np.where(hit, geometry.objects.take(closest.triangle, mode="wrap") + np.int32(1), np.int32(0))

    # depth from origins near the scene: single precision does for it, however far the eye is
    forward = axes(probe_view.camera)[2]
    along = dot(probe_rays.origins, forward.astype(F)[None, :])
    along += np.where(hit, closest.distance, F(0)) * dot(probe_rays.directions, forward.astype(F)[None, :])
    depth = along - forward @ render_space.from_world(probe_view.camera.position)
    near = np.where(hit, _nearness(probe_view, depth), 0)

    of_pixel = [values.reshape(-1, probe_view.samples).T for values in (number, near)]
    low, high = ([extreme.reduce([*each]) for each in of_pixel] for extreme in (np.minimum, np.maximum))
    return Probes(low[0], high[0], low[1], high[1])


def nearness(view: View, render_space: RenderSpace, interaction: SurfaceInteraction) -> NDArray[np.float64]:
    """(M,) what grows evenly over the picture of a plane: 1 / depth, or depth where rays are parallel."""
    eye = render_space.from_world(view.camera.position)
    return _nearness(view, dot(interaction.position - eye, axes(view.camera)[2][None, :]))


def _nearness(view: View, depth: Floats) -> NDArray[np.float64]:
    """(N,) the same of depths along the line of sight [radii]."""
    if view.camera.projection == "orthographic":
        return np.asarray(depth, np.float64)
    return np.asarray(1 / np.maximum(depth, np.finfo(np.float64).tiny))


def edges(
    view: View,
    render_space: RenderSpace,
    tile: Tile,
    hits: Hits,
    object_id: NDArray[np.uint32],
    interaction: SurfaceInteraction,
    nearness: NDArray[np.float64],
    probes: Probes,
) -> NDArray[np.bool_]:
    """(P,) True where centres and probes see different objects, surfaces that turn, or depths that leap.

    Pixels at the tile's border, except at that of the film, lack neighbours: theirs is not decided.
    """
    shape, reach = (tile.height, tile.width), view.reach

    # different objects
    number = on_film(object_id.astype(np.int32), hits.sample, shape)[0]
    low = around(np.minimum(number, probes.lowest.reshape(shape)), np.minimum, reach)
    differ = around(np.maximum(number, probes.highest.reshape(shape)), np.maximum, reach) > low

    # turned
    for normal in on_film(interaction.ng, hits.sample, shape):
        differ |= around(normal, np.maximum, reach) - around(normal, np.minimum, reach) > F(TURN)

    # a leap from centre to centre, or from a probe to the centres around
    near = on_film(nearness, hits.sample, shape)[0]
    leap = _leap(view, render_space, near)
    far = around(near, np.minimum, 1, straight=True) - leap
    close = around(near, np.maximum, 1, straight=True) + leap
    leaps = bend(near) > leap
    leaps |= (probes.farthest.reshape(shape) < far) | (probes.nearest.reshape(shape) > close)
    return np.asarray(differ | around(leaps, np.maximum, reach)).ravel()


def _leap(view: View, render_space: RenderSpace, near: NDArray[np.float64]) -> NDArray[np.float64] | float:
    """By how much `nearness` differs between depths that are a leap apart."""
    if view.camera.projection == "orthographic":
        return LEAP * view.camera.extent / render_space.radius / view.height
    return LEAP * 2 * float(np.tan(np.radians(view.camera.fov) / 2)) / view.height * near


def refined(
    difference: float,
    view: View,
    tile: Tile,
    hits: Hits,
    edges: NDArray[np.bool_],
    values: NDArray[np.float32],
    minified: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """(P,) pixels of a layer that want all samples: at edges, and where its values bend.

    Parameters
    ----------
    difference : float
        How far values may bend, as a share of the greatest around.
    values : (M,) or (M, k) float32
        Of the samples at the centres that see something; 0 stands for the others.
    minified : (P,) bool, optional
        Pixels that want all samples for their textures.
    """
    shape = (tile.height, tile.width)
    planes = on_film(values, hits.sample, shape)
    scale = np.maximum(around(planes.max(axis=0), np.maximum, view.reach), F(DARK))
    bent = np.maximum.reduce([bend(plane) for plane in planes])
    spread = view.adaptive.spread if view.adaptive else 1.0
    bends = around(bent * F(spread) > F(difference) * scale, np.maximum, view.reach)
    out = edges | bends.ravel()
    return out if minified is None else out | minified


def minified(
    view: View, tile: Tile, hits: Hits, texels: NDArray[np.float32], material_id: NDArray[np.uint32]
) -> NDArray[np.bool_]:
    """(P,) True where textures have more than a texel from centre to centre: the centres may then skip whole
    periods of a pattern.

    Parameters
    ----------
    texels : (M, 2) float32
        Place of every hit in the largest texture of its material [texels].
    material_id : (M,) uint32
        Steps between materials are none.
    """
    shape = (tile.height, tile.width)
    number = on_film(material_id.astype(np.int32), hits.sample, shape)[0]
    coarse = np.zeros(shape, np.bool_)
    for place in on_film(texels, hits.sample, shape):
        for axis in (0, 1):
            far = np.abs(np.diff(place, axis=axis)) > F(1)
            far &= np.diff(number, axis=axis) == 0
            coarse[_along(axis, 0, -1)] |= far
            coarse[_along(axis, 1, None)] |= far
    return around(coarse, np.maximum, view.reach).ravel()


# --- planes of pixels -------------------------------------------------------------------------------------


def on_film(values: NDArray[Any], sample: Ids, shape: tuple[int, int]) -> NDArray[Any]:
    """(k, h, w) values of the samples that see something, one to a pixel, and 0 elsewhere."""
    columns = values.T if values.ndim == 2 else values[None]
    if len(sample) == shape[0] * shape[1]:
        return np.ascontiguousarray(columns).reshape(len(columns), *shape)
    planes = np.zeros((len(columns), shape[0] * shape[1]), values.dtype)
    for plane, column in zip(planes, columns, strict=True):
        plane[sample] = column
    return planes.reshape(len(columns), *shape)


def around(values: NDArray[Any], extreme: np.ufunc, reach: int, straight: bool = False) -> NDArray[Any]:
    """(h, w) the least or greatest of each value and those up to `reach` pixels across and down from it.

    Beyond the film there is nothing, or, if `straight`, what the two values beside it lead to.
    """
    for axis in (0, 1):
        source, values = values, values.copy()
        for step in range(1, min(reach, values.shape[axis] - 1) + 1):
            ahead, behind = _along(axis, step, None), _along(axis, 0, -step)
            extreme(values[ahead], source[behind], out=values[ahead])
            extreme(values[behind], source[ahead], out=values[behind])
        if straight and values.shape[axis] > 1:
            for end, beside in ((0, 1), (-1, -2)):
                edge, inner = _along(axis, end), _along(axis, beside)
                extreme(values[edge], 2 * source[edge] - source[inner], out=values[edge])
    return values


def _along(axis: int, *part: int | None) -> tuple[slice | int, ...]:
    """Index of a part of the rows or columns of a plane: of one of them, or from one to another."""
    one = part[0] if len(part) == 1 else slice(*part)
    assert one is not None
    return (one,) if axis == 0 else (slice(None), one)


def bend(plane: NDArray[Any]) -> Floats:
    """(h, w) second differences of each value and those beside it, across or down, whichever is greater.

    0 at the borders, where a neighbour is missing.
    """
    out = np.zeros_like(plane)
    for axis in (0, 1):
        first, middle, last = (plane[_along(axis, k, k - 2 or None)] for k in range(3))
        second = first + last
        second -= 2 * middle
        inner = out[_along(axis, 1, -1)]
        np.maximum(inner, np.abs(second, out=second), out=inner)
    return out

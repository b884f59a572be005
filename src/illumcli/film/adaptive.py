"""Adaptive antialiasing: decides which pixels need more than one sample.

Every pixel gets one sample at its centre. Its value differs from the mean over the pixel by about s^2 f'' /
2, where s is the deviation of the pixel filter: where light is linear from centre to centre, one sample is
enough. So a pixel gets all samples if around it

- the centres, or the first hits of some samples (`Probes`), are on different objects,
- normals or depth have a step,
- light has a second difference, or a texture has more texels than there are pixels.

A refined pixel is the same as without adaptive sampling. Features between centres and probes, such as the
shadow of a wire, are missed: adaptive images are biased towards smoothness.

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

NORMAL_STEP = 0.3
"""Greatest difference between components of unit normals that count as equal: about 17 degrees."""
DEPTH_STEP = 2.0
"""Greatest difference of depth from a plane that does not count as a step, in widths of a pixel."""
DARK = 0.05
"""Least radiance that differences are relative to."""


class Probes(Record):
    """The objects and depths of the first hits of some samples of every pixel; nothing else is computed."""

    lowest: NDArray[np.int32]  # (P,) least object number among them, from 1; 0 if one misses
    highest: NDArray[np.int32]  # (P,)
    farthest: NDArray[np.float64]  # (P,) least `nearness` among them, 0 if one misses
    nearest: NDArray[np.float64]  # (P,)


class Centres(Record):
    """The first hits of the pixel centres of a tile, as planes; 0 at pixels whose centre misses."""

    object: NDArray[np.int32]  # (h, w) number, from 1
    ng: NDArray[np.floating[Any]]  # (3, h, w) unit normals
    nearness: NDArray[np.float64]  # (h, w)


def probe_view(view: View) -> View:
    """The view with the samples whose first hits are probes."""
    return view.probing()


def probes(
    tracer: Tracer, geometry: SceneGeometry, render_space: RenderSpace, probe_view: View, probe_rays: Rays
) -> Probes:
    """First hits of some samples of every pixel; one that leaks through a vertex refines its pixel."""
    closest = tracer.closest(probe_rays.origins, probe_rays.directions, retry=False, coherent=True)
    hit = closest.triangle >= 0
    objects = geometry.objects_of(closest.triangle, closest.instance)
    number = np.where(hit, objects + np.int32(1), np.int32(0))

    # depth from origins near the scene: single precision does for it, however far the eye is
    forward = axes(probe_view.camera)[2]
    along = dot(probe_rays.origins, forward.astype(F)[None, :])
    along += np.where(hit, closest.distance, F(0)) * dot(probe_rays.directions, forward.astype(F)[None, :])
    depth = along - forward @ render_space.from_world(probe_view.camera.position)
    near = np.where(hit, nearness(probe_view, depth), 0)

    of_pixel = [values.reshape(-1, probe_view.samples).T for values in (number, near)]
    low, high = ([extreme.reduce([*each]) for each in of_pixel] for extreme in (np.minimum, np.maximum))
    return Probes(low[0], high[0], low[1], high[1])


def nearness(view: View, depth: Floats) -> NDArray[np.float64]:
    """(N,) 1 / depth, or depth [radii] if rays are parallel: on a plane it is linear over the image."""
    if view.camera.projection == "orthographic":
        return np.asarray(depth, np.float64)
    return np.asarray(1 / np.maximum(depth, np.finfo(np.float64).tiny))


def centres(
    view: View,
    render_space: RenderSpace,
    tile: Tile,
    hits: Hits,
    object_id: NDArray[np.uint32],
    interaction: SurfaceInteraction,
) -> Centres:
    """The first hits of the pixel centres of a tile."""
    shape = (tile.height, tile.width)
    eye = render_space.from_world(view.camera.position)
    depth = dot(interaction.position - eye, axes(view.camera)[2][None, :])
    return Centres(
        on_film(object_id.astype(np.int32), hits.sample, shape)[0],
        on_film(interaction.ng, hits.sample, shape),
        on_film(nearness(view, depth), hits.sample, shape)[0],
    )


def edges(
    view: View, render_space: RenderSpace, tile: Tile, centres: Centres, probes: Probes
) -> NDArray[np.bool_]:
    """(P,) True where centres and probes hit different objects, or normals or depths have a step.

    Pixels at the film's border that see something count, too: no centre lies beyond them to tell. It is
    undecided elsewhere at the border of a tile, where neighbours are missing.
    """
    shape, reach = centres.object.shape, view.reach

    # Different objects.
    low = around(np.minimum(centres.object, probes.lowest.reshape(shape)), np.minimum, reach)
    high = around(np.maximum(centres.object, probes.highest.reshape(shape)), np.maximum, reach)
    differ = high > low

    # Different normals.
    for normal in centres.ng:
        differ |= around(normal, np.maximum, reach) - around(normal, np.minimum, reach) > F(NORMAL_STEP)

    # A step in depth between centres, or between a probe and the centres around it.
    near = centres.nearness
    step = _nearness_step(view, render_space, near)
    far = around(near, np.minimum, 1, straight=True) - step
    close = around(near, np.maximum, 1, straight=True) + step
    steps = bend(near) > step
    steps |= (probes.farthest.reshape(shape) < far) | (probes.nearest.reshape(shape) > close)
    differ |= around(steps, np.maximum, reach)

    # The film's border, but for empty sky.
    return np.asarray(differ | ((high > 0) & at_border(view, tile, reach))).ravel()


def at_border(view: View, tile: Tile, width: int) -> NDArray[np.bool_]:
    """(h, w) True for pixels of a tile that lie less than `width` pixels from the film's border."""
    x, y = np.arange(tile.x, tile.x + tile.width), np.arange(tile.y, tile.y + tile.height)
    columns, rows = ((at < width) | (at >= size - width) for at, size in ((x, view.width), (y, view.height)))
    return np.asarray(rows[:, None] | columns)


def _nearness_step(
    view: View, render_space: RenderSpace, near: NDArray[np.float64]
) -> NDArray[np.float64] | float:
    """The difference of nearness at a step in depth of `DEPTH_STEP`."""
    if view.camera.projection == "orthographic":
        return DEPTH_STEP * view.camera.extent / render_space.radius / view.height
    return DEPTH_STEP * 2 * float(np.tan(np.radians(view.camera.fov) / 2)) / view.height * near


def refined(
    difference: float,
    view: View,
    tile: Tile,
    hits: Hits,
    detailed: NDArray[np.bool_],
    values: NDArray[np.float32],
) -> NDArray[np.bool_]:
    """(P,) True for pixels of a layer that need all samples: with details, or large second differences.

    Parameters
    ----------
    difference : float
        Greatest second difference, relative to the greatest value around.
    detailed : (P,) bool
        True for pixels that need all samples, whatever the values.
    values : (M,) or (M, k) float32
        At the hits of the centres; centres that miss count as 0.
    """
    shape = (tile.height, tile.width)
    planes = on_film(values, hits.sample, shape)
    scale = np.maximum(around(planes.max(axis=0), np.maximum, view.reach), F(DARK))
    bent = np.maximum.reduce([bend(plane) for plane in planes])
    spread = view.adaptive.spread if view.adaptive else 1.0
    bends = around(bent * F(spread) > F(difference) * scale, np.maximum, view.reach)
    return detailed | bends.ravel()


def detailed(edges: NDArray[np.bool_], minified: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(P,) True for pixels with details of geometry or textures."""
    return edges | minified


def minified(
    view: View, tile: Tile, hits: Hits, texels: NDArray[np.float32], material_id: NDArray[np.uint32]
) -> NDArray[np.bool_]:
    """(P,) True where textures have more than one texel from centre to centre, and details may be missed.

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
    """(k, h, w) values at the hits of a single sample per pixel, 0 at pixels whose sample misses."""
    columns = values.T if values.ndim == 2 else values[None]
    if len(sample) == shape[0] * shape[1]:
        return np.ascontiguousarray(columns).reshape(len(columns), *shape)
    planes = np.zeros((len(columns), shape[0] * shape[1]), values.dtype)
    for plane, column in zip(planes, columns, strict=True):
        plane[sample] = column
    return planes.reshape(len(columns), *shape)


def around(values: NDArray[Any], extreme: np.ufunc, reach: int, straight: bool = False) -> NDArray[Any]:
    """(h, w) the least or greatest value within `reach` pixels across and down.

    Values outside of the film do not count, or, if `straight`, are extrapolated from the two nearest.
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
    """(h, w) the greater of the second differences across and down; 0 at borders."""
    out = np.zeros_like(plane)
    for axis in (0, 1):
        first, middle, last = (plane[_along(axis, k, k - 2 or None)] for k in range(3))
        second = first + last
        second -= 2 * middle
        inner = out[_along(axis, 1, -1)]
        np.maximum(inner, np.abs(second, out=second), out=inner)
    return out

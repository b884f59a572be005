"""Points at texels: one for each texel and triangle that covers its centre, or the nearest place of a chart.

A texel whose centre several triangles cover, because uv overlap, has a point on each of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, cross, length, row_blocks
from illumcli.atlas.centres import TexelsOnTriangles, joined
from illumcli.atlas.overlaps import Overlaps, overlaps
from illumcli.atlas.texels import Texels as AtlasTexels
from illumcli.atlas.texels import texels_of
from illumcli.atlas.triangles import AtlasTriangles, TextureSize, atlas_triangles
from illumcli.baking.baked_texture import TextureUvs
from illumcli.baking.points import PointsOnTriangles, Surfaces
from illumcli.baking.seams import Places, across_seams
from illumcli.baking.texture_slots import Slot, slot_triangles
from illumcli.geometry.planar import planar_polygons
from illumcli.geometry.scene_geometry import SceneGeometry, triangle_corners
from illumcli.rays.corner_weights import corner_weights
from illumcli.rays.interaction import Hits, ShadingContext, interact, interpolated
from illumcli.records import Record


class TexelPoints(PointsOnTriangles):
    """Points at texels."""

    kind = "texel"
    cell_size = 32  # texels are small beside what w follows
    is_dense = True


class TexturePoints(Record):
    """A texture, and which points its texels take their values from."""

    slot: Slot
    triangles: AtlasTriangles
    overlaps: Overlaps
    texel: NDArray[np.int32]  # (K,) texel of each of its points
    first: int  # of its points among those of the bake

    @property
    def points(self) -> slice:
        """Its points among those of the bake."""
        return slice(self.first, self.first + len(self.texel))

    def as_data(self) -> dict[str, Any]:
        """Its name and counts, for JSON."""
        return {
            "texture": self.slot.name,
            "triangles": len(self.triangles.triangle),
            "texels": self.overlaps.read,
            "overlapping": self.overlaps.several,
            "overlapping_mirrored": self.overlaps.mirrored,
            "without_uv": self.triangles.without_uv,
            "without_uv_area": self.triangles.without_area,
            "tiles": self.triangles.tiles,
        }


class Texels(Record):
    """The points of a bake of textures, and the textures that take their values from them."""

    points: TexelPoints
    textures: tuple[TexturePoints, ...]


def texel_points(
    surfaces: Surfaces,
    slots: Sequence[Slot],
    size: TextureSize,
    unwrapped: Mapping[int, TextureUvs],
    threads: int,
) -> Texels:
    """The points of all textures."""
    # the places of the texels of each texture on its triangles
    geometry = surfaces.geometry
    textures: list[TexturePoints] = []
    places: list[TexelsOnTriangles] = []
    first = 0
    for slot in slots:
        triangles = _triangles(geometry, slot, size, unwrapped.get(slot.object))
        of_texture = texels_of(triangles)
        texels = of_texture.places
        textures.append(TexturePoints(slot, triangles, overlaps(triangles, texels), texels.texel, first))
        places.append(_on_surface(surfaces, triangles, of_texture))
        first += len(texels.texel)
    every = joined(places)

    # their positions and normals, in blocks
    position, n = np.empty((first, 3), F, order="F"), np.empty((first, 3), F, order="F")
    objects = geometry.objects.take(every.number)
    planar = planar_polygons(geometry, surfaces.normals)

    def interpolate(rows: slice) -> None:
        hits = Hits(
            np.arange(rows.start, rows.stop, dtype=np.int32),
            objects[rows],
            every.number[rows],
            every.u[rows],
            every.v[rows],
        )
        zero = np.zeros((rows.stop - rows.start, 3), F)
        surface = interact(geometry, hits.objects, hits.triangle, hits.u, hits.v, zero)
        context = ShadingContext(geometry, corner_weights(geometry, hits, planar), surface, surfaces.normals)
        position[rows], n[rows] = surface.position, interpolated(context)

    with ThreadPoolExecutor(threads, thread_name_prefix="texels") as pool:
        list(pool.map(interpolate, row_blocks(first)))
    points = TexelPoints(
        geometry,
        n,
        position,
        np.arange(first, dtype=np.uint32),
        objects,
        np.ones(first, bool),
        every.number,
        every.u,
        every.v,
    )
    return Texels(points, tuple(textures))


def _triangles(
    geometry: SceneGeometry, slot: Slot, size: TextureSize, unwrapped: TextureUvs | None
) -> AtlasTriangles:
    """The triangles of a slot that have an area, on its texture."""
    placed = geometry.placed[slot.object]
    mesh = placed.mesh
    own = slot_triangles(geometry, slot)
    a, b, c = triangle_corners(geometry.vertices, geometry.triangles[own])
    own = own[length(cross(b - a, c - a)) > 0]
    if unwrapped is not None:
        return atlas_triangles(size, unwrapped.uvs, unwrapped.corner_uvs[own - placed.first_triangle], own)
    assert mesh.uvs is not None
    assert mesh.corner_uvs is not None
    corner = geometry.corners[own] - np.int32(placed.first_corner)
    return atlas_triangles(size, mesh.uvs, mesh.corner_uvs[corner], own)


def _on_surface(surfaces: Surfaces, triangles: AtlasTriangles, texels: AtlasTexels) -> TexelsOnTriangles:
    """The places of texels on stored triangles; those of border texels across seams."""
    places = replace(texels.places, number=triangles.triangle[texels.places.number])
    rest = slice(len(places.texel) - len(texels.border.texel), None)
    near = Places(places.number[rest], places.u[rest], places.v[rest])
    beyond = across_seams(surfaces, triangles, texels.border, near)
    for values, new in ((places.number, beyond.triangle), (places.u, beyond.u), (places.v, beyond.v)):
        values[rest] = new
    return places

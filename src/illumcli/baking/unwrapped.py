"""uv that are made for textures: of objects that have none, or of all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from illumcli.arrays import Ids
from illumcli.atlas.triangles import TextureSize
from illumcli.atlas.unwrap import Unwrapped, library, unwrapped
from illumcli.baking.baked_texture import TextureUvs
from illumcli.baking.context import BakeContext
from illumcli.baking.texture_slots import Slot, slot_triangles
from illumcli.cache.fingerprint import digest
from illumcli.cache.location import open_store
from illumcli.visibility.baked import mesh_hash


def unwrapped_uvs(context: BakeContext, slots: Sequence[Slot], size: TextureSize) -> dict[int, TextureUvs]:
    """New uv by object, as the settings say: those of each slot fill a texture of their own."""
    geometry, unwrap = context.surfaces.geometry, context.settings.unwrap
    out = {}
    for number, placed in enumerate(geometry.placed):
        if unwrap is None or (unwrap == "missing" and placed.mesh.uvs is not None):
            continue
        parts = [
            (triangles, _of_triangles(context, number, triangles, size))
            for slot in slots
            if slot.object == number
            for triangles in [slot_triangles(geometry, slot)]
        ]
        out[number] = _joined(int((geometry.objects == number).sum()), placed.first_triangle, parts)
        context.clock.lap("unwrap")
    return out


def _of_triangles(context: BakeContext, number: int, triangles: Ids, size: TextureSize) -> Unwrapped:
    """uv of some triangles of an object, from the store if it has them: they depend on the mesh alone."""
    geometry = context.surfaces.geometry
    placed = geometry.placed[number]
    vertices = np.ascontiguousarray(placed.mesh.vertices)
    corners = np.ascontiguousarray(geometry.triangles[triangles] - np.int32(placed.first_vertex))
    mesh = mesh_hash(vertices, corners, np.arange(0, corners.size + 1, 3, dtype=np.int32))
    key = digest(("unwrap", library(), size.width, size.height, mesh))
    store = open_store()
    stored = None if store is None else store.read(key)
    if stored is not None:
        return Unwrapped(*stored.arrays)
    result = unwrapped(vertices, corners, size, context.progress)
    if store is not None:
        store.save(key, {"kind": "unwrap"}, [result.uvs, result.corner_uvs])
        store.finish()
    return result


def _joined(count: int, first: int, parts: Sequence[tuple[Ids, Unwrapped]]) -> TextureUvs:
    """The uv of all `count` triangles of an object, the first of which is number `first`."""
    corner_uvs = np.zeros((count, 3), np.int32)
    uvs, before = [np.zeros((1, 2))], 1
    for triangles, part in parts:
        corner_uvs[triangles - first] = part.corner_uvs + np.int32(before)
        uvs.append(part.uvs.astype(np.float64))
        before += len(part.uvs)
    return TextureUvs(np.concatenate(uvs), corner_uvs)

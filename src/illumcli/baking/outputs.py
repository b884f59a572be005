"""The files of a bake."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from illumcli.baking.baked_texture import BakedTextures
from illumcli.baking.files import (
    add_baked_to_glb,
    extend_baked_obj,
    write_baked_glb,
    write_baked_obj,
    write_baked_ply,
)
from illumcli.baking.inputs import BakeWork
from illumcli.baking.obj_files import (
    copy_materials,
    placed_mesh,
    selected_materials,
    with_textures_in,
    write_materials,
)
from illumcli.baking.points import Surfaces
from illumcli.baking.split import (
    corners_of_triangles,
    split_by_values,
    split_meshes,
    whole_meshes,
    with_materials,
)
from illumcli.geometry.mesh import Mesh
from illumcli.images.encoded import png_bytes
from illumcli.mesh_files import is_mesh_file, mtl_write
from illumcli.mesh_files.gltf.contents import DEFORMERS, beside_mesh
from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.gltf.write import fits_attribute
from illumcli.mesh_files.materials import pbr_materials
from illumcli.mesh_files.obj_write import NamedMesh
from illumcli.mesh_files.occlusion import OcclusionMap, OcclusionMaps
from illumcli.mesh_files.output_mesh import OutputMesh
from illumcli.mesh_files.ply import has_plain_faces
from illumcli.render_graph.needs import mesh_name
from illumcli.visibility.baked import Baked, write_npz

GLTF = (".glb", ".gltf")


def write_outputs(
    work: BakeWork, due: Sequence[Path], baked: Baked, textures: BakedTextures
) -> tuple[str, ...]:
    """Write the files `due`, a GLB with its textures. Returns a line for each part of the input that one of
    them lacks."""
    writer = _Writer(work, baked, textures)
    return tuple(f"{path.name}: {what}" for path in due for what in writer.write(path))


def pose_warnings(path: Path) -> list[str]:
    """A line if the meshes of a glTF file are deformed: their values are those of one pose."""
    if path.suffix.lower() not in GLTF:
        return []
    deformers = [name for name in beside_mesh(open_document(path)) if name in DEFORMERS]
    if not deformers:
        return []
    return [f"meshes are deformed by {' and '.join(deformers)}: the values are those of the rest pose"]


def occlusion_maps(textures: BakedTextures, surfaces: Surfaces) -> OcclusionMaps:
    """Textures in the form in which a GLB has them: 8 bits of obscurance. uv of corners are those of
    triangles, which all polygons of glTF files are."""
    maps = {}
    for each in textures.textures:
        steps = np.rint(255 * np.clip(each.channels["obscurance"], 0, 1)).astype(np.uint8)
        png = png_bytes(steps[..., None], srgb=False)
        maps[each.object, each.material] = OcclusionMap(f"occlusion of {each.name}", png)
    uvs = {}
    for number, of_triangles in textures.unwrapped.items():
        at_corners = np.zeros((len(surfaces.geometry.placed[number].mesh.corners), 2))
        corners = corners_of_triangles(surfaces.geometry, number)
        at_corners[corners] = of_triangles.uvs[of_triangles.corner_uvs]
        uvs[number] = at_corners
    return OcclusionMaps(maps, uvs)


class _Writer:
    """Writes the files of one bake."""

    def __init__(self, work: BakeWork, baked: Baked, textures: BakedTextures) -> None:
        self._work, self._baked, self._textures = work, baked, textures
        self._source, self._color, self._split = work.path, work.settings.color, work.settings.split
        self._is_mesh = is_mesh_file(work.path)
        self._names = (work.path.stem,) if self._is_mesh else work.scene.object_names()

    def write(self, path: Path) -> Sequence[str]:
        """Write one file: the input with the values if both have one format, otherwise a new file.

        Returns the parts of the input that it lacks.
        """
        source_kind, kind = self._source.suffix.lower(), path.suffix.lower()
        if kind == ".npz":
            write_npz(path, self._baked)
            return ()
        if kind == ".glb":
            if source_kind in GLTF:
                occlusion = occlusion_maps(self._textures, self._work.surfaces)
                return add_baked_to_glb(path, self._source, self._baked, self._color, occlusion)
            return self._write_glb(path)
        if kind == ".obj":
            return self._write_obj(path)
        mesh = self._work.surfaces.geometry.placed[0].mesh
        if source_kind == ".ply" and not self._split:
            write_baked_ply(path, [], self._baked, self._source, self._color)
            return ()
        if source_kind == ".ply" and has_plain_faces(self._source, len(mesh.corners)):
            part, baked = split_by_values(mesh, self._baked)
            write_baked_ply(path, [], baked, self._source, self._color, part)
            return ()
        return self._write_ply(path)

    def _write_glb(self, path: Path) -> list[str]:
        """Write a new GLB with the materials of the mesh file."""
        unwrapped = self._textures.unwrapped
        split = split_meshes(self._names, self._work.surfaces, self._baked, fill=True, unwrapped=unwrapped)
        meshes = split.meshes
        left_out = []
        if self._is_mesh:
            materials = pbr_materials(self._source, self._meshes()[0])
            meshes = [with_materials(mesh, materials) for mesh in meshes]
            left_out += [each for mesh in meshes for material in mesh.materials for each in material.left_out]
        elif self._has_materials(meshes):
            left_out.append("materials")
        occlusion = occlusion_maps(self._textures, self._work.surfaces)
        write_baked_glb(path, meshes, split.baked, self._color, occlusion)
        for mesh in meshes:
            wide = [name for name, values in mesh.attributes.items() if not fits_attribute(values)]
            left_out += [f"the vertex property {name} of {mesh.name}" for name in wide]
            if unused := len(mesh.vertices) - len(np.unique(mesh.triangles)):
                left_out.append(f"vertices of {mesh.name} that no polygon uses, {unused}")
        return left_out

    def _write_ply(self, path: Path) -> list[str]:
        """Write a new PLY."""
        surfaces, baked = self._work.surfaces, self._baked
        if self._split:
            written = split_meshes(self._names, surfaces, baked, fill=False)
        else:
            written = whole_meshes(self._names, surfaces, baked)
        write_baked_ply(path, written.meshes, written.baked, None, self._color)

        # What a PLY has no place for.
        left_out = list(written.left_out)
        names = Counter(name for mesh in written.meshes for name in mesh.attributes)
        left_out += [
            f"the vertex property {name}, which some objects lack"
            for name, count in sorted(names.items())
            if count < len(written.meshes)
        ]
        if self._has_materials(written.meshes):
            left_out.append("materials")
        if any(mesh.group_names for mesh in written.meshes):
            left_out.append("groups")
        if self._source.suffix.lower() in GLTF:
            left_out += beside_mesh(open_document(self._source))
        return left_out

    def _write_obj(self, path: Path) -> list[str]:
        """Write an OBJ: the lines of an OBJ with colours, or the meshes, with their materials beside it."""
        placed, force = self._work.surfaces.geometry.placed, self._work.job.options.force
        channel = self._color
        if self._source.suffix.lower() == ".obj":
            extend_baked_obj(path, self._source, placed[0].mesh, self._baked, channel)
            copy_materials(path, self._source, force)
            return []
        moved = [
            placed_mesh(replace(each, mesh=mesh)) for each, mesh in zip(placed, self._meshes(), strict=True)
        ]
        meshes = [NamedMesh(name, mesh) for name, mesh in zip(self._names, moved, strict=True)]
        library = write_materials(path, [each.mesh for each in meshes], force)
        write_baked_obj(path, meshes, self._baked, channel, library)

        # What an OBJ has no place for.
        names = {name for each in meshes for name in each.mesh.attributes} - {"color", "alpha"}
        left_out = [f"the vertex property {name}" for name in sorted(names)]
        left_out += mtl_write.left_out(selected_materials([each.mesh for each in meshes]))
        if self._work.scene.materials:
            left_out.append("materials of the scene")
        differences = {what for each in meshes for what in each.mesh.material_repairs}
        left_out += sorted(what.removesuffix(" left out") for what in differences if "left out" in what)
        if self._source.suffix.lower() in GLTF:
            left_out += beside_mesh(open_document(self._source))
        return left_out

    def _meshes(self) -> list[Mesh]:
        """The mesh of each object, with whole paths of textures."""
        scene, placed = self._work.scene, self._work.surfaces.geometry.placed
        files = [self._source.parent / mesh_name(scene, thing.mesh) for thing in scene.objects]
        return [with_textures_in(file.parent, each.mesh) for file, each in zip(files, placed, strict=True)]

    def _has_materials(self, meshes: Sequence[OutputMesh]) -> bool:
        """True if mesh files or the scene have materials."""
        return bool(self._work.scene.materials) or any(mesh.materials for mesh in meshes)

"""The materials of a mesh file in the terms of the metallic-roughness model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files import obj
from illumcli.mesh_files.mtl_pbr import read_pbr
from illumcli.mesh_files.pbr import PbrMaterial


def pbr_materials(path: Path, mesh: Mesh) -> Mapping[str, PbrMaterial]:
    """The materials of an OBJ's libraries, and those of the images that a PLY names, by name."""
    if path.suffix.lower() == ".obj":
        libraries = [read_pbr(library, path.parent) for library in reversed(obj.libraries(path))]
        return {name: each for library in libraries for name, each in library.items()}
    return {name: _textured(name, mesh) for name in mesh.material_names}


def _textured(name: str, mesh: Mesh) -> PbrMaterial:
    diffuse = mesh.materials.get(name, {}).get("diffuse")
    image = diffuse.get("texture") if isinstance(diffuse, dict) else None
    return PbrMaterial(name, textures={} if image is None else {"base_color": image})

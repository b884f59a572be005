"""The textures that a scene and the mesh files in it name, each read once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path

from illumcli.color import Space, Texels
from illumcli.files.located import Located
from illumcli.records import Value


class Images(Value):
    """Reads the textures of a scene, each once."""

    contents: Mapping[str, Located]
    """The textures that the scene itself names, by path."""
    resolve: Callable[[str], Path] = field(repr=False)
    """The file that the scene means by any other path."""
    known: dict[tuple[str, Space], Texels] = field(default_factory=dict, repr=False)

    def __call__(self, path: str, space: Space) -> Texels:
        """The linear image of a texture of the scene, or of a mesh file's library."""
        if (path, space) not in self.known:
            self.known[path, space] = self._read(path, space)
        return self.known[path, space]

    def _read(self, path: str, space: Space) -> Texels:
        from illumcli.images.reader import read_embedded_texture, read_texture
        from illumcli.mesh_files import embedded_image, image_within

        if path in self.contents:
            return read_texture(self.contents[path].path, space)
        if (within := image_within(path)) is None:
            return read_texture(self.resolve(path), space)
        file, number = within
        data = embedded_image(self.resolve(file), number)
        return read_embedded_texture(data, f"{file}: images[{number}]", space)

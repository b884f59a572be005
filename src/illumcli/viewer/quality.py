"""Coarse pictures: of fewer pixels, samples and rays than the scene asks for."""

from __future__ import annotations

from illumcli.records import Value
from illumcli.scene.spec import Scene
from illumcli.viewer.window import camera_path, with_values

FEWEST_RAYS, FEW_RAYS = 4, 8
"""Obscurance rays of a sample of a coarse picture, while something moves and at rest; its obscurance is
reconstructed."""


class Coarse(Value):
    """How coarse a picture is."""

    divisor: float = 1.0
    """Its width and height are divided by this."""
    rays: int = FEW_RAYS
    """Of each sample's obscurance, if the scene has any."""


def coarse_scene(scene: Scene, camera: str, coarse: Coarse) -> Scene:
    """The scene with one sample for each pixel of a smaller picture of a camera, and few obscurance rays."""
    view = scene.named_cameras()[camera]
    path = camera_path(scene, camera)
    scene = scene if scene.cameras or scene.camera else scene.model_copy(update={"camera": view})
    values: dict[str, object] = {"film.adaptive": False, f"{path}.samples": 1}
    for name in ("width", "height"):
        pixels = getattr(view, name) or getattr(scene.film, name)
        values[f"{path}.{name}"] = max(1, round(pixels / coarse.divisor))
    if scene.obscurance is not None:
        values["obscurance.samples"] = coarse.rays
        values["obscurance.reconstruct"] = True
    return with_values(scene, values)

"""How good pictures are: coarse ones, whole ones whose obscurance is reconstructed, and the scene's own."""

from __future__ import annotations

from typing import TypeAlias

from illumcli.records import Value
from illumcli.scene.spec import Scene
from illumcli.viewer.window import camera_path, with_values

FEWEST_RAYS, FEW_RAYS = 4, 8
"""Obscurance rays of a sample of a coarse picture, while something moves and at rest; its obscurance is
reconstructed."""
PIXEL_RAYS = 4
"""Obscurance rays of a pixel of a whole picture that is reconstructed, about: at least one of each sample."""


class Coarse(Value):
    """How coarse a picture is."""

    divisor: float = 1.0
    """Its width and height are divided by this."""
    rays: int = FEW_RAYS
    """Of each sample's obscurance, if the scene has any."""


class Reconstructed(Value):
    """All pixels and samples of the scene, with obscurance that is reconstructed from few rays."""

    rays: int
    """Of each sample's obscurance."""


Quality: TypeAlias = Coarse | Reconstructed | None
"""How good a picture is; None: as the scene asks for it."""


def stage(quality: Quality) -> str:
    """What the page calls a picture of this quality."""
    return "full" if quality is None else type(quality).__name__.lower()


def reconstructed(scene: Scene, camera: str) -> Reconstructed | None:
    """The quality between coarse and full; None where it would save few rays."""
    _, _, samples = scene.film_of(camera)
    rays = max(1, PIXEL_RAYS // samples)
    settings = scene.obscurance
    if settings is None or settings.reconstruct or settings.samples < 2 * rays:
        return None
    return Reconstructed(rays)


def scene_of(scene: Scene, camera: str, quality: Quality) -> Scene:
    """The scene whose picture from a camera has this quality."""
    if quality is None:
        return scene
    values: dict[str, object] = {}
    if isinstance(quality, Coarse):  # one sample for each pixel of a smaller picture
        view = scene.named_cameras()[camera]
        path = camera_path(scene, camera)
        scene = scene if scene.cameras or scene.camera else scene.model_copy(update={"camera": view})
        values |= {"film.adaptive": False, f"{path}.samples": 1}
        for name, pixels in zip(("width", "height"), scene.film_of(camera), strict=False):
            values[f"{path}.{name}"] = max(1, round(pixels / quality.divisor))
    if scene.obscurance is not None:
        values |= {"obscurance.samples": quality.rays, "obscurance.reconstruct": True}
    return with_values(scene, values)

"""Coarse pictures: of fewer pixels, samples and rays than the scene asks for."""

from __future__ import annotations

from illumcli.records import Value
from illumcli.scene.spec import Scene

RAYS = 8
"""Obscurance rays of a sample of a coarse picture, at most; its obscurance is reconstructed."""


class Coarse(Value):
    """How coarse a picture is."""

    divisor: float = 1.0
    """Its width and height are divided by this."""
    rays: int = RAYS


def coarse_scene(scene: Scene, camera: str, coarse: Coarse) -> Scene:
    """The scene with one sample for each pixel of a smaller picture, and few obscurance rays."""
    view = scene.named_cameras()[camera]
    size = {
        name: max(1, round((getattr(view, name) or getattr(scene.film, name)) / coarse.divisor))
        for name in ("width", "height")
    }
    seen = view.model_copy(update={**size, "samples": 1})
    changes: dict[str, object] = (
        {"cameras": {**scene.cameras, camera: seen}} if scene.cameras else {"camera": seen}
    )
    changes["film"] = scene.film.model_copy(update={"adaptive": False})
    if scene.obscurance is not None:
        few = {"samples": min(coarse.rays, scene.obscurance.samples), "reconstruct": True}
        changes["obscurance"] = scene.obscurance.model_copy(update=few)
    return scene.model_copy(update=changes)

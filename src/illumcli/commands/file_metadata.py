"""The metadata of the files that a render writes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from illumcli import __version__
from illumcli.film.develop import Target, how_to_read
from illumcli.render_graph.needs import reconstructs
from illumcli.render_space import RenderSpace

if TYPE_CHECKING:
    from illumcli.commands.work import Work


def metadata(work: Work, target: Target, space: RenderSpace) -> dict[str, Any]:
    """The metadata of a file; that of a band tells what its picture has."""
    scene = work.scene
    of_file = {
        "Software": f"illum {__version__}",
        "illum:version": __version__,
        "illum:content": target.content,
        "illum:camera": target.view.name,
        "illum:layers": ",".join(layer.name for layer in target.layers),
        "illum:samples": target.view.samples,
        "illum:seed": str(scene.seed),
        "illum:exposure": scene.film.exposure,
        "illum:obscurance_samples": scene.obscurance.samples if scene.obscurance else 0,
        "illum:obscurance_reconstructed": int(reconstructs(scene)),
        **how_to_read(target, space),
    }
    if target.rows is None:
        return of_file
    from illumcli.images.picture_bands import PICTURE, picture_text

    of_picture = {**of_file, "illum:content": target.picture}
    is_light = target.layers[0].kind == "light"
    channels = work.development.channels(target)
    return {**of_file, PICTURE: picture_text(target.view.height, channels, of_picture, is_light)}

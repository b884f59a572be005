"""Batch renderer for local illumination models and ambient obscurance, driven by YAML scenes.

The commands as functions, for programs and notebooks: nothing is imported before it is used.

>>> import illumcli as illum
>>> illum.render("scenes/teapot.yaml", {"film.width": 320})["beauty"]
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as in typing, whose import takes longer than that of this module
if TYPE_CHECKING:
    from typing import Any

    from illumcli.api.baking import bake
    from illumcli.api.brdfs import brdf
    from illumcli.api.comparing import compare
    from illumcli.api.model_records import models
    from illumcli.api.render import load, render
    from illumcli.api.sweeping import sweep
    from illumcli.errors import IllumError
    from illumcli.scene.frames import Frames
    from illumcli.scene.spec import (
        Adaptive,
        Ambient,
        DepthCue,
        Film,
        Filter,
        Grain,
        MeshFile,
        Normals,
        Object,
        Obscurance,
        Orthographic,
        Outputs,
        Perspective,
        Scene,
        Transform,
    )

__all__ = [
    "Adaptive",
    "Ambient",
    "DepthCue",
    "Film",
    "Filter",
    "Frames",
    "Grain",
    "IllumError",
    "MeshFile",
    "Normals",
    "Object",
    "Obscurance",
    "Orthographic",
    "Outputs",
    "Perspective",
    "Scene",
    "Transform",
    "__version__",
    "bake",
    "brdf",
    "compare",
    "load",
    "models",
    "render",
    "sweep",
]
__version__ = "0.3.0"

_PLACES = {
    "Frames": "scene.frames.Frames",
    "IllumError": "errors.IllumError",
    "bake": "api.baking.bake",
    "compare": "api.comparing.compare",
    "load": "api.render.load",
    "render": "api.render.render",
    "sweep": "api.sweeping.sweep",
}
_PACKAGES = ("brdf", "models")
"""Functions that are packages, too."""


def __getattr__(name: str) -> Any:
    """A function or class of the interface, imported when it is first used."""
    if name in _PACKAGES:
        return import_module(f"illumcli.{name}")
    place = _PLACES.get(name) or (name in __all__ and f"scene.spec.{name}")
    if not place:
        raise AttributeError(f"module 'illumcli' has no attribute '{name}'")
    module, _, inside = place.rpartition(".")
    return getattr(import_module(f"illumcli.{module}"), inside)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

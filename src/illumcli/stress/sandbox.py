"""The result of a check, and the folder in which scenes are rendered and their values counted."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError, InputError, LimitError
from illumcli.layers import NAMES, layer_of_channel
from illumcli.records import Value

Channels = dict[str, NDArray[np.float32]]


class CheckResult(Value):
    """One line of the suite's table."""

    case: str
    check: str
    worst: str
    passed: bool


class Sandbox:
    """A folder in which scenes are rendered, with counts of all values that were rendered."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pictures = self.pixels = self.values = self.not_finite = self.negative = 0

    def file(self, name: str, content: bytes) -> str:
        """Write a file into the sandbox; returns its name for scenes."""
        (self.folder / name).write_bytes(content)
        return name

    def render(
        self, scene: Mapping[str, Any], layers: Sequence[str] = NAMES, threads: int = 1
    ) -> tuple[Channels, bytes]:
        """Every channel of the scene's image, (H, W) float32 each, and the image file's bytes.

        The scene is rendered as `illum render` does it, from a file to an EXR in single precision, which is
        read back.

        Raises
        ------
        IllumError
            What `illum render` would end with.
        """
        from illumcli.commands.options import RenderJob, RenderOptions
        from illumcli.commands.render import render_scene
        from illumcli.images.reader import read_image

        self.pictures += 1
        outputs = {"layers": list(layers), "colour": "float"}
        path = self.folder / f"{self.pictures}.yaml"
        path.write_text(json.dumps({"version": 1, **scene, "outputs": outputs}))
        image = self.folder / f"{self.pictures}.exr"
        pattern = str(image).replace("{", "{{").replace("}", "}}")
        render_scene(RenderJob(path, RenderOptions(pattern=pattern, threads=threads, cache=False)))
        channels, data = read_image(image).channels, image.read_bytes()
        image.unlink()
        self._count(channels)
        return channels, data

    def bake(self, scene: Mapping[str, Any], rays: int) -> NDArray[np.float32]:
        """Obscurance baked at every vertex of the scene, one object after the other.

        Raises
        ------
        IllumError
            What `illum ao-bake` would end with.
        """
        from illumcli.baking.bake import bake_mesh
        from illumcli.baking.settings import BakeOptions, BakeSettings
        from illumcli.visibility.baked import read_npz

        path, baked = self.folder / "bake.yaml", self.folder / "bake.npz"
        path.write_text(json.dumps({"version": 1, **scene}))
        bake_mesh(path, [baked], BakeSettings(samples=rays), BakeOptions(threads=1, force=True))
        w = read_npz(baked).obscurance
        self.values += w.size
        self.not_finite += int(np.count_nonzero(~np.isfinite(w)))
        return w

    def _count(self, channels: Channels) -> None:
        self.pixels += next(iter(channels.values())).size
        for name, values in channels.items():
            self.values += values.size
            self.not_finite += int(np.count_nonzero(~np.isfinite(values)))
            if not layer_of_channel(name).signed:
                self.negative += int(np.count_nonzero(values < 0))


def faults(channels: Channels) -> list[str]:
    """Faults of an image: values that are not finite, negative light, shares or distances, shares above 1."""
    results = []
    for name, values in channels.items():
        layer = layer_of_channel(name)
        for fact, wrong in (
            ("not finite", ~np.isfinite(values)),
            ("below 0", np.zeros(1, bool) if layer.signed else values < 0),
            ("above 1", values > 1 if layer.kind == "share" else np.zeros(1, bool)),
        ):
            if wrong.any():
                results.append(f"{name} {fact} in {np.count_nonzero(wrong)} pixels")
    return results


def refusal(error: IllumError) -> str:
    """The first line of an error, and its exit code."""
    return f"exit {error.exit_code}: {str(error).splitlines()[0]}"


def is_refusal(error: IllumError) -> bool:
    """True if the input was refused before anything was rendered."""
    return isinstance(error, InputError | LimitError)

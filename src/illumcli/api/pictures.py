"""Rendered pictures as arrays, with what is known of them."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.file_metadata import metadata
from illumcli.commands.held_images import HeldImage
from illumcli.commands.image_store import ImageFiles
from illumcli.commands.targets import image_set
from illumcli.film.develop import Target
from illumcli.images.format import RESERVED
from illumcli.records import Record
from illumcli.schema.messages import suggestion

if TYPE_CHECKING:
    from illumcli.commands.work import Work

NO_PIXELS = np.zeros((0, 0, 0), np.float32)


class Picture(Mapping[str, NDArray[Any]]):
    """The layers of one camera by name: (H, W, C) float32, linear, premultiplied; ids are uint32.

    Arrays are read-only: copy one to change it.
    A notebook shows its first layer.
    """

    def __init__(self, image: HeldImage, audited: str | None) -> None:
        self._audited = audited  # the layer whose error was measured
        self._layers = image.layers()
        for each in self._layers.values():
            each.flags.writeable = False  # files of it state what they hold
        # Not the pixels, which are the layers once more, nor those of other renders.
        work = replace(image.work, images=ImageFiles())
        self._image = replace(image, work=work, pixels=NO_PIXELS)

    def __getitem__(self, layer: str) -> NDArray[Any]:
        if layer not in self._layers:
            raise KeyError(f"no layer {layer!r}; {suggestion(str(layer), tuple(self._layers))}")
        return self._layers[layer]

    def __iter__(self) -> Iterator[str]:
        return iter(self._layers)

    def __len__(self) -> int:
        return len(self._layers)

    def __repr__(self) -> str:
        view = self._image.target.view
        return f"<picture of {view.name}, {view.width} x {view.height}: {', '.join(self)}>"

    @property
    def work(self) -> Work:
        """What it was rendered from."""
        return self._image.work

    @property
    def camera(self) -> str:
        """The name of its camera."""
        return self._image.target.view.name

    @property
    def channels(self) -> dict[str, tuple[str, ...]]:
        """Layer -> the names of its channels in an EXR."""
        image = self._image
        return {layer.name: image.work.development.names(layer) for layer in image.target.layers}

    @property
    def metadata(self) -> dict[str, Any]:
        """What a file of it says, such as seed, samples and the measured error."""
        image = self._image
        return {**metadata(image.work, image.target, image.space), **image.texts}

    def display(self, layer: str | None = None) -> NDArray[np.uint8]:
        """(H, W, C) a layer in 8 bits, by default the first, as ``illum render`` writes it to a PNG.

        Light is sRGB with the scene's exposure, data are scaled to 0..255; an alpha comes last.
        """
        chosen = self._image.target.layers[0].name if layer is None else layer
        self[chosen]  # the error of another name
        return self._image.display(chosen, self._layers)

    def write(self, target: Target) -> None:
        """Write the file of an image set with its pixels."""
        image = self._image
        texts = image.texts if self._audited in {layer.name for layer in target.layers} else {}
        room = dict.fromkeys(texts, RESERVED)
        with ImageFiles().open(image.work, target, image.space, room) as file:
            file.write_band(0, image.work.development.encoded(target, self._layers, (0, 0), image.space))
            for name, text in texts.items():
                file.set_text(name, text)

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path, target = Path(folder) / "picture.png", self._image.target
            self.write(replace(target, path=path, layers=target.layers[:1]))
            return path.read_bytes()


class Rendering(Record, Mapping[str, NDArray[Any]]):
    """The pictures of a scene, one per camera, and the report.

    It is a mapping of the layers of the first picture, which a notebook shows.
    """

    pictures: dict[str, Picture]
    """By the name of their camera."""
    report: dict[str, Any]
    """What `--report` of ``illum render`` writes."""
    frame: int | None
    """The frame of an animation."""

    @classmethod
    def of(cls, images: Sequence[HeldImage], report: dict[str, Any]) -> Rendering:
        """The rendering of some images."""
        names = [image.target.view.name for image in images]
        audited = [report["audited_error"].get(name, {}).get("layer") for name in names]
        pictures = dict(zip(names, map(Picture, images, audited), strict=True))
        frame = images[0].work.job.frame
        return cls(pictures, report if frame is None else {"frame": frame, **report}, frame)

    def __repr__(self) -> str:
        seconds, rays = self.report["total_seconds"], sum(self.report["rays"].values())
        shown = " ".join(map(repr, self.pictures.values()))
        return f"<rendering in {seconds:.3g} s with {rays:,} rays: {shown}>"

    @property
    def picture(self) -> Picture:
        """The picture of the first camera."""
        return next(iter(self.pictures.values()))

    def __getitem__(self, layer: str) -> NDArray[Any]:
        return self.picture[layer]

    def __iter__(self) -> Iterator[str]:
        return iter(self.picture)

    def __len__(self) -> int:
        return len(self.picture)

    def display(self, layer: str | None = None) -> NDArray[np.uint8]:
        """(H, W, C) a layer of the first picture in 8 bits, as `Picture.display`."""
        return self.picture.display(layer)

    def save(self, pattern: str | os.PathLike[str], force: bool = False) -> list[Path]:
        """Write the files of ``illum render -o PATTERN``, with the same bytes. Returns their paths.

        Parameters
        ----------
        pattern : str
            Ends in `.exr`, with all layers, or `.png`, one for each layer; {camera}, {layer} and others are
            replaced.
        force : bool
            Replace files that differ.

        Raises
        ------
        InputError
            Another suffix; two files would have one name.
        OutputError
            A different file exists, or a file cannot be written.
        """
        work = self.picture.work
        job = replace(work.job, options=replace(work.job.options, pattern=os.fspath(pattern)))
        targets = image_set(job, work.loaded, work.graph, work.outputs)
        for target in ImageFiles().due(targets, force):
            self.pictures[target.view.name].write(target)
        return [target.path for target in targets]

    def _repr_png_(self) -> bytes:
        return self.picture._repr_png_()

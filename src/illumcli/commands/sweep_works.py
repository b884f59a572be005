"""The work of each variant of a sweep, and what the sweep keeps of it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.commands.held_works import HeldWorks
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep_outcome import PlannedImage, PlannedVariant
from illumcli.commands.targets import expanded
from illumcli.commands.unit import Worker
from illumcli.commands.work import Work
from illumcli.files.names import fields
from illumcli.film.channels import channel_count
from illumcli.film.develop import Target
from illumcli.scene.variants import Variant


class SweepWorks:
    """The units of a sweep and their works, one per variant; variants are numbered by their indices."""

    def __init__(self, path: Path, variants: Sequence[Variant], options: RenderOptions) -> None:
        self.path = path
        self.options = options
        self.worker = Worker()
        self._variants = variants
        self._held = HeldWorks(lambda index: self.worker.prepare(self.unit(index)))

    def unit(self, index: int) -> RenderJob:
        """The unit of work of a variant."""
        variant = self._variants[index]
        options = replace(self.options, overrides=tuple(variant.overrides), audit=False, shard=None)
        return RenderJob(self.path, options, variant.frame, fields=variant.fields)

    def of(self, index: int) -> Work:
        """The work of a variant, held until it is dropped."""
        return self._held.of(index)

    def drop(self, index: int) -> None:
        """Drop the work of a variant that is rendered."""
        self._held.drop(index)


def picture_name(target: Target) -> str:
    """The camera of an image, and its layer if it has only one."""
    return f"{target.view.name} {target.layers[0].name}" if target.is_png else target.view.name


def planned_variant(work: Work, reference: str = "") -> PlannedVariant:
    """The facts about a variant that a sweep keeps of its work; `reference` may be a pattern of names."""
    first = work.targets[0]
    layer = first.layers[0].name
    image = expanded(reference, work.job, work.loaded, first.view, layer) if fields(reference) else None
    return PlannedVariant(
        paths=tuple(target.path for target in work.targets),
        content=work.content,
        images=tuple(PlannedImage(sys.intern(picture_name(each)), each.content) for each in work.targets),
        height=first.view.height,
        width=first.view.width,
        channels=channel_count(work.development.channels(first)),
        exposure=work.scene.film.exposure,
        reference=image,
        is_due=bool(work.due()),
        claim=work.claim,
    )

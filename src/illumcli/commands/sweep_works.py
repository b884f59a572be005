"""The work of each variant of a sweep, and what the sweep keeps of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

from illumcli.cache.fingerprint import FileFingerprints
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep_outcome import Outcome, PlannedVariant
from illumcli.commands.sweep_reference import channel_count
from illumcli.commands.work import Work, work_of
from illumcli.scene.load import SceneText, load, read_text

HELD = 256
"""The work of so many variants is held from planning until rendering, some 80 kB each; later variants are
prepared twice."""


class SweepWorks:
    """Prepares the work of variants, and holds it until it is dropped.

    The scene and the files that it names are read once for all variants; later changes to them are ignored.
    """

    def __init__(self, path: Path, options: RenderOptions) -> None:
        self._path = path
        self.options = options
        self._files = FileFingerprints()
        self._held: dict[int, Work] = {}

    @cached_property
    def _text(self) -> SceneText:
        return read_text(self._path)

    def of(self, outcome: Outcome) -> Work:
        """The work of a variant."""
        if outcome.number not in self._held:
            overrides = tuple(outcome.variant.overrides)
            of_variant = replace(self.options, overrides=overrides, audit=False)
            job = RenderJob(self._path, of_variant, outcome.variant.fields)
            loaded = load(self._path, overrides, self._text)
            self._held[outcome.number] = work_of(job, loaded, self._files)
        return self._held[outcome.number]

    def drop(self, outcome: Outcome) -> None:
        """Drop the work of a variant; it is prepared again if it is needed again."""
        self._held.pop(outcome.number, None)


def planned_variant(work: Work) -> PlannedVariant:
    """The facts about a variant that a sweep keeps of its work."""
    first = work.targets[0]
    return PlannedVariant(
        paths=tuple(target.path for target in work.targets),
        content=work.content,
        image_content=first.content,
        height=first.view.height,
        width=first.view.width,
        channels=channel_count(work.development.channels(first)),
        exposure=work.scene.film.exposure,
        is_due=bool(work.due()),
    )

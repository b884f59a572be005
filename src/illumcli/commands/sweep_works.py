"""The work of each variant of a sweep, and what the sweep keeps of it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep_outcome import Outcome, PlannedImage, PlannedVariant
from illumcli.commands.targets import expanded
from illumcli.commands.unit import Worker
from illumcli.commands.work import Work, cost_of
from illumcli.files.names import fields
from illumcli.film.channels import channel_count
from illumcli.film.develop import Target
from illumcli.render_graph.costs import Cost, CostModel

HELD = 256
"""The work of so many variants is held from planning until rendering, some 80 kB each; later variants are
prepared twice."""


class SweepWorks:
    """The units of a sweep, one per variant; holds the work of each until it is dropped."""

    def __init__(self, path: Path, options: RenderOptions) -> None:
        self.path = path
        self.options = options
        self.worker, self._costs = Worker(), CostModel()
        self._held: dict[int, Work] = {}

    def unit(self, outcome: Outcome) -> RenderJob:
        """The unit of work of a variant."""
        overrides = tuple(outcome.variant.overrides)
        options = replace(self.options, overrides=overrides, audit=False, shard=None)
        return RenderJob(self.path, options, outcome.variant.frame, fields=outcome.variant.fields)

    def of(self, outcome: Outcome) -> Work:
        """The work of a variant."""
        if outcome.number not in self._held:
            self._held[outcome.number] = self.worker.prepare(self.unit(outcome))
        return self._held[outcome.number]

    def cost(self, outcome: Outcome) -> Cost:
        """The cost of a variant, and what it adds to that of the variant before."""
        return cost_of(self.of(outcome), self._costs)

    def drop(self, outcome: Outcome) -> None:
        """Drop the work of a variant; it is prepared again if it is needed again."""
        self._held.pop(outcome.number, None)


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

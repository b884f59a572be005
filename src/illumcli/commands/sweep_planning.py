"""Plan the variants of a sweep: their images and contents, before anything is rendered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from illumcli.commands.batch import Batch
from illumcli.commands.sweep_images import attempt
from illumcli.commands.sweep_names import refuse_equal_names
from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_works import SweepWorks, planned_variant
from illumcli.commands.unit_cost import cost_of
from illumcli.commands.unused import unused_keys
from illumcli.records import Record
from illumcli.render_graph.costs import Cost, CostModel
from illumcli.scene.variants import Variant


class SweepPlan(Record):
    """The variants of a sweep before the first ray."""

    outcomes: list[Outcome]
    """With the facts about every variant without a fault, or its error."""
    warnings: list[str]
    """About the scene, that all variants have."""
    costs: list[Cost]
    """Of each variant, if it is a shard that is planned."""


def plan_variants(works: SweepWorks, variants: Sequence[Variant], batch: Batch, reference: str) -> SweepPlan:
    """Plan every variant; `reference` may be a pattern of names."""
    assert works.options.pattern is not None
    refuse_equal_names(variants, works.options.pattern)
    warnings: list[str] | None = None
    costs, model = [Cost(0, 0)] * len(variants), CostModel()

    def planned(outcome: Outcome) -> Outcome:
        nonlocal warnings
        work = works.of(outcome.number - 1)
        outcome = replace(outcome, planned=planned_variant(work, reference))
        lines = unused_keys(work)
        warnings = lines if warnings is None else [line for line in warnings if line in lines]
        if works.options.shard is not None:
            costs[outcome.number - 1] = cost_of(work, model)
        return outcome

    outcomes = [Outcome(number, variant) for number, variant in enumerate(variants, 1)]
    outcomes = [attempt(outcome, planned, batch, _unsaid) for outcome in outcomes]
    return SweepPlan(outcomes, warnings or [], costs)


def _unsaid(outcome: Outcome) -> None:
    """Failures are told when it is known which variants are this process's."""

"""The time that a plan is expected to take, from the speeds of earlier runs on this machine."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from illumcli.cache.speeds import ELAPSED, Speeds
from illumcli.film.view import View
from illumcli.records import Value
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.schedule import Plan
from illumcli.scene.spec import Scene

REFINED_SHARE = 0.15
"""Typical share of the pixels of an adaptive picture that get all samples."""


class ExpectedTime(Value):
    """Seconds that plans are expected to take."""

    seconds: float
    """Elapsed, on the given number of threads."""
    runs: int
    """How many earlier runs that rests on; 0 if nothing is known."""
    unknown: tuple[str, ...]
    """Stages that no earlier run had; they come on top."""

    def as_data(self) -> dict[str, Any]:
        """The time for JSON."""
        return {"seconds": self.seconds, "runs": self.runs, "unknown": list(self.unknown)}


def units_of(plan: Plan) -> dict[str, float]:
    """`units` of the buffers that a plan computes."""
    once = {node.output for node in plan.once}
    first, end = plan.rows or (0, plan.view.height)
    return units(plan.graph.scene, replace(plan.view, height=end - first), plan.computed, once)


def units(scene: Scene, view: View, computed: Collection[str], once: Collection[str]) -> dict[str, float]:
    """Units of work by buffer: rays where any are traced, else samples, and 1 of buffers that are made once.

    Upper bounds of the rays, as if every sample hit something: speeds are relative to the same bounds.
    """
    each = view.samples if view.adaptive is None else 1 + REFINED_SHARE * view.stands_for
    samples = view.width * view.height * each
    rays = expected_rays(scene, (view,), set(computed))
    return {
        **{name: 1.0 if name in once else samples for name in computed},
        **{"hits" if name == "primary" else name: float(count) for name, count in rays.items()},
    }


def time_of(units: Mapping[str, float], speeds: Speeds, threads: int) -> ExpectedTime:
    """The time that units of work take, by stage."""
    known = {name: speeds.stages[name] for name in units if name in speeds.stages}
    busy = sum(units[name] * speed.seconds / speed.units for name, speed in known.items())
    whole = speeds.stages.get(ELAPSED)
    factor = whole.seconds / whole.units if whole is not None else 1.0
    unknown = tuple(name for name in units if name not in known)
    return ExpectedTime(busy * factor / threads, speeds.runs, unknown)

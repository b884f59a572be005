"""Explain the plan of a scene, and what all of its variants take."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from illumcli.cache.location import open_store
from illumcli.cache.recorder import Cache
from illumcli.cache.speeds import by_stage, read_speeds
from illumcli.commands.options import RenderOptions
from illumcli.commands.plan_variants import own_variants, planned_variants
from illumcli.commands.sweep_names import named
from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_works import SweepWorks
from illumcli.render_graph.execute import Run
from illumcli.render_graph.expected_time import time_of, units_of
from illumcli.render_graph.explain import plan_data
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.scene.variants import Variant

ONE = (Variant({}),)
"""A scene as it is."""


class ScenePlan:
    """The plan of a scene and its variants. Each variant is prepared once.

    Parameters
    ----------
    is_sweep : bool
        True for a plan of all variants, even if there is one, in which images have the names that
        `illum sweep` gives them; otherwise it is the plan of the first, and of all if there are several.
    """

    def __init__(
        self,
        path: Path,
        variants: Sequence[Variant] = ONE,
        options: RenderOptions | None = None,
        is_sweep: bool = False,
    ) -> None:
        options = options or RenderOptions()
        if is_sweep or options.pattern is not None or any(variant.values for variant in variants[1:]):
            options = named(path, variants, options)
        self._path, self._variants, self._options = path, variants, options
        self._is_of_all = is_sweep or len(variants) > 1
        self._expected: Mapping[str, int] = {}

    def parts(self) -> list[dict[str, Any]]:
        """The plan of each view of the scene; with a cache, of a run that loads what the store holds now.

        Raises
        ------
        InputError
            A variant has a fault.
        """
        options, works = self._options, SweepWorks(self._path, self._variants, self._options)
        own = own_variants(works, len(self._variants))
        first = works.of(own[0] if own else 0)
        store = open_store() if options.cache else None
        run = Run(cache=Cache(store), threads=options.threads or len(os.sched_getaffinity(0)))

        # Compute nothing: object bounds and cameras are known only if the store has them.
        graph = place_and_cull(first.graph, first.outputs, run, only_cached=True)
        plans = [plan_view(graph, first.outputs, view, run.cache, look=True) for view in graph.views]
        self._expected, speeds = expected_memory(first.loaded, first.scene), read_speeds(store)
        parts = []
        for plan in plans:
            time = time_of(by_stage(units_of(plan)), speeds, run.threads)
            part = plan_data(plan, self._expected)
            parts.append(part | {"whole": first.whole_because, "expected_time": time.as_data()})

        # What all variants take.
        if self._is_of_all:
            planned = planned_variants(works, [Outcome(at + 1, self._variants[at]) for at in own])
            self._expected = planned.most_memory
            for plan, part in zip(plans, parts, strict=True):
                camera = plan.view.name
                time = time_of(by_stage(planned.units[camera]), speeds, run.threads)
                part["variants"] = planned.as_data(camera, time)
                if options.shard is not None:
                    part["variants"] |= {"shard": str(options.shard), "of": len(self._variants)}
        return parts

    def refuse_too_large(self) -> None:
        """Raise LimitError if memory cannot hold the shapes, meshes and textures of a variant, once `parts`
        has seen them."""
        refuse_memory(0, 0, 0, self._expected, str(self._path))

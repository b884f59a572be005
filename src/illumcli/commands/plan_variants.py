"""What the variants of a scene compute together: buffers that are the same in several, and others."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from illumcli.cache.policy import is_kept
from illumcli.commands.shards import shard_of_each
from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_works import SweepWorks
from illumcli.commands.unit_cost import cost_of
from illumcli.commands.work import Work
from illumcli.errors import OutputError
from illumcli.records import Value
from illumcli.render_graph.costs import CostModel
from illumcli.render_graph.expected_time import ExpectedTime, units
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.keys import Keys
from illumcli.render_graph.limits import expected_memory
from illumcli.render_graph.schedule import once_and_tile


class PlannedVariants(Value):
    """The variants of a plan."""

    labels: tuple[str, ...]
    files: tuple[Path, ...]
    """Every image, whether it exists or not."""
    due: int
    """Number of variants with an image to write."""
    times: Mapping[str, Mapping[str, int]]
    """Camera -> buffer -> how often it is computed, if nothing is cached before."""
    rays: Mapping[str, Mapping[str, int]]
    """Camera -> upper bound of the rays of all variants, by purpose."""
    units: Mapping[str, Mapping[str, float]]
    """Camera -> units of work of all variants, by buffer."""
    most_memory: Mapping[str, int]
    """Expected memory of the variant that needs most [bytes]."""

    def as_data(self, camera: str, time: ExpectedTime) -> dict[str, Any]:
        """The variants for JSON, as one camera sees them."""
        return {
            "labels": list(self.labels),
            "files": [str(path) for path in self.files],
            "due": self.due,
            "times": dict(self.times[camera]),
            "expected_rays": dict(self.rays[camera]),
            "expected_time": time.as_data(),
        }


def own_variants(works: SweepWorks, count: int) -> list[int]:
    """The indices of the variants in the shard of the options; of all `count` without one."""
    shard, model = works.options.shard, CostModel()
    if shard is None:
        return list(range(count))
    costs = [cost_of(works.of(index), model) for index in range(count)]
    shards = shard_of_each(costs, shard.count)
    return [index for index, number in enumerate(shards) if number == shard.number]


def planned_variants(works: SweepWorks, outcomes: Iterable[Outcome]) -> PlannedVariants:
    """What variants compute, in the order in which they are rendered.

    A buffer counts again where it differs from the one of the variant before; one that may be kept on disk,
    only where it differs from all before.

    Raises
    ------
    InputError
        A variant has a fault.
    """
    labels, files, due = list[str](), dict[Path, None](), 0
    most_memory: Mapping[str, int] = {}
    times, rays, work_units = (defaultdict[str, Counter[str]](Counter) for _ in range(3))
    seen: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for outcome in outcomes:
        work = works.of(outcome.number - 1)
        works.drop(outcome.number - 1)
        expected = expected_memory(work.loaded, work.scene)
        most_memory = max(most_memory, expected, key=lambda each: sum(each.values()))
        labels.append(outcome.label)
        files |= dict.fromkeys(target.path for target in work.targets)
        due += _is_due(work)
        order = work.graph.topological_order([*(layer.buffer for layer in work.outputs), "alpha"])
        once = {node.output for node in once_and_tile(order)[0]}
        for view in work.graph.views:
            key_of, known = Keys(work.graph.nodes, view, ""), seen[view.name]
            new = [node.output for node in order if key_of(node.output) not in known[node.output]]
            for name in new:
                if not is_kept(name):
                    known[name].clear()
                known[name].add(key_of(name))
            times[view.name].update(new)
            rays[view.name].update(expected_rays(work.scene, (view,), set(new)))
            work_units[view.name].update(units(work.scene, view, new, once))
    return PlannedVariants(tuple(labels), tuple(files), due, times, rays, work_units, most_memory)


def _is_due(work: Work) -> bool:
    """True if some image has to be written; a different file in its place is told when it is rendered."""
    try:
        return bool(work.due())
    except OutputError:
        return True

"""Shards: the units of a command divided among processes that need not know of each other."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.render_graph.costs import Cost


def shard_of_each(costs: Sequence[Cost], count: int) -> list[int]:
    """The shard of each unit, from 1: the division whose most expensive shard costs least, of two; where both
    are equal the second most expensive one decides, and so on, and at last the first division is taken.

    In the first one, each unit, the most expensive first, goes to the shard that has least so far (Graham
    1969, longest processing time). In the other, shards are runs of units that follow each other, which share
    buffers, with the least possible greatest cost. Both depend on the costs alone.

    References
    ----------
    Graham, R. L. (1969). Bounds on multiprocessing timing anomalies. SIAM J. Appl. Math. 17(2).
    """
    divisions = _greedy(costs, count), _runs(costs, count)
    return min(divisions, key=lambda shards: sorted(loads(costs, shards, count), reverse=True))


def loads(costs: Sequence[Cost], shards: Sequence[int], count: int) -> list[int]:
    """The cost of each shard: of a unit whose predecessor is in the same shard, only what it adds to it."""
    costs_of_shards = [0] * count
    for number, (cost, shard) in enumerate(zip(costs, shards, strict=True)):
        follows = number > 0 and shards[number - 1] == shard
        costs_of_shards[shard - 1] += cost.after if follows else cost.alone
    return costs_of_shards


def _greedy(costs: Sequence[Cost], count: int) -> list[int]:
    shards, load = [0] * len(costs), [0] * count
    for unit in sorted(range(len(costs)), key=lambda unit: (-costs[unit].alone, unit)):
        least = load.index(min(load))
        shards[unit] = least + 1
        load[least] += costs[unit].alone
    return shards


def _runs(costs: Sequence[Cost], count: int) -> list[int]:
    # Bisect the least limit under which runs of units, each as long as it allows, are at most `count`.
    low = max((cost.alone for cost in costs), default=0)
    high = sum(cost.alone for cost in costs)
    while low < high:
        middle = (low + high) // 2
        if max(_filled(costs, middle), default=0) <= count:
            high = middle
        else:
            low = middle + 1
    return _filled(costs, low)


def _filled(costs: Sequence[Cost], limit: int) -> list[int]:
    """The shard of each unit, if a new shard begins where the next unit would exceed the limit."""
    shards: list[int] = []
    shard, load = 1, 0
    for cost in costs:
        if shards and load + cost.after <= limit:
            load += cost.after
        else:
            shard, load = shard + bool(shards), cost.alone
        shards.append(shard)
    return shards

"""How fast earlier runs were on this machine, by stage, kept in the cache."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import field

from illumcli.cache.fingerprint import digest
from illumcli.cache.store import Store
from illumcli.records import Value

FADING = 0.8
"""Weight that earlier runs keep for each new one."""


ELAPSED = "elapsed"
"""Stage of a whole run: its seconds times its threads; its units are the seconds within nodes."""


class Speed(Value):
    """Seconds for some units of work, both faded by `FADING` for each later run."""

    seconds: float = 0.0
    units: float = 0.0

    def then(self, seconds: float, units: float) -> Speed:
        """With one more run."""
        return Speed(FADING * self.seconds + seconds, FADING * self.units + units)


class Speeds(Value):
    """Stage -> its speed. Stages are nodes, `shadow:key` and `shadow:fill` being one."""

    stages: Mapping[str, Speed] = field(default_factory=dict)
    runs: int = 0

    def then(self, seconds: Mapping[str, float], units: Mapping[str, float]) -> Speeds:
        """With one more run; stages without units are left out."""
        new = {
            stage: self.stages.get(stage, Speed()).then(seconds[stage], units[stage])
            for stage in seconds.keys() & units.keys()
            if units[stage] > 0
        }
        return Speeds({**self.stages, **new}, self.runs + 1)


class SpeedRecorder:
    """Collects the speeds of the runs of a process, and keeps them at its end."""

    def __init__(self) -> None:
        self._runs: list[tuple[Mapping[str, float], Mapping[str, float]]] = []

    def add(self, seconds: Mapping[str, float], units: Mapping[str, float], elapsed: float) -> None:
        """Note a run.

        Parameters
        ----------
        seconds, units : mapping
            By node.
        elapsed : float
            Seconds of the whole run times its threads.
        """
        if units:
            within = by_stage({name: seconds[name] for name in seconds.keys() & units.keys()})
            whole = sum(within.values())
            self._runs.append(({**within, ELAPSED: elapsed}, {**by_stage(units), ELAPSED: whole}))

    def keep(self, store: Store) -> None:
        """Add the runs to what is kept."""
        if not self._runs:
            return
        speeds = read_speeds(store)
        for seconds, units in self._runs:
            speeds = speeds.then(seconds, units)
        self._runs.clear()
        keep_speeds(store, speeds)


def by_stage(values: Mapping[str, float]) -> dict[str, float]:
    """Sums of the values of nodes by stage."""
    sums: dict[str, float] = {}
    for name, value in values.items():
        stage = name.partition(":")[0]
        sums[stage] = sums.get(stage, 0.0) + value
    return sums


def read_speeds(store: Store | None) -> Speeds:
    """What is known of this machine; nothing if nothing was kept, or something else than speeds."""
    stored = store.read(_key()) if store is not None else None
    if stored is None:
        return Speeds()
    try:
        stages = stored.about["stages"]
        known = {str(stage): Speed(float(pair[0]), float(pair[1])) for stage, pair in stages.items()}
        return Speeds(known, int(stored.about["runs"]))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        return Speeds()


def keep_speeds(store: Store, speeds: Speeds) -> None:
    """Keep the speeds; of two runs that end at once the later one stays."""
    stages = {stage: [speed.seconds, speed.units] for stage, speed in speeds.stages.items()}
    store.save(_key(), {"buffer": "speeds", "stages": stages, "runs": speeds.runs}, [])


def _key() -> str:
    """The key of this machine's speeds: caches may be shared."""
    return digest(("speeds", platform.node(), platform.machine()))

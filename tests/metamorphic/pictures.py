"""Scenes to arrays in one process, and what two of them must have in common."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.layers import NAMES
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import RenderStats, Run
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load
from metamorphic.scenes import Case
from planned import layers_of

Pictures = dict[tuple[str, str], NDArray[np.float32]]
"""(camera, layer) -> (height, width, channels)."""

ALL = tuple(name for name in NAMES if name not in ("triangle_id", "error"))
"""Every layer but the one that needs all objects and the one that needs a fixed number of samples."""


def pictures(
    path: Path,
    overrides: Sequence[str] = (),
    layers: Sequence[str] = ALL,
    *,
    threads: int = 1,
    side: int | None = None,
    store: Store | None = None,
    memory: MemoryCache | None = None,
) -> Pictures:
    """Every view of a scene file as a render makes it, objects that nothing tells left out."""
    loaded = load(path, overrides)
    run = Run(RenderStats(), Cache(store, memory), threads)
    outputs = outputs_of(loaded.scene, layers)
    graph = place_and_cull(build(loaded.scene, loaded), outputs, run)
    out: Pictures = {}
    for view in graph.views:
        plan = plan_view(graph, outputs, view, run.cache)
        out |= {(view.name, name): values for name, values in layers_of(plan, run, side).items()}
    return out


class Studio:
    """Renders cases, each in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = itertools.count()

    def folder(self) -> Path:
        """A folder that nothing else uses."""
        return self._folder / f"{next(self._numbers)}"

    def __call__(self, case: Case, layers: Sequence[str] = ALL) -> Pictures:
        """The pictures of a case."""
        return pictures(case.write(self.folder()), layers=layers)


# --- what two pictures have in common ---------------------------------------------------------------------


def same(a: Pictures, b: Pictures, where: Mapping[str, NDArray[np.bool_]] | None = None) -> None:
    """Bit for bit; with `where` only at these pixels of each camera."""
    assert a.keys() == b.keys(), f"{sorted(a)} against {sorted(b)}"
    for (view, layer), values in a.items():
        other = b[view, layer]
        assert values.shape == other.shape, (view, layer)
        differ = (values.view(np.uint32) != other.view(np.uint32)).any(axis=-1)
        if where is not None:
            differ &= where[view]
        assert not differ.any(), _told(view, layer, values, other, differ, "no pixel may differ")


def close(
    a: Pictures,
    b: Pictures,
    where: Mapping[str, NDArray[np.bool_]] | None = None,
    share: float = 1e-4,
    outliers: int = 2,
) -> None:
    """Up to rounding: within `share` of the largest value, but for a few pixels at edges."""
    assert a.keys() == b.keys(), f"{sorted(a)} against {sorted(b)}"
    for (view, layer), values in a.items():
        other = b[view, layer]
        assert values.shape == other.shape, (view, layer)
        size = float(np.abs(values).max(initial=0))
        differ = (np.abs(values - other) > share * size).any(axis=-1)
        if where is not None:
            differ &= where[view]
        assert differ.sum() <= outliers, _told(view, layer, values, other, differ, f"{outliers} may differ")


def _told(view: str, layer: str, a: NDArray, b: NDArray, differ: NDArray[np.bool_], rule: str) -> str:
    worst = np.where(differ, np.abs(a - b).max(axis=-1), -1)
    y, x = np.unravel_index(int(np.argmax(worst)), worst.shape)
    return (
        f"{layer} of {view}: {int(differ.sum())} of {differ.size} pixels differ, {rule}; the most at "
        f"column {x}, row {y}: {a[y, x].tolist()} against {b[y, x].tolist()}"
    )


def light_layers(case: Case) -> tuple[str, ...]:
    """The names of the lights' own layers."""
    return tuple(light["name"] for light in case.scene["lights"])

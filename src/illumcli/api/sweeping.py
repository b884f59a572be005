"""Render the variants of a scene into a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from illumcli.api.html_tables import html_table
from illumcli.api.pictures import Rendering
from illumcli.api.render import LoadedScene, Options
from illumcli.api.scenes import AnyScene
from illumcli.commands.sweep_measures import MEASURES
from illumcli.errors import InputError
from illumcli.film.metrics import difference


class Sweep(Sequence[dict[str, Any]]):
    """A table of variants: a record for each, with its values by path and what was measured.

    Its records are what `pandas.DataFrame` takes.
    """

    def __init__(self, records: list[dict[str, Any]], renderings: list[Rendering]) -> None:
        self._records = records
        self.renderings = renderings
        """The pictures of each variant."""

    def __repr__(self) -> str:
        return f"<sweep of {len(self)} variants: {', '.join(self._records[0]) if self else ''}>"

    def _repr_html_(self) -> str:
        return html_table(self._records)

    @overload
    def __getitem__(self, index: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, index: slice) -> list[dict[str, Any]]: ...
    def __getitem__(self, index: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        return self._records[index]

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self._records)


def sweep(
    scene: AnyScene,
    values: Mapping[str, Iterable[Any]],
    *,
    together: bool = False,
    reference: int | Rendering | NDArray[Any] | None = None,
    **options: Unpack[Options],
) -> Sweep:
    """Render a scene with every value of some paths with every other; the last path varies fastest.

    Parameters
    ----------
    scene
        As `load` takes it.
    values : mapping of str to sequence
        Path in the scene -> its values: ``{"materials.clay.sigma": [0.1, 0.3, 0.5]}``.
    together : bool
        The first values of all paths, then the second ones, and so on.
    reference : int, Rendering or (H, W, C) array, optional
        The variant, from 0, or the picture whose first layer the variants are compared with.
    options
        See `Options`.

    Returns
    -------
    Sweep
        Records with the values, `seconds`, `rays`, the `mean` of the first layer, and with a reference its
        measures as ``illum compare`` has them.

    Raises
    ------
    InputError
        Values that are no sequence, or of different lengths and to go `together`; a `reference` that there is
        not, or of another size; faults of the scene with any of the values, before the first ray.
    """
    lists = {path: _several(path, each) for path, each in _by_path(values).items()}
    lengths = {path: len(each) for path, each in lists.items()}
    if together and len(set(lengths.values())) > 1:
        raise InputError(f"values of different lengths cannot go together: {lengths}")
    rows = zip(*lists.values(), strict=True) if together else product(*lists.values())
    variants = [dict(zip(lists, row, strict=True)) for row in rows]
    if isinstance(reference, np.integer):
        reference = int(reference)
    if isinstance(reference, int) and not -len(variants) <= reference < len(variants):
        raise InputError(f"reference {reference}: there are {len(variants)} variants, numbered from 0")

    # Render; buffers that no value touches are computed once.
    loaded = LoadedScene(scene)
    renderings = loaded.variants(variants, **options)

    # Measure.
    if isinstance(reference, int):
        reference = renderings[reference]
    against = _first_layer(reference) if isinstance(reference, Rendering) else reference
    records = []
    for variant, rendering in zip(variants, renderings, strict=True):
        layer, report = _first_layer(rendering), rendering.report
        measured: dict[str, Any] = {"seconds": report["total_seconds"], "rays": sum(report["rays"].values())}
        measured["mean"] = float(layer.mean(dtype=np.float64))
        if against is not None:
            shape = np.shape(against)
            if shape != layer.shape:
                raise InputError(f"{variant}: is {layer.shape}, but the reference {shape}; compare one size")
            differs = difference(np.asarray(against), layer, peak=None)
            measured |= {name: getattr(differs, name) for name in MEASURES}
        records.append(variant | measured)
    return Sweep(records, renderings)


def _by_path(values: Any) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        fact = f"must be a mapping from paths to their values, is of type {type(values).__name__}"
        raise InputError(f"values: {fact}; write {{'film.width': [160, 320]}}")
    return values


def _several(path: str, values: Any) -> list[Any]:
    """The values of a path, those of numpy as those of Python."""
    is_one = isinstance(values, str | Mapping) or (isinstance(values, np.ndarray) and values.ndim == 0)
    if is_one or not isinstance(values, Iterable):
        raise InputError(f"{path}: give its values as a list, [{values!r}]")
    listed = [each.tolist() if isinstance(each, np.generic) else each for each in values]
    if not listed:
        raise InputError(f"{path}: has no values; give at least one")
    return listed


def _first_layer(rendering: Rendering) -> NDArray[Any]:
    """The first layer of the first picture; its colours alone, if it has any."""
    layer = next(iter(rendering.picture.values()))
    return layer[..., :3] if layer.shape[-1] == 4 else layer

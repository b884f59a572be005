"""Materials of one formula that differ in numbers alone: evaluated together, with a number for each point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Ids, take_rows
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import may_vary
from illumcli.records import Record
from illumcli.schema.description import Description, nested, parts_of

Constant: TypeAlias = float | tuple[float, ...]
NOT_OF_LOBES = ("emission", "ambient")
"""Parameters that no lobe reads."""


class Batch(Record):
    """Materials whose lobes are the same functions of their parameters."""

    model: IlluminationModel
    """Of one of them."""
    differing: Mapping[str, NDArray[np.float64]]
    """Path -> (K,) numbers or (K, 3) colours of all of them; only parameters that are not the same in all."""

    def at(self, row: Ids) -> IlluminationModel:
        """The model with the parameters of its materials of these rows, one per point.

        Numbers stay in double precision, as a description has them: a lobe rounds them as it would round a
        single one.
        """
        if not self.differing:
            return self.model
        return self.model.at({path: take_rows(table, row) for path, table in self.differing.items()})


class Batches(Record):
    """The batch of every material, and the material's row in it."""

    every: tuple[Batch, ...]
    batch: Ids  # by material number
    row: Ids


def batches(models: Sequence[IlluminationModel]) -> Batches:
    """The materials by batches, in the order of their first material.

    A material with a texture or vertex values is alone.
    """
    # Materials with equal keys share a batch.
    members: dict[object, list[dict[str, Constant]]] = {}
    first: dict[object, IlluminationModel] = {}
    batch, row = np.zeros(len(models), np.int32), np.zeros(len(models), np.int32)
    order: dict[object, int] = {}
    for number, model in enumerate(models):
        constants: dict[str, Constant] = {}
        lobes = tuple((name, lobe.__name__) for name, lobe in model.lobes().items())
        parts = (type(model), lobes, *_parts(model, constants))
        key: object = number if model.varying() else parts
        first.setdefault(key, model)
        batch[number] = order.setdefault(key, len(order))
        row[number] = len(members.setdefault(key, []))
        members[key].append(constants)

    # Tables of the parameters that differ.
    every = []
    for key, each in members.items():
        paths = [path for path, value in each[0].items() if any(other[path] != value for other in each)]
        tables = {path: np.asfortranarray([other[path] for other in each], np.float64) for path in paths}
        every.append(Batch(first[key], tables))
    return Batches(tuple(every), batch, row)


def _parts(
    part: Description | Mapping[str, Any], constants: dict[str, Constant], prefix: str = ""
) -> Iterator[object]:
    """What materials of a batch have in common; adds the numbers and colours of lobes to `constants`."""
    for name, value in parts_of(part):
        path = prefix + name
        if path in NOT_OF_LOBES:
            continue
        if inner := nested(value):
            for step, each in inner.items():
                yield from _parts(each, constants, f"{path}{step}.")
        elif value is not None and (isinstance(part, Mapping) or may_vary(type(part), name)):
            constants[path] = value
            yield path
        else:
            yield path, value

"""A fitted model as a material of a scene: its keys, and the text to paste."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from illumcli.fitting.parameters import Doubles, Parameters
from illumcli.models._base import IlluminationModel
from illumcli.scene.yaml_text import flow
from illumcli.schema.annotations import is_tag
from illumcli.schema.description import Description
from illumcli.schema.fields import NAME

DIGITS = 5
"""Of values whose standard error is not known; others have a digit more than their error shows."""


def material_of(
    model: IlluminationModel, parameters: Parameters, x: Doubles, standard_error: Doubles
) -> dict[str, Any]:
    """The keys of a model: what was given, and the fitted parameters, rounded.

    Parameters
    ----------
    x, standard_error : ndarray
        (P,) coordinates, and standard errors of the values.
    """
    values: dict[str, Any] = {}
    for each, place in parameters.slices():
        pairs = zip(each.value(x[place]).tolist(), standard_error[place].tolist(), strict=True)
        rounded = [min(max(shown(value, error), each.low), each.high) for value, error in pairs]
        values[each.path] = rounded if each.width == 3 else rounded[0]
    values |= {path: values[source] for path, source in parameters.equal.items()}
    return _keys(model, values)


def shown(value: float, error: float) -> float:
    """A value with one digit more than its standard error has, at least two and at most ten in all."""
    if not value:
        return 0.0
    digits = DIGITS
    if np.isfinite(error) and error > 0:
        digits = int(np.clip(np.floor(np.log10(abs(value))) - np.floor(np.log10(error)) + 2, 2, 10))
    return float(f"{value:.{digits}g}")


def _keys(part: Description, values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name in type(part).model_fields:
        value, path = getattr(part, name), prefix + name
        if path in values:
            out[name] = values[path]
        elif isinstance(value, Description):
            if below := _keys(value, values, f"{path}."):
                out[name] = below
        elif isinstance(value, tuple) and value and isinstance(value[0], Description):
            out[name] = [_keys(each, values, f"{path}.{place}.") for place, each in enumerate(value)]
        elif name in part.model_fields_set or is_tag(type(part), name):
            out[name] = value
    return out


def materials_text(
    materials: Mapping[str, Mapping[str, Any]], undetermined: Mapping[str, Sequence[str]]
) -> str:
    """The `materials:` of a scene, with a comment on the parameters of each that are not determined."""
    lines = ["materials:"]
    for name, material in materials.items():
        lines.append(f"  {name}:")
        if undetermined[name]:
            lines.append(f"    # not determined by the measurement: {', '.join(undetermined[name])}")
        lines += [f"    {key}: {flow(value)}" for key, value in material.items()]
    return "\n".join(lines)


def name_of(stem: str) -> str:
    """A material's name from that of a file."""
    name = re.sub(r"[^\w-]+", "_", stem)
    return name if re.match(NAME, name) else f"_{name}"

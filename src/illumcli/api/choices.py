"""The options of functions, checked: what may be chosen, and in which range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeVar

import numpy as np

from illumcli.scene.faults import validated
from illumcli.scene.spec import Count, Seed
from illumcli.schema.description import Description
from illumcli.schema.fields import ListOf, Pair, Positive

D = TypeVar("D", bound=Description)


class RenderChoices(Description):
    """The options of `render`."""

    layers: ListOf[str] = ()
    seed: Seed | None = None
    threads: Count | None = None
    target_error: Positive | None = None
    cache: bool = True
    strict: bool = False


class BakeChoices(Description):
    """The options of `bake`; what `Obscurance` checks is left to it."""

    samples: Any = None
    target_error: Positive | None = None
    reconstruct: bool | None = None
    falloff: Any = "step"
    sampler: str = "spiral"
    faces: str = "count"
    method: Literal["vertex", "fit"] = "vertex"
    occluders: ListOf[str] = ("scene",)
    ground: str | None = None
    what: ListOf[str] = ("ao",)
    color: Literal["multiply", "replace", "r", "g", "b", "a"] | None = None
    split: bool = False
    texture: Pair[Count] | None = None
    bits: Literal[8, 16] = 8
    unwrap: Literal["missing", "all"] | None = None
    seed: Seed = 0
    threads: Count | None = None
    strict: bool = False


def chosen(cls: type[D], given: Mapping[str, Any], several: tuple[str, ...]) -> D:
    """The options that were given; None is one that was not, and numbers may be those of numpy.

    Parameters
    ----------
    several : tuple of str
        Options that are lists of texts, which one text may stand for.

    Raises
    ------
    InputError
        Every fault; an unknown option with the nearest one.
    """
    plain = {name: plain_number(each) for name, each in given.items() if each is not None}
    for name in several:
        if isinstance(plain.get(name), str):
            plain[name] = [plain[name]]
    return validated(cls, plain)


def plain_number(value: Any) -> Any:
    """A number of numpy as one of Python, 320.0 as 320, as columns of tables have them; others unchanged."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < 2**53
    return int(value) if is_whole else value

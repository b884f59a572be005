"""What a relation is: two ways to render a random scene that must agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Literal

from metamorphic.pictures import Studio
from metamorphic.scenes import Case

Kind = Literal["exact", "rounding", "statistical"]
"""How both ways agree: bit for bit; within a share of the layer's largest value, but for a few pixels at
edges; within several standard errors."""
Check = Callable[[Case, Random, Studio], None]
"""Narrows a case to the relation's premises, renders it in two or more ways and raises AssertionError where
they part."""


@dataclass(frozen=True)
class Relation:
    """A rule that every scene keeps."""

    kind: Kind
    check: Check

    @property
    def name(self) -> str:
        """What the rule says."""
        return self.check.__name__


def relation(kind: Kind) -> Callable[[Check], Relation]:
    """Make a relation of a check."""
    return lambda check: Relation(kind, check)

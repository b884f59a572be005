"""What all curves have: their value at a frame, as a scene would write it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeAlias

from illumcli.scene.frames import Moment
from illumcli.schema.description import Description

Over: TypeAlias = Literal["frame", "time"]
ReadFile: TypeAlias = Callable[[str], tuple[Path, str]]
"""Path of a file as the scene has it -> where it is, and its text. Raises ValueError."""


class Curve(Description):
    """A value that varies with the frame."""

    def key_at(self, moment: Moment) -> str | None:
        """The key of `keys` whose value holds as it is written; None if the value is computed."""
        return None

    def value_at(self, moment: Moment, read: ReadFile) -> Any:
        """The value, as numbers, text, lists and mappings.

        Raises
        ------
        ValueError
            There is none at this frame.
        """
        raise NotImplementedError


def rounded(value: float) -> int | float:
    """The number nearest to `value` that has 12 digits: what is printed of it is all there is."""
    value = float(f"{value:.12g}")
    return int(value) if value.is_integer() and abs(value) < 2**53 else value

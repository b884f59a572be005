"""The frames of an animation: which they are, and when each of them is."""

from __future__ import annotations

import re
from typing import Annotated, TypeAlias

from pydantic import Field, model_validator

from illumcli.errors import InputError
from illumcli.records import Value
from illumcli.schema.description import Description
from illumcli.schema.fields import Positive
from illumcli.schema.messages import short

LAST_FRAME = 2**53
"""Formulas of `frame` are computed in double precision."""
MAX_FRAMES = 100_000
FRAMES_PER_SECOND = 24.0

FrameNumber: TypeAlias = Annotated[int, Field(ge=0, le=LAST_FRAME)]


class Moment(Value):
    """What a curve is evaluated at."""

    frame: float
    """A whole number, unless a delay or rate shifts it."""
    time: float
    """frame / fps [s]."""
    fps: float = FRAMES_PER_SECOND


class Frames(Description):
    """The frames of an animation. `illum render` renders all of them, or those of `--frames`."""

    first: FrameNumber = 0
    """Number of the first frame."""
    last: FrameNumber
    """Number of the last frame, which is rendered too."""
    step: Annotated[int, Field(ge=1, le=LAST_FRAME)] = 1
    """Every frame, every second one, and so on."""
    fps: Positive = FRAMES_PER_SECOND
    """Frames per second: `time` is frame / fps [s], whichever frame is the first."""

    @model_validator(mode="after")
    def _is_not_too_long(self) -> Frames:
        if self.last < self.first:
            raise ValueError(f"last must be at least first, is {self.last} with first {self.first}")
        if len(self.numbers) > MAX_FRAMES:
            raise ValueError(f"{len(self.numbers)} frames are more than {MAX_FRAMES}; render them in parts")
        return self

    @property
    def numbers(self) -> range:
        """The numbers of the frames."""
        return range(self.first, self.last + 1, self.step)


def frame_numbers(text: str) -> range:
    """The frames that `FIRST:LAST` or `FIRST:LAST:STEP`, the argument of `--frames`, describes.

    Raises
    ------
    InputError
    """
    span = re.fullmatch(r"(\d+):(\d+)(?::(\d+))?", text, re.ASCII)
    if span and max(len(digits) for digits in span.groups("")) > len(str(LAST_FRAME)):
        raise InputError(f"--frames {short(text)}: frames are counted up to {LAST_FRAME}")
    first, last, step = (int(digits) for digits in span.groups("1")) if span else (0, -1, 1)
    if last < first or step == 0:
        advice = f"; the frame {text} alone is {text}:{text}" if text.isdigit() and text.isascii() else ""
        example = f"write FIRST:LAST or FIRST:LAST:STEP, as in 0:119{advice}"
        raise InputError(f"--frames {short(text)}: {short(example, 120)}")
    if last > LAST_FRAME:
        raise InputError(f"--frames {text}: frames are counted up to {LAST_FRAME}")
    return range(first, last + 1, step)

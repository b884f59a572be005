"""Outcomes of the variants of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.commands.report import Report
from illumcli.errors import IllumError
from illumcli.records import Record, Value
from illumcli.scene.variants import Variant


class PlannedImage(Value):
    """Facts about an image before it is rendered."""

    name: str
    """Its camera, and its layer where it has one of its own."""
    content: str
    """Hash of everything that its pixels depend on."""


class PlannedVariant(Value):
    """Facts about a variant before it is rendered. It holds no scene: a sweep has up to 100,000 variants."""

    paths: tuple[Path, ...]
    content: str
    """Hash of everything that the pixels of its images depend on."""
    images: tuple[PlannedImage, ...]
    """One for each path."""
    height: int
    width: int
    channels: int
    """Channels of the first image that are compared: 3 for colours, otherwise 1."""
    exposure: float
    reference: Path | None
    """The image that its first one is compared with, where that is named by a pattern."""
    is_due: bool
    """True if some image has to be written."""
    claim: Path | None
    """Held while they are written."""

    @property
    def image_content(self) -> str:
        """Hash for its first image alone."""
        return self.images[0].content


class Outcome(Record):
    """The state of one variant."""

    number: int
    """From 1."""
    variant: Variant
    planned: PlannedVariant | None = None
    """None if the scene has a fault with these values."""
    report: Report | None = None
    """Set once the images are rendered or kept."""
    error: IllumError | None = None

    @property
    def label(self) -> str:
        """The name of the variant in messages."""
        return self.variant.label or f"variant {self.number}"

    @property
    def paths(self) -> tuple[Path, ...]:
        """The images of the variant."""
        return self.planned.paths if self.planned else ()

    @property
    def claim(self) -> Path | None:
        """The path of the claim on the variant, where some image has to be written."""
        return self.planned.claim if self.planned and self.planned.is_due else None


def following_due(outcomes: Sequence[Outcome]) -> list[int | None]:
    """For each variant, the index of the next one with images to render; None if there is none."""
    following: list[int | None] = []
    upcoming: int | None = None
    for index in reversed(range(len(outcomes))):
        following.append(upcoming)
        planned = outcomes[index].planned
        upcoming = index if planned is not None and planned.is_due else upcoming
    return following[::-1]


class SweepResult(Record):
    """The result of a sweep."""

    outcomes: tuple[Outcome, ...]
    kept: tuple[Path, ...]
    """Those files about all variants that existed with the same content."""
    warnings: tuple[str, ...]
    summary: str
    """Which variants are nearest to their references and farthest from them; empty if nothing is compared."""
    seconds: float

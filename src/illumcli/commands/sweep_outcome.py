"""Outcomes of the variants of a sweep."""

from __future__ import annotations

from pathlib import Path

from illumcli.commands.report import Report
from illumcli.errors import IllumError
from illumcli.records import Record, Value
from illumcli.scene.variants import Variant


class PlannedVariant(Value):
    """What is known of a variant before it is rendered. It holds no scene: a sweep has up to 100,000."""

    paths: tuple[Path, ...]
    content: str
    """Hash of all that the pixels of its images depend on."""
    image_content: str
    """The same of its first image."""
    height: int
    width: int
    channels: int
    """Of the first image: 3 for colours, else 1."""
    exposure: float
    is_due: bool
    """Is some image not there yet with the same content?"""


class Outcome(Record):
    """The state of one variant."""

    number: int
    """From 1."""
    variant: Variant
    planned: PlannedVariant | None = None
    """None where the scene has a fault with these values."""
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


class SweepResult(Record):
    """The result of a sweep."""

    outcomes: tuple[Outcome, ...]
    kept: tuple[Path, ...]
    """Those files about all variants that existed with the same content."""
    warnings: tuple[str, ...]
    seconds: float

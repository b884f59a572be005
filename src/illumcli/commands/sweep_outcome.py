"""What becomes of the variants of a sweep."""

from __future__ import annotations

from pathlib import Path

from illumcli.commands.report import Report
from illumcli.commands.work import Work
from illumcli.errors import IllumError
from illumcli.records import Record
from illumcli.scene.variants import Variant


class Outcome(Record):
    """What became of one variant so far."""

    number: int
    """From 1."""
    variant: Variant
    work: Work | None = None
    """None where the scene has a fault with these values."""
    is_due: bool = False
    """Is some image not there yet with the same content?"""
    report: Report | None = None
    """Once it is rendered, or kept."""
    error: IllumError | None = None

    @property
    def label(self) -> str:
        """The name of the variant in messages."""
        return self.variant.label or f"variant {self.number}"

    @property
    def paths(self) -> list[Path]:
        """The images of the variant."""
        return [target.path for target in self.work.targets] if self.work else []


class SweepResult(Record):
    """What became of a sweep."""

    outcomes: tuple[Outcome, ...]
    kept: tuple[Path, ...]
    """Of the files about all variants, those that were the same already."""
    warnings: tuple[str, ...]
    seconds: float

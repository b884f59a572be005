"""The files about all variants of a sweep: contact sheet, table, report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.fingerprint import digest, file_digest
from illumcli.commands.render import channels
from illumcli.errors import InputError, OutputError
from illumcli.files.outputs import INCOMPLETE, is_complete, is_kept, refresh, refuse_suffix
from illumcli.files.reports import report_contents, sealed_csv, sealed_json
from illumcli.images.contents import image_contents
from illumcli.memory import refuse_beyond
from illumcli.records import Record, Value

if TYPE_CHECKING:
    from illumcli.commands.sweep import Outcome

LONGEST_NUMBER = 9
"""Digits of a variant's number; what is longer is the name of a file."""
SHEET_BYTES = 9
"""Of each pixel of a contact sheet: three colours, as cells, as rows and as a whole."""


class Files(Value):
    """What a sweep is to write about all its variants."""

    sheet: Path | None = None
    table: Path | None = None
    report: Path | None = None
    reference: str | None = None
    """What errors in the table are against: a variant's number, or an image file."""


class Reference(Record):
    """A picture that others are compared with."""

    content: str
    number: int | None = None
    """Of the variant whose picture it is."""
    pixels: NDArray[np.float32] | None = None
    """(H, W, 1 or 3) of another image."""


class ToWrite(Value):
    """The files and what they will hold."""

    files: Files
    reference: Reference | None
    contents: dict[int, str]
    """By the variants' numbers; those that failed have none."""
    kept: tuple[Path, ...]

    def write(self, outcomes: Sequence[Outcome]) -> list[str]:
        """Write all but those that are kept; what is to be told of those that failures spare."""
        from illumcli.files.atomic import write_text

        files, spared = self.files, []
        if files.table is not None and files.table not in self.kept:
            write_text(files.table, table(outcomes, self._contents(outcomes), self.reference))
        if files.sheet is not None and files.sheet not in self.kept:
            content = _of_all(self._contents(outcomes))
            if content == INCOMPLETE and is_complete(files.sheet, image_contents):
                spared.append(f"{files.sheet}: stays as it is; a new one would lack pictures")
            else:
                sheet(outcomes, files.sheet, content)
        if files.report is not None and files.report not in self.kept:
            entries = report_data(outcomes, self._contents(outcomes))
            write_text(files.report, sealed_json(entries, in_a_list=True))
        for path in self.kept:
            refresh(path)
        return spared

    def _contents(self, outcomes: Sequence[Outcome]) -> list[str]:
        return [
            self.contents[outcome.number] if outcome.report is not None else INCOMPLETE
            for outcome in outcomes
        ]


def checked(files: Files, outcomes: Sequence[Outcome], force: bool) -> ToWrite:
    """What is to be written, after looking at all that could stand against it; nothing is rendered yet.

    Raises
    ------
    InputError
        A reference that is not there, is none or does not fit; a suffix that is not written.
    OutputError
        A file that cannot be written; another file in its place, unless `force` is given.
    LimitError
        A contact sheet that does not fit into memory.
    """
    for path, what, suffix in (
        (files.sheet, "a contact sheet", ".png"),
        (files.table, "a table", ".csv"),
        (files.report, "a report", ".json"),
    ):
        if path is not None:
            refuse_suffix(path, what, suffix)
    if files.sheet is not None:
        refuse_large_sheet(files.sheet, outcomes)
    reference = None if files.reference is None else reference_of(files.reference, outcomes)
    contents = {
        outcome.number: digest(
            (
                dict(outcome.variant.values),
                outcome.variant.frame,
                [str(path) for path in outcome.paths],
                outcome.work.content,
                reference.content if reference else None,
            )
        )
        for outcome in outcomes
        if outcome.work is not None
    }
    each = [contents.get(outcome.number, INCOMPLETE) for outcome in outcomes]
    held = (
        (files.table, each, report_contents),
        (files.sheet, [_of_all(each)], image_contents),
        (files.report, each, report_contents),
    )
    kept = tuple(path for path, named, read in held if path is not None and is_kept(path, named, read, force))
    return ToWrite(files, reference, contents, kept)


def refuse_large_sheet(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Raise LimitError where the pictures of a contact sheet, all as high as the highest, are too much."""
    from illumcli.images.contact_sheet import CELL_WIDTH

    views = [outcome.work.targets[0].view for outcome in outcomes if outcome.work is not None]
    tallest = max((CELL_WIDTH * view.height // view.width for view in views), default=0)
    size = SHEET_BYTES * len(views) * CELL_WIDTH * (tallest + CELL_WIDTH // 8)
    what = f"{path}: a sheet of {len(views)} pictures, {CELL_WIDTH} x {tallest} pixels each"
    refuse_beyond(size, what, "leave --sheet out, or sweep in parts")


def _of_all(contents: Sequence[str]) -> str:
    """The content of a file about all variants: as good as none where one of them failed."""
    return INCOMPLETE if INCOMPLETE in contents else digest(contents)


def reference_of(said: str, outcomes: Sequence[Outcome]) -> Reference:
    """The picture that `--reference` names: a variant's first one, by its number or its file, or an image."""
    planned = {outcome.number: outcome.work for outcome in outcomes if outcome.work is not None}
    number = int(said) if said.isascii() and said.isdecimal() and len(said) <= LONGEST_NUMBER else None
    if number is not None and not 1 <= number <= len(outcomes):
        raise InputError(f"--reference {said}: there are variants 1 to {len(outcomes)}")
    if number is not None and number not in planned:
        raise InputError(f"--reference {said}: this variant has a fault; take another")
    own = [each for each, work in planned.items() if work.targets[0].path == Path(said)]
    pixels = None
    if number is None and own:
        number = own[0]
    if number is not None:
        target, scene = planned[number].targets[0], planned[number].scene
        content = target.content
        like = (target.view.height, target.view.width, _count(channels(scene, target)))
        encoded = target.path.suffix.lower() == ".png"
    else:
        pixels, encoded = colors(Path(said))
        content, like = file_digest(Path(said)), pixels.shape

    problems = []
    for work in planned.values():
        target = work.targets[0]
        size = (target.view.height, target.view.width, _count(channels(work.scene, target)))
        name = f"--reference {said}: {target.path}"
        if size[:2] != like[:2]:
            problems.append(f"{name} is {size[1]} x {size[0]}, the reference {like[1]} x {like[0]}")
        elif size != like:
            problems.append(f"{name} has {size[2]} channels, the reference {like[2]}")
        elif encoded != (target.path.suffix.lower() == ".png"):
            kinds = "linear light", "display values"
            problems.append(f"{name} holds {kinds[not encoded]}, the reference {kinds[encoded]}")
    if problems:
        raise InputError(f"{problems[0]}; take a picture of the same kind and size")
    return Reference(content, number, pixels)


def _count(names: Sequence[str] | dict[str, Any]) -> int:
    return 3 if {"R", "G", "B"} <= set(names) else 1


def colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """(H, W, 3) or (H, W, 1) an image's R G B, or its first channel where it has none; are they encoded?"""
    from illumcli.images.reader import read_image

    image = read_image(path)
    found = image.channels
    names = ("R", "G", "B") if _count(found) == 3 else (next(iter(found)),)
    return np.stack([found[name] for name in names], axis=-1), image.encoded


def written_colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """`colors` of a picture that this sweep wrote.

    Raises
    ------
    OutputError
        It is there no more.
    """
    try:
        return colors(path)
    except InputError as error:
        raise OutputError(f"{path}: was written, and others took it away; run the sweep again") from error


def table(outcomes: Sequence[Outcome], contents: Sequence[str], reference: Reference | None) -> str:
    """CSV: a line per variant with its values, file, content, seconds, rays, mean light and, against
    `reference`, RMSE and largest difference of its first file."""
    from illumcli.film.metrics import difference

    paths = list(dict.fromkeys(name for outcome in outcomes for name in outcome.variant.values))
    against = None
    if reference is not None:
        own = [outcome.paths[0] for outcome in outcomes if outcome.number == reference.number]
        against = written_colors(own[0])[0] if own else reference.pixels
    measures = ["mean"] + (["rmse", "largest"] if reference is not None else [])
    columns = ["variant", "frame", *paths, "file", "content", "state", "seconds", "rays", "reused", *measures]
    rows = []
    for outcome, content in zip(outcomes, contents, strict=True):
        report = outcome.report
        state = "failed" if report is None else "rendered" if report.written else "kept"
        reused = sum(len(names) for names in report.reused.values()) if report else 0
        row: list[Any] = [
            outcome.number, outcome.variant.frame, *(outcome.variant.values.get(p, "") for p in paths),
            outcome.paths[0] if outcome.paths else "", content, state,
            f"{report.total_seconds:.4f}" if report else "",
            sum(report.rays.values()) if report else "", reused,
        ]  # fmt: skip
        if report is not None:
            picture, _ = written_colors(outcome.paths[0])
            row.append(f"{picture.mean(dtype=np.float64):.9g}")
            if against is not None:
                apart = difference(against, picture)
                row += [f"{apart.rmse:.9g}", f"{apart.largest:.9g}"]
        rows.append(row)
    return sealed_csv(columns, rows)


def sheet(outcomes: Sequence[Outcome], path: Path, content: str) -> None:
    """Write a contact sheet: the first picture of every variant that has one, with its values below."""
    from illumcli.film.encode import picture
    from illumcli.images.contact_sheet import write_contact_sheet

    def shown(outcome: Outcome) -> NDArray[Any]:
        assert outcome.work is not None
        light, encoded = written_colors(outcome.paths[0])
        if encoded:
            return np.rint(light * 255).astype(np.uint8)
        return picture(light, outcome.work.scene.film.exposure, 8, str(outcome.paths[0]))

    done = [outcome for outcome in outcomes if outcome.report is not None]
    labels = [outcome.variant.label or f"frame {outcome.variant.frame}" for outcome in done]
    write_contact_sheet(path, map(shown, done), labels, content)


def report_data(outcomes: Sequence[Outcome], contents: Sequence[str]) -> list[dict[str, Any]]:
    """Every variant's report, with its values."""
    return [
        {"values": dict(outcome.variant.values), "frame": outcome.variant.frame, "content": content}
        | (outcome.report.as_data() if outcome.report else {"error": str(outcome.error)})
        for outcome, content in zip(outcomes, contents, strict=True)
    ]

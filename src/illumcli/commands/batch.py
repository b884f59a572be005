"""Several pieces of work: if one fails, its error is reported and the others are done."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from illumcli.commands.report import report_text
from illumcli.errors import IllumError, OutputError, known
from illumcli.files.atomic import is_full, write_text
from illumcli.files.outputs import INCOMPLETE, is_kept, refresh, refuse_suffix
from illumcli.files.reports import report_contents

Tell = Callable[[str], None]


class Batch:
    """`count` pieces of work, called `what`, and their failures; `tell` gets the text of each failure.

    Without `keep_going` the pieces after one that failed are not done, and none after one that found the disk
    full. The error of a single piece is raised.
    Failures of pieces that are left to others (`leave_all_but`) do not count.
    """

    def __init__(self, what: str, count: int, keep_going: bool, tell: Tell) -> None:
        self.failures: dict[int, IllumError] = {}
        self.count = count
        self.what = what
        self._own = set(range(count))
        self._keep_going, self._tell = keep_going, tell
        self._is_full = False

    def due(self) -> Iterator[int]:
        """The indices of the pieces that have not failed, until the batch has to stop."""
        return (number for number in range(self.count) if self.is_due(number))

    def is_due(self, number: int) -> bool:
        """False for a piece that has failed, or that comes after one whose failure stops the batch."""
        stops = self._is_full or (self.failures and not self._keep_going and number > min(self.failures))
        return not stops and number not in self.failures and number in self._own

    @property
    def own_count(self) -> int:
        """Number of pieces that are not left to others."""
        return len(self._own)

    def leave_all_but(self, own: Collection[int]) -> None:
        """Leave all other pieces to other processes."""
        self._own = set(own)
        self.failures = {number: error for number, error in self.failures.items() if number in self._own}

    @property
    def is_lost(self) -> bool:
        """True if nothing is left to do because of failures."""
        return bool(self.failures) and (not self._keep_going or self.failures.keys() >= self._own)

    @contextmanager
    def piece(self, number: int, label: str = "") -> Iterator[None]:
        """Note an error inside as a failure of this piece; its text follows the label."""
        try:
            yield
        except Exception as error:
            failure = known(error)
            if failure is None or self.count == 1:
                raise
            self.failures[number] = failure
            self._is_full |= isinstance(failure, OutputError) and is_full(failure)
            self._tell(f"{label}: {failure}" if label else str(failure))

    def finish(self, *also: str) -> None:
        """If pieces failed, raise their number and the lines of `also`, with the exit code of the first."""
        if self.failures:
            failed = f"{len(self.failures)} of {len(self._own)} {self.what} failed"
            if self._is_full:
                failed = f"{failed}; no space is left, so no others were started"
            error = IllumError("\n".join([failed, *also]))
            error.exit_code = self.failures[min(self.failures)].exit_code
            raise error


class BatchReport:
    """The report of a batch: an entry for each piece, with the content that the piece was planned to have.

    `path` is None if no report is written.
    """

    def __init__(self, path: Path | None, entries: list[dict[str, Any]]) -> None:
        self._path, self._entries = path, entries
        self._contents = [INCOMPLETE] * len(entries)
        self._is_kept = False

    def plan(self, number: int, content: str) -> None:
        """Set the content that a piece will have."""
        self._contents[number] = content

    def look(self, force: bool) -> None:
        """Check whether a report of the same content exists; without `force` refuse a different file."""
        if self._path is not None:
            refuse_suffix(self._path, "a report", ".json")
            self._is_kept = is_kept(self._path, self._contents, report_contents, force)

    def add(self, number: int, entry: dict[str, Any]) -> None:
        """Set the entry of a finished piece."""
        self._entries[number] = entry

    def finish(self, batch: Batch) -> list[Path]:
        """Write the report and end the batch. Returns its path if the existing one is kept."""
        self.write(batch.failures)
        batch.finish()
        return [self._path] if self._path is not None and self._is_kept else []

    def write(self, failures: Mapping[int, Exception]) -> bool:
        """Write the report, or refresh the date of the existing one. True if that is kept.

        A report of the same contents is replaced if a piece failed this time.
        """
        for number, failure in failures.items():
            self._contents[number] = INCOMPLETE
            self._entries[number] |= {"content": INCOMPLETE, "error": str(failure)}
        if self._path is not None and self._is_kept and not failures:
            refresh(self._path)
            return True
        if self._path is not None:
            pairs = zip(self._entries, self._contents, strict=True)
            write_text(self._path, report_text([entry | {"content": content} for entry, content in pairs]))
        return False

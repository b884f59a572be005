"""What is kept between runs: list it, verify it, take some or all of it away."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

from illumcli.errors import InputError, OutputError
from illumcli.files.store import Entry, Refused, Store, described, size_of
from illumcli.jobs.render import opened_store
from illumcli.records import Value


class Listing(Value):
    """The entries of the store and how much they may take."""

    folder: Path
    limit: int
    entries: tuple[tuple[Entry, str], ...]
    """With the buffer that each holds, the least recently used first."""

    @property
    def bytes(self) -> int:
        return sum(entry.bytes for entry, _ in self.entries)


def listing() -> Listing:
    """What the store holds."""
    store = _opened()
    found = []
    for entry in store.entries():
        try:
            found.append((entry, str(described(entry.path)["about"]["buffer"])))
        except FileNotFoundError:
            continue
        except (OSError, Refused, KeyError, TypeError):  # the last two: a description of something else
            found.append((entry, "damaged"))
    return Listing(store.folder, store.limit, tuple(found))


def table(found: Listing) -> str:
    """A line per entry, and the sum."""
    now = time.time()
    lines = [
        f"{entry.bytes:>14,}  {ago(now - entry.used):>8}  {entry.key}  {buffer}"
        for entry, buffer in found.entries
    ]
    total = f"{found.bytes:,} of {found.limit:,} bytes in {len(found.entries)} entries, {found.folder}"
    return "\n".join([*lines, total])


def ago(seconds: float) -> str:
    """How long ago, in one unit."""
    for size, unit in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(seconds, 0):.0f} s"


def verify() -> tuple[int, dict[Path, str]]:
    """The number of sound entries, and what is wrong with the others, which are removed."""
    store = _opened()
    count = len(store.entries())
    faults = store.faults()
    for path in faults:
        _remove(path)
    return count - len(faults), faults


def prune(size: str | None = None) -> list[Entry]:
    """Take the least recently used entries away until the rest has at most `size`, the limit by default."""
    store = _opened()
    try:
        limit = store.limit if size is None else size_of(size)
    except ValueError:
        raise InputError(f"--size {size}: write it as 500M or 4G") from None
    return _pruned(store, limit)


def clear() -> list[Entry]:
    """Take everything away."""
    return _pruned(_opened(), 0)


def _opened() -> Store:
    store = opened_store()
    if store is None:
        raise InputError("there is no home folder to keep anything in; name one by ILLUM_CACHE")
    return store


def _pruned(store: Store, limit: int) -> list[Entry]:
    try:
        return store.prune(limit)
    except OSError as error:
        raise OutputError(f"{store.folder}: {error.strerror or error}; check its permissions") from error


def _remove(path: Path) -> None:
    with contextlib.suppress(FileNotFoundError):
        try:
            path.unlink()
        except OSError as error:
            raise OutputError(f"{path}: {error.strerror or error}; check its permissions") from error

"""The cache on disk: list, verify, prune or remove its entries."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from illumcli.cache.entry import Refused, described
from illumcli.cache.location import open_store, size_of
from illumcli.cache.store import Entry, Pruned, Store, distrust, removed
from illumcli.errors import InputError, OutputError
from illumcli.records import Value


class Listing(Value):
    """The entries of the store, and their limit [bytes]."""

    folder: Path
    limit: int
    entries: tuple[tuple[Entry, str], ...]
    """Each with the name of its buffer, the least recently used first."""

    @property
    def bytes(self) -> int:
        return sum(entry.bytes for entry, _ in self.entries)


def listing() -> Listing:
    """The entries of the store."""
    store = _opened()
    entries = []
    for entry in store.entries():
        try:
            buffer = described(entry.path)["about"]["buffer"]
        except FileNotFoundError:
            continue
        except (OSError, Refused, LookupError, TypeError):  # the last two: the description of another file
            buffer = None
        # The name is printed: control characters in a forged one could move the terminal's cursor.
        is_name = isinstance(buffer, str) and buffer.isprintable()
        entries.append((entry, str(buffer) if is_name else "damaged"))
    return Listing(store.folder, store.limit, tuple(entries))


def table(listed: Listing) -> str:
    """A line per entry, and the sum."""
    now = time.time()
    lines = [
        f"{entry.bytes:>14,}  {ago(now - entry.used):>8}  {entry.key}  {buffer}"
        for entry, buffer in listed.entries
    ]
    total = f"{listed.bytes:,} of {listed.limit:,} bytes in {len(listed.entries)} entries, {listed.folder}"
    return "\n".join([*lines, total])


def ago(seconds: float) -> str:
    """A time span in its largest unit."""
    for size, unit in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(seconds, 0):.0f} s"


class Verified(Value):
    """The result of verifying all entries."""

    sound: int
    """Number of entries without a fault."""
    faults: Mapping[Path, str]
    """Entry -> what is wrong with it."""
    stayed: Mapping[Path, str]
    """Those of `faults` that could not be removed, and why."""


def verify() -> Verified:
    """Read every entry and remove those with faults."""
    store = _opened()
    count = len(store.entries())
    faults = store.faults()
    stayed = {path: fact for path in faults if (fact := removed(path)) is not None}
    return Verified(count - len(faults), faults, stayed)


def prune(size: str | None = None) -> Pruned:
    """Remove the least recently used entries until the rest has at most `size`, by default the limit."""
    store = _opened()
    try:
        return store.prune(store.limit if size is None else size_of(size))
    except ValueError:
        raise InputError(f"--size {size}: write it as 500M or 4G") from None


def clear() -> Pruned:
    """Remove all entries."""
    return _opened().prune(0)


def refuse_stayed(stayed: Mapping[Path, str]) -> None:
    """Raise OutputError if entries could not be removed."""
    if stayed:
        lines = [f"{path}: cannot be removed: {fact}; check its permissions" for path, fact in stayed.items()]
        raise OutputError("\n".join(lines))


def _opened() -> Store:
    store = open_store()
    if store is None:
        raise InputError("there is no home folder to keep anything in; name one by ILLUM_CACHE")
    if (fact := distrust(store.folder)) is not None:
        raise InputError(f"{store.folder}: {fact}")
    return store

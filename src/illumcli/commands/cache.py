"""What is kept between runs: list it, verify it, take some or all of it away."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from illumcli.cache.store import (
    Entry,
    Pruned,
    Refused,
    Store,
    described,
    distrust,
    open_store,
    removed,
    size_of,
)
from illumcli.errors import InputError, OutputError
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
            buffer = described(entry.path)["about"]["buffer"]
        except FileNotFoundError:
            continue
        except (OSError, Refused, LookupError, TypeError):  # the last two: a description of something else
            buffer = None
        # a name is printed, and may have been made up to move the terminal's cursor
        named = isinstance(buffer, str) and buffer.isprintable()
        found.append((entry, str(buffer) if named else "damaged"))
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


class Verified(Value):
    """What is sound, and what was wrong with the rest."""

    sound: int
    faults: Mapping[Path, str]
    """By entry, those removed and those that stay."""
    stayed: Mapping[Path, str]
    """Of these, the ones that could not be removed, and why."""


def verify() -> Verified:
    """Read every entry and remove those that are not sound."""
    store = _opened()
    count = len(store.entries())
    faults = store.faults()
    stayed = {path: fact for path in faults if (fact := removed(path)) is not None}
    return Verified(count - len(faults), faults, stayed)


def prune(size: str | None = None) -> Pruned:
    """Take the least recently used entries away until the rest has at most `size`, the limit by default."""
    store = _opened()
    try:
        return store.prune(store.limit if size is None else size_of(size))
    except ValueError:
        raise InputError(f"--size {size}: write it as 500M or 4G") from None


def clear() -> Pruned:
    """Take everything away."""
    return _opened().prune(0)


def refuse_stayed(stayed: Mapping[Path, str]) -> None:
    """Raise OutputError where entries could not be removed."""
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

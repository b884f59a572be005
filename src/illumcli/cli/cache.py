"""``illum cache``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from illumcli.commands.cache import Pruned


@click.group()
def cache() -> None:
    """Manage the cache of parsed meshes, primary hits, shadows and obscurance.

    Every entry is identified by all that it depends on and verified when it is read; removing entries only
    costs time. The folder is ILLUM_CACHE, else `illum` in XDG_CACHE_HOME, else ~/.cache/illum.
    ILLUM_CACHE_SIZE limits the size of all entries, by default 4G: the least recently used are removed first.
    """


@cache.command("list")
def list_() -> None:
    """Print every entry: bytes, when it was last used, key, buffer."""
    from illumcli.commands.cache import listing, table

    click.echo(table(listing()))


@cache.command()
def verify() -> None:
    """Read every entry and remove those that are damaged."""
    from illumcli.commands.cache import refuse_stayed
    from illumcli.commands.cache import verify as run

    done = run()
    for path, fact in done.faults.items():
        click.echo(f"{path}: {fact}; {'not removed' if path in done.stayed else 'removed'}")
    click.echo(f"{done.sound} sound, {len(done.faults) - len(done.stayed)} removed")
    refuse_stayed(done.stayed)


@cache.command()
@click.option("--size", metavar="SIZE", help="Bytes that may stay, as 500M or 4G; by default the limit.")
def prune(size: str | None) -> None:
    """Remove the least recently used entries until the rest fits."""
    from illumcli.commands.cache import prune as run

    _tell(run(size))


@cache.command()
def clear() -> None:
    """Remove every entry."""
    from illumcli.commands.cache import clear as run

    _tell(run())


def _tell(pruned: Pruned) -> None:
    from illumcli.commands.cache import refuse_stayed

    click.echo(f"{len(pruned.gone)} removed, {sum(entry.bytes for entry in pruned.gone):,} bytes")
    refuse_stayed(pruned.stayed)

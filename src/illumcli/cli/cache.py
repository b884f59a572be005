"""``illum cache``."""

from __future__ import annotations

import click


@click.group()
def cache() -> None:
    """What is kept between runs: parsed meshes, primary hits, shadows, obscurance.

    Entries are named by what they depend on and checked whenever they are read; to remove them costs time
    only. The folder is ILLUM_CACHE, else `illum` in XDG_CACHE_HOME, else ~/.cache/illum; ILLUM_CACHE_SIZE is
    how much all entries may take, by default 4G: the least recently used go first.
    """


@cache.command("list")
def list_() -> None:
    """Print every entry: bytes, when it was last used, key, buffer."""
    from illumcli.jobs.cache import listing, table

    click.echo(table(listing()))


@cache.command()
def verify() -> None:
    """Read every entry and remove those that are damaged."""
    from illumcli.jobs.cache import verify as run

    sound, faults = run()
    for path, fact in faults.items():
        click.echo(f"{path}: {fact}; removed")
    click.echo(f"{sound} sound, {len(faults)} removed")


@cache.command()
@click.option("--size", metavar="SIZE", help="Bytes that may stay, as 500M or 4G; by default the limit.")
def prune(size: str | None) -> None:
    """Remove the least recently used entries until the rest fits."""
    from illumcli.jobs.cache import prune as run

    gone = run(size)
    click.echo(f"{len(gone)} removed, {sum(entry.bytes for entry in gone):,} bytes")


@cache.command()
def clear() -> None:
    """Remove every entry."""
    from illumcli.jobs.cache import clear as run

    gone = run()
    click.echo(f"{len(gone)} removed, {sum(entry.bytes for entry in gone):,} bytes")

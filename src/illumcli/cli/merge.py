"""``illum merge``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import FILE, force_option, quiet_option
from illumcli.cli._printing import print_paths, say_kept


@click.command()
@click.argument("folders", metavar="DIR...", type=FILE, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=FILE,
    required=True,
    help="Folder of the merged files.",
)
@force_option("Replace different files.")
@quiet_option
def merge(folders: tuple[Path, ...], output: Path, force: bool, quiet: bool) -> None:
    """Merge the shards of a command (--shard I/N): print the path of every merged file.

    Each DIR has records of shards (shard-I-of-N.json) and their files. Pictures are copied; table, sheet and
    report are written as one process writes them. What is missing is named, and the exit code is 1.

    \b
      illum sweep scene.yaml -D ambient=0.1:0.9:9 -o 'a/{ambient}.png' --table a/table.csv --shard 1/2
      illum sweep scene.yaml -D ambient=0.1:0.9:9 -o 'b/{ambient}.png' --table b/table.csv --shard 2/2
      illum merge a b -o all
    """
    from illumcli.commands.merge import merge as merged

    result = merged(folders, output, force)
    print_paths(result.paths)
    if not quiet:
        say_kept(result.kept)
    result.refuse_missing()

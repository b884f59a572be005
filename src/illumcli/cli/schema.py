"""``illum schema``."""

from __future__ import annotations

import click

from illumcli.cli._options import models_option


@click.command()
@models_option
def schema() -> None:
    """Print the JSON schema of scene files.

    \b
    An editor that knows YAML schemas completes and checks a scene that begins with
      # yaml-language-server: $schema=scene.schema.json
    """
    from illumcli.commands.schema import schema_text

    click.echo(schema_text(), nl=False)

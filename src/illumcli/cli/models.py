"""``illum models``."""

from __future__ import annotations

import click


@click.command()
@click.argument("name", required=False)
def models(name: str | None) -> None:
    """Print the illumination models, or all about the model NAME.

    \b
    Examples:
      illum models
      illum models cook_torrance
    """
    from illumcli.commands.models import page, table

    click.echo(page(name) if name else table())

"""``illum models``."""

from __future__ import annotations

import click

from illumcli.cli._options import json_option, models_option


@click.command()
@click.argument("name", required=False)
@models_option
@json_option
def models(name: str | None, as_json: bool) -> None:
    """Print the illumination models, or all about the model NAME.

    \b
    Examples:
      illum models
      illum models cook_torrance
    """
    from illumcli.commands.models import data, page, table

    if as_json:
        import json

        click.echo(json.dumps(data(name), indent=1))
    else:
        click.echo(page(name) if name else table())

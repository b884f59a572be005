"""``illum stress``."""

from __future__ import annotations

import click

from illumcli.cli._options import json_option, quiet_option


@click.command()
@click.option("--quick", is_flag=True, help="Every case, small: some seconds instead of some minutes.")
@json_option
@quiet_option
def stress(quick: bool, as_json: bool, quiet: bool) -> None:
    """Run the numerical stability suite: scenes, rays, models and meshes at the limits.

    Every picture is rendered from a scene file to an image file and read back. Scenes that make no sense must
    be refused; all others must render without NaN, infinite or negative values.

    Exit status: 0 all passed, 3 some case failed.
    """
    import json

    from illumcli.cli._progress import reporter
    from illumcli.stress.suite import refuse_failures, run_suite, suite_table

    result = run_suite(quick, reporter(quiet))
    click.echo(json.dumps(result.as_data(), indent=2) if as_json else suite_table(result))
    refuse_failures(result)

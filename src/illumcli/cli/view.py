"""``illum view``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import (
    overrides_option,
    quiet_option,
    scene_argument,
    studio_options,
    threads_option,
)
from illumcli.cli._printing import say


@click.command()
@scene_argument
@overrides_option
@studio_options
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="The port; by default a free one.")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="The address to listen at. With another one, whoever knows the page's address can use it from "
    "elsewhere, and saves in the scene's folder or below alone.",
)
@click.option("--no-browser", is_flag=True, help="Open no browser; the address is printed.")
@threads_option
@quiet_option
def view(
    scene: Path,
    overrides: tuple[str, ...],
    port: int,
    host: str,
    no_browser: bool,
    threads: int | None,
    quiet: bool,
) -> None:
    """Explore a SCENE, a scene file or a mesh, live in a browser; print the page's address.

    The page has a control for every parameter, moves cameras by the mouse, switches models and layers, and
    draws BRDFs. Its pictures are those of illum render. Ctrl-C ends it. It needs websockets: pip install
    'illumcli[view]'.

    \b
    Examples:
      illum view scenes/teapot.yaml
      illum view bunny.obj --no-browser --port 8000
    """
    from illumcli.viewer.pictures import Renderer
    from illumcli.viewer.server import Viewer
    from illumcli.viewer.session import Session

    Renderer(scene, overrides, threads).loaded()  # faults of the scene are told before a page opens
    viewer = Viewer(
        lambda send: Session(Renderer(scene, overrides, threads, saves_anywhere=viewer.is_local), send),
        host,
        port,
    )
    click.echo(viewer.url)
    if not quiet:
        say("Ctrl-C ends the view")
    if not no_browser:
        import webbrowser

        webbrowser.open(viewer.url)
    viewer.run()

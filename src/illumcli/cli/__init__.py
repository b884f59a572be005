"""The ``illum`` command: options and printing; each command imports its function when it is invoked."""

from __future__ import annotations

import gc
import os
import signal
import sys
from importlib import import_module
from types import FrameType
from typing import Any

import click

from illumcli import __version__
from illumcli.cli._streams import open_standard_streams
from illumcli.errors import LITTLE_MEMORY, IllumError, LimitError, OutputError, known
from illumcli.memory import refuse_little

_TO_LOAD = 160 << 20
"""Bytes that numpy's linear algebra needs to load; with less it ends the process by itself."""

STOPS = (signal.SIGINT, signal.SIGTERM)

COMMANDS = {
    "render": "Render scenes; print the path of every image.",
    "sweep": "Render the variants of a scene; share what they have in common.",
    "ao-bake": "Bake obscurance at the vertices of a mesh or scene.",
    "merge": "Merge the shards of a command: pictures, tables, sheets, reports.",
    "view": "Explore a scene live in a browser.",
    "plan": "Show what will run for a scene, what is skipped and why.",
    "check": "Validate scenes; report all problems at once.",
    "compare": "Measure the difference between two images.",
    "converge": "Measure run time and error at increasing sample counts.",
    "verify": "Check the models against reference vectors.",
    "stress": "Run the numerical stability suite.",
    "models": "List models, their parameters, ranges, formulas, sources.",
    "brdf": "Draw models: polar slices, a lit sphere and floor, lobes.",
    "measure": "Measure the BRDF of a surface with real bumps.",
    "fit": "Fit models to a measured BRDF; print materials.",
    "cache": "List, verify and prune the cache.",
    "schema": "Print the JSON schema of scenes.",
}


class Commands(click.Group):
    """The commands by module name; `illum --help` imports none of them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        refuse_little(_TO_LOAD)
        from illumcli.cli._options import with_common

        module = name.replace("-", "_")
        return with_common(getattr(import_module(f"illumcli.cli.{module}"), module))

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError:
            import difflib

            near = difflib.get_close_matches(args[0], COMMANDS, n=1)
            advice = f"did you mean '{near[0]}'?" if near else "see illum --help"
            raise click.UsageError(f"no command '{args[0]}'; {advice}", ctx) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, message="illum %(version)s")
def illum() -> None:
    """Render scene files in batches: local illumination models, shadows, obscurance.

    \b
    Examples:
      illum render scenes/teapot.yaml
      illum render scene.yaml -D materials.clay.roughness=0.3 -o out/{scene}.exr
      illum render bunny.obj
    """


def main() -> None:
    """Run the command; an IllumError becomes its message and exit code, a signal ends the process."""
    for number in STOPS:
        signal.signal(number, _unwind)
    # start-up allocates many live objects; the default thresholds rescan them, 5 % of start-up
    gc.set_threshold(100_000, 50, 50)
    # tiles run on our own threads; threads of numpy's linear algebra would only compete with them
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # in search of plugins, pydantic would read the metadata of every installed package: 5 % of start-up
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    status = 1
    try:
        output = open_standard_streams()
        status = _status()
        sys.stdout.flush()
        if output.fault is not None and status == 0:
            fact = f"standard output: cannot be written: {output.fault.strerror}"
            status = _reported(OutputError(f"{fact}; send it elsewhere, as in > FILE"))
        sys.stderr.flush()
    except _Stopped as stop:
        _die_by(stop.number)
    except MemoryError:
        status = _reported(LimitError(LITTLE_MEMORY))
    # skip interpreter shutdown: it costs an eighth of a small render, and after an error it may wait for
    # threads of Embree that could not start
    os._exit(status)


def _status() -> int:
    """Run the command and print its error. Returns the exit code; 1 means a fault of the program."""
    try:
        code = illum.main(standalone_mode=False)
        return code if isinstance(code, int) else 0
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except Exception as error:
        if (stop := _stop_behind(error)) is not None:
            raise stop from None
        if (fault := known(error)) is None:
            raise
        return _reported(fault)


def _reported(error: IllumError) -> int:
    click.echo(f"{error}", err=True)
    return error.exit_code


class _Stopped(BaseException):
    """A signal requests the end of the process."""

    def __init__(self, number: int) -> None:
        self.number = number


def _stop_behind(error: BaseException | None) -> _Stopped | None:
    """The stop that an error came of: code of `threading` that a signal interrupts may fail over its lock."""
    while error is not None and not isinstance(error, _Stopped):
        error = error.__context__
    return error


def _unwind(number: int, frame: FrameType | None) -> None:
    """The first signal raises, so that open files are discarded; a second one ends the process at once.

    So does a signal during an import: some libraries abort if an exception interrupts their initialisation.
    """
    for each in STOPS:
        signal.signal(each, _end)
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            _die_by(number)
        frame = frame.f_back
    raise _Stopped(number)


def _end(number: int, frame: FrameType | None) -> None:
    _die_by(number)


def _die_by(number: int) -> None:
    """End by the signal itself, so that the caller sees it; removes temporary files."""
    for each in STOPS:
        signal.signal(each, signal.SIG_IGN)  # discarding is short
    # the module may not be imported yet, or only in part: then no file is open
    if discard := getattr(sys.modules.get("illumcli.files.atomic"), "discard_open", None):
        discard()
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)

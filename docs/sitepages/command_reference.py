"""The command reference: a page for every command, from its own help."""

from __future__ import annotations

import inspect
import textwrap

import click

from illumcli.cli import COMMANDS, illum
from sitepages.model_pages import escaped

HEAD = """\
# Command reference

```text
{help}
```

```{{toctree}}
:maxdepth: 1

{pages}
```
"""


def pages() -> dict[str, str]:
    """Name -> text of the pages of commands."""
    top = click.Context(illum, info_name="illum")
    help_text = illum.get_help(top)
    names = "\n".join(f"commands/{name}" for name in COMMANDS)
    written = {"commands.md": HEAD.format(help=help_text, pages=names)}
    return written | {f"commands/{name}.md": _page(name, top) for name in COMMANDS}


def _page(name: str, top: click.Context) -> str:
    command = illum.get_command(top, name)
    assert command is not None
    context = click.Context(command, info_name=name, parent=top)
    usage = " ".join(command.collect_usage_pieces(context))
    lines = [f"# illum {name}", "", COMMANDS[name], "", f"```text\nillum {name} {usage}\n```", ""]
    lines += [_paragraph(text) for text in _paragraphs(command.help)]
    lines += ["## Options", "", f"```{{program}} illum {name}\n```", ""]
    for parameter in command.get_params(context):
        if isinstance(parameter, click.Option) and (record := parameter.get_help_record(context)):
            names, text = record
            lines += [f"```{{option}} {names.replace(' / ', ', ')}", escaped(text), "```", ""]
    lines += [_paragraph(text) for text in _paragraphs(command.epilog)]
    return "\n".join(lines) + "\n"


def _paragraphs(text: str | None) -> list[str]:
    return inspect.cleandoc(text or "").split("\n\n")


def _paragraph(text: str) -> str:
    """A paragraph of a help text in Markdown; what click does not wrap is shown as it stands."""
    if text.startswith("\b\n"):
        return f"```text\n{textwrap.dedent(text[2:])}\n```\n"
    return escaped(text) + "\n"

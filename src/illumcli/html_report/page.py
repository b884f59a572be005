"""The page of a report: a template, filled with its title, parameters and measures."""

from __future__ import annotations

from collections import Counter

from illumcli import __version__
from illumcli.html_report.columns import measures_of, parameters_of
from illumcli.html_report.entries import Contents

GENERATOR = 'name="generator" content="illum '
SCRIPTS = ("dom", "selection", "pixels", "stage", "cards", "gallery", "grid", "table", "dialogs", "main")
"""The scripts of the page, in the order in which they run."""


def page(contents: Contents) -> str:
    """HTML; every text in it is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("illumcli.html_report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    entries = contents.entries
    text: str = environment.get_template("index.html").render(
        version=__version__,
        title=contents.title,
        noun=contents.noun,
        count=len(entries),
        states=Counter(entry.state for entry in entries),
        parameters=parameters_of(contents),
        measures=[measure for measure in measures_of(contents) if measure.limits],
        ranged=[measure for measure in measures_of(contents) if measure.varies],
        pictures=list(dict.fromkeys(name for entry in entries for name in entry.pictures)),
        scripts=SCRIPTS,
    )
    return text

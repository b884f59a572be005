"""A report of painted pictures."""

from __future__ import annotations

import pytest

from illumcli.html_report.folder import write_report
from painted import contents_of


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """The folder of a report of 60 variants."""
    folder = tmp_path_factory.mktemp("report of a sweep")
    write_report(folder / "report", contents_of(folder))
    return folder / "report"

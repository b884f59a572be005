"""pydantic without plugins: nothing searches for them, and its own search is still there."""

from __future__ import annotations

import subprocess
import sys


def printed(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_models_validate_and_no_reader_of_metadata_is_imported():
    code = """
import sys
from illumcli.cli._plugins import disable_plugins
disable_plugins()
from pydantic import BaseModel
class Model(BaseModel):
    width: int
print(Model(width=3), "importlib.metadata" in sys.modules)
"""
    assert printed(code).split() == ["width=3", "False"]


def test_what_else_pydantic_expects_of_its_search_is_there():
    code = """
from illumcli.cli._plugins import disable_plugins
disable_plugins()
from pydantic.plugin._loader import PYDANTIC_ENTRY_POINT_GROUP, get_plugins
print(PYDANTIC_ENTRY_POINT_GROUP, get_plugins())
"""
    assert printed(code).split() == ["pydantic", "()"]

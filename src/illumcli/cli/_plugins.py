"""pydantic without plugins."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _NoSearch(ModuleType):
    """In place of pydantic's search for plugins."""

    get_plugins = tuple

    def __getattr__(self, name: str) -> Any:
        """Anything else that a version of pydantic expects of the search, from the search itself."""
        if name.startswith("__"):
            raise AttributeError(name)
        del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


def disable_plugins() -> None:
    """Let pydantic find no plugins, in this process and in its children.

    The search reads the metadata of every installed package. Where it is only disabled, by the environment,
    it still imports what reads them, with readers of mail and zip files: 5 % of a small render.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    search = _NoSearch("pydantic.plugin._loader")
    sys.modules.setdefault(search.__name__, search)

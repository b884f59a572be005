"""Packages that are functions of the interface, too.

``illumcli.models`` is the package of the models, and ``illumcli.models("ward")`` tells about one.
Once a package is imported, Python makes it an attribute of the one above. A function of the same name there
would come and go with the order of imports; a package that can be called is both, in every order.
"""

from __future__ import annotations

import sys
from importlib import import_module
from inspect import Signature, signature
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """A package that is called as the function of its name in another module."""

    _function_in: str
    """Name of this module, which is imported with the first call."""

    def __call__(self, *values: Any, **keywords: Any) -> Any:
        return self._function()(*values, **keywords)

    def _function(self) -> Any:
        return getattr(import_module(self._function_in), self.__name__.rpartition(".")[2])

    @property
    def __signature__(self) -> Signature:
        """That of the function, which editors show."""
        return signature(self._function())

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is the package itself, in another process too."""
        return import_module, (self.__name__,)


def make_callable(package: str, function_in: str) -> None:
    """Let a package be called as the function of its name in the module `function_in`."""
    module = sys.modules[package]
    module.__class__ = CallablePackage
    vars(module)["_function_in"] = function_in

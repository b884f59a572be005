"""Falloffs mu(d), one file each: the file's name is the tag of ``falloff:`` in a scene."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.schema.families import Family
from illumcli.visibility.falloffs._base import Falloff

AnyFalloff: TypeAlias = Annotated[Falloff, Family("illumcli.visibility.falloffs", "falloff")]

"""Falloffs mu(d), one file each: the file's name is the tag of ``falloff:`` in a scene."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.schema.families import Tagged
from illumcli.visibility.falloffs._base import Falloff

AnyFalloff: TypeAlias = Annotated[Falloff, Tagged("illumcli.visibility.falloffs", "falloff")]

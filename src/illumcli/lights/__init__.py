"""Light types, one file each: the file's name is the tag of ``light:`` in a scene."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.lights._base import Light
from illumcli.schema.families import Family

AnyLight: TypeAlias = Annotated[Light, Family("illumcli.lights", "light")]

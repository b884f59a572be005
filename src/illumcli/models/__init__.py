"""Illumination models, one file each: the file's name is the tag of ``model:`` in a scene."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.models._base import IlluminationModel
from illumcli.schema.families import Family

AnyModel: TypeAlias = Annotated[IlluminationModel, Family("illumcli.models", "model")]

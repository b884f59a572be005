"""Illumination models, one file each: the file's name is the tag of ``model:`` in a scene.

Called, the package is the function of the interface: ``illumcli.models("ward")``.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.callable_package import make_callable
from illumcli.models._base import IlluminationModel
from illumcli.schema.families import Family

AnyModel: TypeAlias = Annotated[IlluminationModel, Family("illumcli.models", "model")]

make_callable(__name__, "illumcli.api.model_records")

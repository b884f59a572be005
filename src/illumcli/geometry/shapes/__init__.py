"""Built-in shapes, one file each: the file's name is the tag of ``shape:`` in a scene.

All stand y up around the origin and, unless asked otherwise, fill the cube from -1 to 1.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.geometry.shapes._base import Shape
from illumcli.schema.families import Family

AnyShape: TypeAlias = Annotated[Shape, Family("illumcli.geometry.shapes", "shape")]

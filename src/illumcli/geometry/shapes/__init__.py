"""Built-in shapes, one file each: the file's name is the tag of ``shape:`` in a scene.

All have y up, are centred at the origin and by default fill the cube from -1 to 1.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.geometry.shapes._base import Shape
from illumcli.schema.families import Family

AnyShape: TypeAlias = Annotated[Shape, Family("illumcli.geometry.shapes", "shape")]

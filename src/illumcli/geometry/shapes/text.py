"""Letters, flat or raised, that stand upright in z = 0 and face +z: labels and titles in a picture.

They are strokes of one width with round ends. There are the letters, digits and signs of ASCII, and
° × ± · − – α β θ λ μ π ρ σ τ φ.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field, field_validator

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Shape
from illumcli.geometry.shapes._letters import CAPITAL_HEIGHT, LETTER_GAP, LETTERS, SPACE
from illumcli.geometry.shapes._strokes import Face, Points, middle_lines, thick_lines
from illumcli.schema.fields import NonNegative, Positive

MAX_LETTERS = 10_000
LETTER_TRIANGLES = 1000
"""Upper bound of one letter's."""
LINE_HEIGHT = 1.8
"""From line to line, in heights of a capital."""
SHARES = {"left": 0.0, "centre": 0.5, "right": 1.0}

Lettering: TypeAlias = Annotated[
    str,
    Field(max_length=MAX_LETTERS),
    BeforeValidator(
        lambda value: str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value,
        json_schema_input_type=str | float,
    ),
]


class Text(Shape):
    shape: Literal["text"] = "text"
    text: Lettering
    """What is written, or a number; `\\n` in double quotes begins a new line."""
    height: Positive = 1.0
    """Of a capital [scene units]."""
    weight: Annotated[float, Field(ge=0.01, le=0.15)] = 0.12
    """Width of the strokes, as a share of the height."""
    align: Literal["left", "centre", "right"] = "left"
    """The part of each line that is at x = 0; the first line stands on y = 0. `left`: its left end. `centre`:
    its middle. `right`: its right end."""
    depth: NonNegative = 0.0
    """How far the letters rise from z = 0 towards +z; 0 is flat [scene units]."""

    @field_validator("text")
    @classmethod
    def _can_be_drawn(cls, text: str) -> str:
        strange = sorted(set(text) - set(LETTERS) - {" ", "\n"})
        if strange:
            raise ValueError(f"there is no letter for {' '.join(strange)}; there are {' '.join(LETTERS)}")
        if not text.strip():
            raise ValueError("must have a letter that is not a space")
        return text

    def triangles(self) -> int:
        return LETTER_TRIANGLES * len(self.text)

    def mesh(self) -> Mesh:
        """The strokes' faces; if they rise, walls and backs, too. Normals follow from the faces."""
        radius = CAPITAL_HEIGHT * self.weight / (1 - self.weight) / 2
        points: list[Points] = []
        faces: list[Face] = []
        for row, line in enumerate(self.text.split("\n")):
            letters, width = _line(line, radius)
            left = radius - SHARES[self.align] * (width + 2 * radius)
            up = radius - row * LINE_HEIGHT * (CAPITAL_HEIGHT + 2 * radius)
            for outline, own_faces in letters:
                start = sum(len(each) for each in points)
                points.append(outline + np.array([left, up]))
                faces += [[corner + start for corner in face] for face in own_faces]
        flat = np.concatenate(points) * self.height / (CAPITAL_HEIGHT + 2 * radius)
        return _raised(flat, faces, self.depth) if self.depth else _mesh(flat, 0.0, faces)


def _line(text: str, radius: float) -> tuple[list[tuple[Points, list[Face]]], float]:
    """The letters of a line, one after the other from x = 0, and the width of their middle lines."""
    letters, x = [], 0.0
    for character in text:
        if character == " ":
            x += SPACE + LETTER_GAP
            continue
        points, faces, width = _letter(character, radius)
        letters.append((points + np.array([x, 0]), faces))
        x += width + LETTER_GAP
    return letters, x - LETTER_GAP


@cache
def _letter(character: str, radius: float) -> tuple[Points, list[Face], float]:
    """Points and faces of one letter, and the width of its middle lines."""
    lines = middle_lines(LETTERS[character])
    return *thick_lines(lines, radius), max(float(line[:, 0].max()) for line in lines)


def _mesh(flat: Points, z: float, faces: list[Face]) -> Mesh:
    return Mesh(
        vertices=np.column_stack([flat, np.full(len(flat), z)]),
        corners=np.concatenate(faces).astype(np.int32),
        starts=np.cumsum([0, *map(len, faces)]).astype(np.int32),
    )


def _raised(flat: Points, faces: list[Face], depth: float) -> Mesh:
    """Fronts at z = `depth`, backs at z = 0, and walls where an edge has a face on one side alone."""
    edges = {edge for face in faces for edge in zip(face, [*face[1:], face[0]], strict=True)}
    back = len(flat)
    walls = [[a + back, b + back, b, a] for a, b in sorted(edges) if (b, a) not in edges]
    backs = [[corner + back for corner in reversed(face)] for face in faces]
    both = _mesh(np.concatenate([flat, flat]), 0.0, [*faces, *backs, *walls])
    vertices = both.vertices.copy()
    vertices[:back, 2] = depth
    return Mesh(vertices=vertices, corners=both.corners, starts=both.starts)
